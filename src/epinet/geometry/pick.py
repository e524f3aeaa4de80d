"""The disparity at a pixel that someone points at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError

WINDOW_PX = 5
"""What is read is the median over a square of so many pixels, which outliers do not move."""
EDGE_PX = 0.2
"""A square whose disparities spread by more lies on an edge."""


@dataclass(frozen=True)
class Pick:
    """The disparity read at a pixel."""

    disparity_px: float
    spread_px: float
    """Largest minus smallest disparity in the square around it."""

    @property
    def on_edge(self) -> bool:
        return self.spread_px > EDGE_PX


def pick(disparity: NDArray[np.float32], x: int, y: int) -> Pick:
    """Read a map (H, W) around a pixel, counted from 0 at the top left.

    Raises:
        InputError: it lies outside the map, or no pixel around it has a disparity.
    """
    height, width = disparity.shape
    if not (0 <= x < width and 0 <= y < height):
        raise InputError(f"point {x},{y}: it lies outside the map of {width}x{height} px")
    reach = WINDOW_PX // 2
    square = disparity[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
    finite = square[np.isfinite(square)]
    if not finite.size:
        raise InputError(f"point {x},{y}: the map has no disparity there; choose another point")
    return Pick(float(np.median(finite)), float(np.ptp(finite)))


def parse_pixel(text: str) -> tuple[int, int]:
    """A pixel from "x,y".

    Raises:
        InputError: the text is no such thing.

    Example:
        >>> parse_pixel("120,88")
        (120, 88)
    """
    try:
        x, y = map(int, text.split(","))
    except ValueError as error:
        raise InputError(f"{text}: give a pixel as x,y in whole numbers, as in 120,88") from error
    return x, y
