"""How many views a row of a camera array has, measured: numbers alone do not say."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from epinet.inspect.sweep import (
    ROUGH_STEP_PX,
    Offset,
    Star,
    rough_match,
    rough_range,
    sweep,
    working_image,
)
from epinet.lightfield import LightField

LONGER_SIDE_PX = 192
CLEAR_MARGIN = 1.25
"""The grid's residual over another arrangement's, from where on the other is believed."""


@dataclass(frozen=True)
class OtherArrangement:
    """One that fits the images better than the square grid."""

    rows: int
    cols: int
    margin: float
    """Residual of the square grid over that of this."""


def other_arrangement(lf: LightField) -> OtherArrangement | None:
    """Rows and columns by which views numbered one after another are consistent.

    The views next to the centre view's number, and those one row of the square grid before and
    after, are tried where each arrangement of the same numbers has them, the rows from either side.

    Args:
        lf: a square grid of at least 3x3, all views of which are there, in the order of numbers.

    Returns:
        None where the square grid fits as well as any, or the images do not tell.
    """
    side = lf.grid[0]
    count, centre = side * side, lf.centre[0] * side + lf.centre[1]
    numbers = (centre - side, centre - 1, centre + 1, centre + side)
    scale = min(1.0, LONGER_SIDE_PX / max(lf.size))
    views = {n: working_image(lf.gray(*divmod(n, side)), scale) for n in (centre, *numbers)}

    def star(of: tuple[int, ...], offsets: tuple[Offset, ...]) -> Star:
        stacked = torch.stack([views[n] for n in of])
        return Star(views[centre], stacked, offsets, scale).exposed_alike()

    residuals: dict[Offset, float] = {}
    for upright in (False, True):
        row, col = (1, 0) if upright else (0, 1)
        neighbours = star(numbers[1:3], ((-row, -col), (row, col)))
        rough = rough_match(neighbours)
        if not rough.is_distinct:
            continue
        low, high = rough_range(neighbours, rough)
        for length in (n for n in range(2, count + 1) if count % n == 0):
            grid = (length, count // length) if upright else (count // length, length)
            for sign in (-1, 1)[: 1 if length == count else 2]:
                offsets = [_offset(n, centre, length, sign) for n in numbers]
                placed = tuple(o[::-1] for o in offsets) if upright else tuple(offsets)
                match = sweep(star(numbers, placed), low, high, ROUGH_STEP_PX)
                residuals[grid] = min(residuals.get(grid, torch.inf), match.residual)
    if not residuals:
        return None
    square = residuals.pop((side, side), torch.inf)
    best = min(residuals, key=lambda grid: residuals[grid])
    margin = square / max(residuals[best], 1e-9)
    return OtherArrangement(*best, margin) if margin > CLEAR_MARGIN else None


def _offset(number: int, centre: int, length: int, sign: int) -> Offset:
    """(rows, columns) from the centre view where a row has so many."""
    row, col = divmod(number, length)
    centre_row, centre_col = divmod(centre, length)
    return sign * (row - centre_row), col - centre_col
