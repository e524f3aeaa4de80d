"""Layout `rows_cols`: a folder of views with row and column in their names.

Such as `2067_01_09.png`, `view_3_4.png`, `Cam_r03_c05.png` or the Stanford gantry's
`out_00_16_-776.88_1010.5_.png`: counted from 0 or 1, padded or not, the row first. Among the whole
numbers of the names, row and column are the two that fill a rectangle best.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from epinet.errors import InputError
from epinet.io.folder import Position, read_grid, write_views
from epinet.io.images import image_files
from epinet.io.layout import Layout
from epinet.io.names import alike, integer_fields, one_kind, renumbered
from epinet.lightfield import LightField


@dataclass(frozen=True)
class _Reading:
    """One way to find row and column in the names."""

    fields: tuple[int, int]
    """Which numbers of a name are row and column."""
    positions: list[Position]
    """As written in the names, in the order of the files."""

    @property
    def first(self) -> Position:
        return min(row for row, _ in self.positions), min(col for _, col in self.positions)

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) that the positions span."""
        first_row, first_col = self.first
        last_row = max(row for row, _ in self.positions)
        last_col = max(col for _, col in self.positions)
        return last_row - first_row + 1, last_col - first_col + 1

    @property
    def filled(self) -> float:
        """Share of the grid that is there."""
        rows, cols = self.grid
        return len(self.positions) / (rows * cols)

    @property
    def plausible(self) -> bool:
        """Each position once, and more of them than a line or a diagonal has."""
        count = len(self.positions)
        return (
            len(set(self.positions)) == count
            and min(self.grid) >= 3
            and count >= 2 * max(self.grid)
        )


def recognises(folder: Path) -> bool:
    """Whether two numbers in the names span a grid."""
    return bool(_readings(alike(image_files(folder))[0]))


def read(folder: Path) -> LightField:
    """Read the views, all or only the star.

    Raises:
        InputError: names without row and column or with several readings, a grid that is not
            square, and what `read_grid` refuses.
    """
    files, ignored = one_kind(image_files(folder))
    reading = _best_reading(folder, files)
    rows, cols = reading.grid
    first_row, first_col = reading.first
    if rows != cols:
        raise InputError(
            f"{folder}: the names span {rows} rows ({first_row} to {first_row + rows - 1}) and "
            f"{cols} columns ({first_col} to {first_col + cols - 1}); the grid must be square"
        )
    by_position = {
        (row - first_row, col - first_col): file
        for (row, col), file in zip(reading.positions, files, strict=True)
    }

    def name(row: int, col: int) -> str:
        row_field, col_field = reading.fields
        return renumbered(files[0], {row_field: row + first_row, col_field: col + first_col})

    return read_grid(by_position, rows, name, folder, ignored)


def write(folder: Path, lf: LightField) -> None:
    """Write `view_<row>_<col>.png`, counted from 0."""
    write_views(folder, lf, lambda row, col: f"view_{row:02d}_{col:02d}.png")


def _readings(files: list[Path]) -> list[_Reading]:
    """The plausible ones, the fullest first."""
    fields = integer_fields(files)
    readings = [
        _Reading((i, j), list(zip(fields[i], fields[j], strict=True)))
        for i, j in combinations(fields, 2)
    ]
    plausible = [reading for reading in readings if reading.plausible]
    return sorted(plausible, key=lambda reading: reading.filled, reverse=True)


def _best_reading(folder: Path, files: list[Path]) -> _Reading:
    readings = _readings(files)
    remedy = "name the views view_<row>_<column>.png"
    if not readings:
        raise InputError(f"{folder}: no two numbers in the images' names span a grid; {remedy}")
    best = readings[0]
    rivals = [reading for reading in readings if reading.filled == best.filled]
    if len(rivals) > 1:
        choices = " or ".join(f"{r.fields[0] + 1} and {r.fields[1] + 1}" for r in rivals)
        raise InputError(
            f"{folder}: in names like {files[0].name} row and column may be the numbers "
            f"{choices}; {remedy}"
        )
    return best


LAYOUT = Layout(
    name="rows_cols",
    description="folder of images with row and column in their names (view_3_4.png ...)",
    recognises=recognises,
    read=read,
    write=write,
    file_names=r"view_\d{2,}_\d{2,}\.png",
)
