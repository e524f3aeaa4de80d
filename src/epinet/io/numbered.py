"""Layout `numbered`: a folder of views numbered row by row from the top-left.

Such as `0.png` ... `80.png`, `img_001.png` ... `img_081.png` or `shot2.0010.png`, `shot2.0020.png`
and so on: from any first number, every one or every k-th, and as many as fill a square grid. That a
square count is a square grid is a guess: where the images clearly fit another arrangement, such as
a row of cameras, the views are refused.
"""

from __future__ import annotations

from math import isqrt
from pathlib import Path

from epinet.errors import InputError
from epinet.inspect.numbering import other_arrangement
from epinet.io.folder import one_kind, read_grid, write_views
from epinet.io.images import image_files
from epinet.io.layout import Layout
from epinet.io.names import Field, alike, fields, renamed
from epinet.lightfield import LightField

_MOST_GAPS = 5
_SPARSEST = 4
"""Numbers for each view, behind a dot: more of them are digits of a fraction."""


def recognises(folder: Path) -> bool:
    """Whether a number tells at least nine images apart."""
    files, _ = alike(image_files(folder))
    return len(files) >= 9 and _field(files) is not None


def read(folder: Path) -> LightField:
    """Read the views, all or only the star.

    Raises:
        InputError: no number that tells the images apart, a count that is not a square, images
            that fit another arrangement than a square grid, and what `one_kind` and `read_grid`
            refuse.
    """
    files, ignored = one_kind(image_files(folder))
    field = _field(files)
    if field is None:
        raise InputError(
            f"{folder}: the images' names hold no number that tells them apart; "
            "name the views 000.png, 001.png ..., row by row from the top-left"
        )
    step = _step(field)
    side = isqrt((field.count - 1) * step + 1)
    if side**2 != (field.count - 1) * step + 1:
        raise _no_square(folder, field)
    by_position = {
        divmod(index * step, side): file for index, file in zip(field.indices, files, strict=True)
    }

    def name(row: int, col: int) -> str:
        index, between = divmod(side * row + col, step)
        return renamed(files[0], files, {field: index}) if not between else "*"

    lf = read_grid(by_position, side, name, folder, ignored)
    if step == 1:
        check_arrangement(folder, lf, len(files))
    return lf


def check_arrangement(folder: Path, lf: LightField, count: int) -> None:
    """Refuse views of plain numbers that are consistent in another arrangement only.

    Args:
        folder: where they lie.
        lf: as a square grid.
        count: of the numbers. Where it is not that of the views, gaps tell the grid's size.

    Raises:
        InputError: naming the arrangement.
    """
    rows, cols = lf.grid
    if count != rows * cols or not lf.present.all():
        return
    if other := other_arrangement(lf):
        raise InputError(
            f"{folder}: the {count} images would fill {rows}x{cols} views by their numbers, but "
            f"they fit {other.rows}x{other.cols} (rows x columns) {other.margin:.1f} times better; "
            "a square grid is needed. If it is one, name the views view_<row>_<column>.png"
        )


def _step(field: Field) -> int:
    """How many numbers of the grid lie from one index to the next: more where rows are skipped."""
    whole = (field.count - 1) * field.step + 1
    if isqrt(whole) ** 2 == whole and len(field.indices) < field.count:
        return field.step
    return 1


def write(folder: Path, lf: LightField) -> None:
    """Write `000.png` onwards."""
    side = lf.grid[1]
    write_views(folder, lf, lambda row, col: f"{side * row + col:03d}.png")


def _no_square(folder: Path, field: Field) -> InputError:
    there, gaps = set(field.indices), []
    for index in range(field.count):
        if index not in there:
            gaps.append(field.text(index))
        if len(gaps) > _MOST_GAPS:
            gaps[-1] = "..."
            break
    text = (
        f"{folder}: images numbered {field.text(0)} to {field.text(field.count - 1)}, "
        f"{field.count} views; a square grid has 9, 25, 49, 81 ..."
    )
    if gaps and isqrt(len(there)) ** 2 == len(there):
        text += (
            f" The {len(there)} images would fill one: {', '.join(gaps)} skipped; number without "
            "gaps"
        )
    return InputError(text)


def _field(files: list[Path]) -> Field | None:
    """Which whole number of the names differs in all of them; of several, the densest."""
    distinct = [f for f in fields(files) if len(set(f.indices)) == len(f.indices)]
    dense = [f for f in distinct if not f.by_dots or f.count <= _SPARSEST * len(files)]
    return min(
        (f for f in dense if not f.decimals),
        key=lambda field: (field.count, field.by_dots),
        default=None,
    )


LAYOUT = Layout(
    name="numbered",
    description="folder of images numbered row by row (000.png ..., a square count)",
    recognises=recognises,
    read=read,
    write=write,
    file_names=r"\d{3,}\.png",
)
