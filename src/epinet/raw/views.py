"""From hexagonally placed lenslets to views of square pixels.

Rows of pixels are rows of lenslets; along a row, pixels are as far apart as the rows are, so only
one dimension is interpolated, by cubic splines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.raw.bayer import Image
from epinet.raw.lenslets import LensletGrid

_CORNER = 0.75
"""Share of a lenslet's radius at which the corner views look."""
_BEFORE, _AFTER = 1, 2
"""Lenslets of a row that the splines need beside the one before a pixel."""


@dataclass(frozen=True)
class Sampling:
    """Which views are taken from a grid of lenslets, and where their pixels lie on the sensor.

    Pixel (x, y) of view (row, col) is what the sensor sees near `points()[y, x]`, at
    `directions[row * views + col]` from the centres of lenslets.
    """

    grid: LensletGrid
    views: int
    size: tuple[int, int]
    """(height, width) of a view in pixels."""
    start: tuple[float, float]
    """Where pixel (0, 0) lies from the grid's origin, along its rows and across, in pixels."""

    @property
    def spacing_px(self) -> float:
        """Distance of a view's pixels on the sensor."""
        return self.grid.row_height_px

    @property
    def step_px(self) -> float:
        """Distance of adjacent views within a lenslet's image."""
        return _CORNER * self.grid.pitch_px / 2 / math.sqrt(2) / (self.views // 2)

    @property
    def directions(self) -> NDArray[np.float64]:
        """(views * views, 2) places (x, y) in a lenslet's image, from its centre, row by row.

        The first view, top-left, looks through the top left of the lens: the sensor's image is
        upright, so within it a lenslet shows the lens upright, too.
        """
        offset = (np.arange(self.views) - self.views // 2) * self.step_px
        down, along = (a.ravel()[:, None] for a in np.meshgrid(offset, offset, indexing="ij"))
        axis = self._axis
        return np.asarray(along * axis + down * np.array([-axis[1], axis[0]]))

    def points(self) -> NDArray[np.float64]:
        """(H, W, 2) places (x, y) on the sensor of a view's pixels."""
        along = self.start[0] + np.arange(self.size[1]) * self.spacing_px
        across = self.start[1] + np.arange(self.size[0]) * self.spacing_px
        axis = self._axis
        moved = across[:, None, None] * np.array([-axis[1], axis[0]]) + along[:, None] * axis
        return np.asarray(np.array(self.grid.origin) + moved)

    @property
    def _axis(self) -> NDArray[np.float64]:
        return np.array(self.grid.along) / self.grid.pitch_px

    def positions(self) -> NDArray[np.float64]:
        """(H, W) positions of pixels in their row of lenslets."""
        return np.asarray(self.grid.indices(self.points())[..., 0])

    def index(self) -> NDArray[np.intp]:
        """(H, N, 2) lenslets (i, j) that are needed: N of each row, from left to right."""
        positions = self.positions()
        first = np.floor(positions[:, 0]).astype(np.intp) - _BEFORE
        count = int((np.floor(positions[:, -1]) - first).max()) + 1 + _AFTER
        i = first[:, None] + np.arange(count)
        rows = round(self.start[1] / self.spacing_px) + np.arange(self.size[0])
        return np.stack([i, np.broadcast_to(rows[:, None], i.shape)], axis=-1)


def plan_sampling(grid: LensletGrid, sensor: tuple[int, int], views: int, where: str) -> Sampling:
    """The largest upright rectangle of a grid that is inside the sensor.

    Args:
        sensor: (height, width) in pixels.
        views: per row and column; odd.

    Raises:
        InputError: hardly a lenslet is inside.
    """
    height, width = sensor
    margin = grid.pitch_px / 2 + 2
    tilt = abs(np.sin(grid.rotation))
    spare = max(_BEFORE + 1, _AFTER + 1) * grid.pitch_px
    half_along = width / 2 - margin - spare - tilt * height / 2
    half_across = height / 2 - margin - tilt * width / 2
    spacing = grid.row_height_px
    if min(half_along, half_across) < 2 * spacing:
        raise InputError(f"{where}: {width}x{height} px hold too few lenslets")
    axis = np.array(grid.along) / grid.pitch_px
    middle = np.array([width - 1, height - 1]) / 2 - np.array(grid.origin)
    along = float(middle @ axis)
    across = float(middle @ np.array([-axis[1], axis[0]]))
    first_row = int(np.ceil((across - half_across) / spacing))
    rows = int(np.floor((across + half_across) / spacing)) - first_row + 1
    columns = int(2 * half_along / spacing) + 1
    start = along - (columns - 1) / 2 * spacing, first_row * spacing
    return Sampling(grid, views, (rows, columns), start)


class SquarePixels:
    """Makes views of what lenslets see, by cubic splines along their rows."""

    def __init__(self, sampling: Sampling) -> None:
        position = sampling.positions() - sampling.index()[:, :1, 0]
        whole = np.floor(position).astype(np.intp)
        t = (position - whole).astype(np.float32)
        weights = (
            (1 - t) ** 3 / 6,
            (3 * t**3 - 6 * t**2 + 4) / 6,
            (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6,
            t**3 / 6,
        )
        self._rows = np.arange(len(whole))[:, None]
        self._taps = [(whole + k - _BEFORE, weight[..., None]) for k, weight in enumerate(weights)]

    def view(self, samples: Image) -> Image:
        """A view (H, W, 3) from what the lenslets of `sampling.index()` see, (H, N, 3)."""
        from scipy.ndimage import spline_filter1d

        spline = spline_filter1d(samples, order=3, axis=1, mode="mirror", output=np.float32)
        return np.asarray(sum(weight * spline[self._rows, i] for i, weight in self._taps))
