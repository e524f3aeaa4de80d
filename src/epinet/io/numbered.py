"""Layout `numbered`: a folder of views numbered row by row from the top-left.

Such as `0.png` ... `80.png` or `img_001.png` ... `img_081.png`: from any first number, and as many
as fill a square grid.
"""

from __future__ import annotations

from math import isqrt
from pathlib import Path

from epinet.errors import InputError
from epinet.io.folder import read_grid, write_views
from epinet.io.images import image_files
from epinet.io.layout import Layout
from epinet.io.names import alike, integer_fields, one_kind, renumbered
from epinet.lightfield import LightField


def recognises(folder: Path) -> bool:
    """Whether a number tells at least nine images apart."""
    files, _ = alike(image_files(folder))
    return len(files) >= 9 and _field(files) is not None


def read(folder: Path) -> LightField:
    """Read the views, all or only the star.

    Raises:
        InputError: no number that tells the images apart, a count that is not a square, and what
            `read_grid` refuses.
    """
    files, ignored = one_kind(image_files(folder))
    field = _field(files)
    if field is None:
        raise InputError(
            f"{folder}: the images' names hold no number that tells them apart; "
            "name the views 000.png, 001.png ..., row by row from the top-left"
        )
    numbers = integer_fields(files)[field]
    first, last = min(numbers), max(numbers)
    side = isqrt(last - first + 1)
    if side * side != last - first + 1:
        raise InputError(
            f"{folder}: images numbered {first} to {last}, {last - first + 1} views; "
            "a square grid has 9, 25, 49, 81 ..." + _gaps(numbers, first, last)
        )
    by_position = {divmod(n - first, side): file for n, file in zip(numbers, files, strict=True)}

    def name(row: int, col: int) -> str:
        return renumbered(files[0], {field: first + side * row + col})

    return read_grid(by_position, side, name, folder, ignored)


def write(folder: Path, lf: LightField) -> None:
    """Write `000.png` onwards."""
    side = lf.grid[1]
    write_views(folder, lf, lambda row, col: f"{side * row + col:03d}.png")


def _gaps(numbers: list[int], first: int, last: int) -> str:
    """Which numbers are skipped, if there are as many images as a grid has."""
    gaps = sorted({*range(first, last + 1)} - {*numbers})
    if not gaps or isqrt(len(numbers)) ** 2 != len(numbers):
        return ""
    skipped = ", ".join(map(str, gaps[:5])) + ", ..." * (len(gaps) > 5)
    return f" The {len(numbers)} images would fill one: {skipped} skipped; number without gaps"


def _field(files: list[Path]) -> int | None:
    """Which number of the names differs in all of them; of several, the densest."""
    fields = integer_fields(files)
    spans = {
        field: max(values) - min(values)
        for field, values in fields.items()
        if len(set(values)) == len(values)
    }
    return min(spans, key=lambda field: spans[field], default=None)


LAYOUT = Layout(
    name="numbered",
    description="folder of images numbered row by row (000.png ..., a square count)",
    recognises=recognises,
    read=read,
    write=write,
    file_names=r"\d{3,}\.png",
)
