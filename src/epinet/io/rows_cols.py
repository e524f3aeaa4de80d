"""Layout `rows_cols`: a folder of views with row and column in their names.

Such as `2067_01_09.png`, `view_3_4.png`, `Cam_r03_c05.png`, `view_+1_-2.png`, `vm1_hp2.png`,
`cam.3.4.png` or the Stanford gantry's `out_00_16_-776.88_1010.5_.png`: from any first number, every
one or every k-th, signed or not, padded or not, the row first. Among the numbers of the names, row
and column are the two that fill a rectangle best.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, groupby
from pathlib import Path

from epinet.errors import InputError
from epinet.io.folder import Position, one_kind, read_grid, write_views
from epinet.io.images import image_files
from epinet.io.layout import Layout
from epinet.io.names import Field, alike, fields, renamed
from epinet.lightfield import LightField


@dataclass(frozen=True)
class _Reading:
    """One way to find row and column in the names."""

    row: Field
    col: Field

    @property
    def positions(self) -> list[Position]:
        """In the order of the files."""
        return list(zip(self.row.indices, self.col.indices, strict=True))

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) that the positions span."""
        return self.row.count, self.col.count

    @property
    def filled(self) -> float:
        """Share of the grid that is there."""
        return len(self.row.indices) / (self.row.count * self.col.count)

    @property
    def plausible(self) -> bool:
        """Each position once, and more of them than a line or a diagonal has."""
        count = len(self.row.indices)
        if len(set(self.positions)) < count:
            return False
        if min(self.grid) == 2:
            return self.filled == 1
        return min(self.grid) >= 3 and count >= 2 * max(self.grid)

    @property
    def rank(self) -> tuple[float, int]:
        """The lowest is the best: the fullest, and of these the one with the plainest numbers."""
        return -self.filled, max(self.row.by_dots, self.col.by_dots)


def recognises(folder: Path) -> bool:
    """Whether two numbers in the names span a grid."""
    return bool(_readings(alike(image_files(folder))[0]))


def read(folder: Path) -> LightField:
    """Read the views, all or only the star.

    Raises:
        InputError: names without row and column or with several readings, a grid that is not
            square, and what `one_kind` and `read_grid` refuse.
    """
    files, ignored = one_kind(image_files(folder))
    reading = _best_reading(folder, files)
    rows, cols = reading.grid
    if rows != cols:
        raise InputError(
            f"{folder}: the names, such as {files[0].name}, span {rows} rows "
            f"({_span(reading.row)}) and {cols} columns ({_span(reading.col)}); the grid must be "
            "square. If other numbers are row and column, name the views view_<row>_<column>.png"
        )

    def name(row: int, col: int) -> str:
        return renamed(files[0], files, {reading.row: row, reading.col: col})

    return read_grid(dict(zip(reading.positions, files, strict=True)), rows, name, folder, ignored)


def write(folder: Path, lf: LightField) -> None:
    """Write `view_<row>_<col>.png`, counted from 0."""
    write_views(folder, lf, lambda row, col: f"view_{row:02d}_{col:02d}.png")


def _readings(files: list[Path]) -> list[_Reading]:
    """The plausible ones, the best first."""
    pairs = combinations(fields(files), 2)
    readings = [_Reading(row, col) for row, col in pairs if row.split is col.split]
    return sorted((r for r in readings if r.plausible), key=lambda reading: reading.rank)


def _best_reading(folder: Path, files: list[Path]) -> _Reading:
    readings = _readings(files)
    remedy = "name the views view_<row>_<column>.png"
    if not readings:
        raise InputError(f"{folder}: no two numbers in the images' names span a grid; {remedy}")
    fullest = [reading for reading in readings if reading.filled == readings[0].filled]
    for _, level in groupby(fullest, key=lambda reading: reading.rank):
        rivals = list(level)
        if all(rival.positions == rivals[0].positions for rival in rivals):
            return rivals[0]
    rivals = [reading for reading in fullest if reading.rank == readings[0].rank]
    choices = " or ".join(f"{r.row.place + 1} and {r.col.place + 1}" for r in rivals)
    raise InputError(
        f"{folder}: in names like {files[0].name} row and column may be the numbers "
        f"{choices}; {remedy}"
    )


def _span(field: Field) -> str:
    return f"{field.text(0)} to {field.text(field.count - 1)}"


LAYOUT = Layout(
    name="rows_cols",
    description="folder of images with row and column in their names (view_3_4.png ...)",
    recognises=recognises,
    read=read,
    write=write,
    file_names=r"view_\d{2,}_\d{2,}\.png",
)
