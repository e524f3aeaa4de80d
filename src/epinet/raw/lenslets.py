"""The hexagonal grid of the lenslets' centres, found in a white image or in the picture itself.

A peak of the Fourier transform gives a start (pitch, rotation, offset); then the grid is fitted
to the lenslets' centres by least squares, from the middle of the sensor outwards, so that a small
error of the start never adds up to a whole lenslet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.raw.bayer import Image

Floats = NDArray[np.float64]

_CROP_PX = 1024
_PITCH_TOLERANCE = 0.02
_PEAK_BINS = 1.5
"""How far from the nominal the spectrum's peak is sought: as share of its frequency, and beyond
that in bins. Textures make peaks of their own beside it."""
_PEAK_ABOVE = 10.0
"""How many times the spectrum's median around it a peak is to be; noise reaches about 4."""
_MOST_CENTRES = 10_000
_ROUNDS, _LAST_ROUNDS = 2, 4
_OUTLIER = 3.0
_FEWEST_LENSLETS = 30
_FLAT_ABOVE = 0.6
"""Light above this share of a lenslet's mean counts no more: what the picture shows inside a
lenslet is not to move its centre, only its rim is."""
_SPREAD_PITCHES = 0.12
"""Centres that scatter more than this are no grid of lenslets."""


@dataclass(frozen=True)
class LensletGrid:
    """Centres of lenslets: origin + i * along + j * down for all whole i, j; (x, y) in pixels.

    `along` runs along a row of lenslets; `down` leads to the next row, half a pitch further on.
    """

    origin: tuple[float, float]
    along: tuple[float, float]
    down: tuple[float, float]
    scatter_px: float = 0.0
    """Root mean square distance of the measured centres from the grid."""

    @property
    def pitch_px(self) -> float:
        """Distance of lenslets in a row."""
        return float(np.hypot(*self.along))

    @property
    def rotation(self) -> float:
        """Of the rows, in radians from the x axis towards the y axis."""
        return float(np.arctan2(self.along[1], self.along[0]))

    @property
    def row_height_px(self) -> float:
        """Distance of rows, perpendicular to them."""
        (ax, ay), (bx, by) = self.along, self.down
        return (ax * by - ay * bx) / self.pitch_px

    @property
    def row_shift_px(self) -> float:
        """How far each row begins further along than the one above it."""
        (ax, ay), (bx, by) = self.along, self.down
        return (ax * bx + ay * by) / self.pitch_px

    def centres(self, i: NDArray[Any], j: NDArray[Any]) -> Floats:
        """(..., 2) points (x, y) of lenslets, or between them."""
        i, j = np.asarray(i, float)[..., None], np.asarray(j, float)[..., None]
        points = np.array(self.origin) + i * np.array(self.along) + j * np.array(self.down)
        return np.asarray(points)

    def indices(self, points: Floats) -> Floats:
        """(..., 2) coordinates (i, j) of points (x, y); whole at the centres."""
        basis = np.stack([self.along, self.down], axis=1)
        return np.asarray((points - np.array(self.origin)) @ np.linalg.inv(basis).T)

    def within(
        self, size: tuple[int, ...], margin_px: float, reach_px: float = np.inf
    ) -> NDArray[np.intp]:
        """(N, 2) lenslets (i, j) in an image (height, width), by rows.

        Args:
            margin_px: least distance of their centres from its edges.
            reach_px: largest distance from its middle, across and down.
        """
        extent = np.array([size[1], size[0]])
        low = np.maximum(margin_px, extent / 2 - reach_px)
        high = np.minimum(extent - 1 - margin_px, extent / 2 + reach_px)
        corners = np.array([low, high, (low[0], high[1]), (high[0], low[1])])
        spans = self.indices(corners)
        (i0, j0), (i1, j1) = np.floor(spans.min(axis=0)), np.ceil(spans.max(axis=0))
        j, i = np.meshgrid(np.arange(j0, j1 + 1), np.arange(i0, i1 + 1), indexing="ij")
        points = self.centres(i, j)
        inside = np.all((points >= low) & (points <= high), axis=-1)
        return np.stack([i[inside], j[inside]], axis=-1).astype(np.intp)


def fit_grid(image: Image, pitch_px: float, where: str) -> LensletGrid:
    """Find the grid in a raw image, its colours made about equally bright.

    Args:
        image: (H, W) pixels, of a white image or a picture.
        pitch_px: nominal distance of the lenslets.
        where: what messages call the image.

    Raises:
        InputError: there is no such grid in it.
    """
    smooth = _smoothed(image)
    grid = _start(smooth, pitch_px, where)
    height, width = image.shape
    reach = min(_CROP_PX, height, width) / 2 * 0.8
    last = max(height, width)
    while reach < last:
        for _ in range(_ROUNDS):
            grid = _refined(smooth, grid, reach, where)
        reach = min(2 * reach, last)
    for _ in range(_LAST_ROUNDS):
        grid = _refined(smooth, grid, last, where)
    if grid.scatter_px > _SPREAD_PITCHES * grid.pitch_px:
        raise _no_grid(where, pitch_px)
    return grid


def _smoothed(image: Image) -> Image:
    """The mosaic's colours averaged away, without shifting the image."""
    import cv2

    kernel = np.array([0.25, 0.5, 0.25], np.float32)
    return np.asarray(cv2.sepFilter2D(image, -1, kernel, kernel), np.float32)


def _start(image: Image, pitch_px: float, where: str) -> LensletGrid:
    """From the two peaks of the spectrum that a hexagonal grid with horizontal rows has."""
    height, width = image.shape
    side = min(_CROP_PX, height, width)
    if side < 8 * pitch_px:
        raise InputError(f"{where}: {width}x{height} px hold too few lenslets")
    top, left = (height - side) // 2, (width - side) // 2
    crop = _gaps(image[top : top + side, left : left + side], pitch_px)
    crop = (crop - crop.mean()) * np.outer(np.hanning(side), np.hanning(side))
    radius = 2 / (np.sqrt(3) * pitch_px)
    spectrum = np.fft.fft2(crop)
    frequencies = []
    for angle in (-np.pi / 6, np.pi / 2):
        near = radius * np.array([np.cos(angle), np.sin(angle)])
        peak = _peak(spectrum, near, _PITCH_TOLERANCE * radius + _PEAK_BINS / side)
        if peak is None:
            raise _no_grid(where, pitch_px)
        frequencies.append(peak)
    along, down = np.linalg.inv(np.array(frequencies)).T
    y, x = np.mgrid[:side, :side]
    phases = [
        np.angle(np.sum(crop * np.exp(-2j * np.pi * (x * fx + y * fy)))) for fx, fy in frequencies
    ]
    origin = np.array([left, top]) - (phases[0] * along + phases[1] * down) / (2 * np.pi)
    grid = LensletGrid(_pair(origin), _pair(along), _pair(down))
    i, j = np.round(grid.indices(np.array([width / 2, height / 2])))
    return LensletGrid(_pair(grid.centres(i, j)), grid.along, grid.down)


def _gaps(image: Image, pitch_px: float) -> Floats:
    """The dark gaps between lenslets; what is brighter is cut off, as it is the picture's."""
    import cv2

    side = 2 * round(pitch_px) + 1
    mean = cv2.blur(image, (side, side))
    level = np.maximum(_FLAT_ABOVE * mean, 1e-3)
    return np.asarray(np.clip(image / level, 0, 1), np.float64)


def _peak(spectrum: NDArray[np.complex128], near: Floats, tolerance: float) -> Floats | None:
    """Frequency (x, y) of the strongest peak near one, to a part of a bin; None if none stands out.

    It is to stand out of the spectrum within 30 % of its frequency around.
    """
    side = spectrum.shape[0]
    axis = np.fft.fftfreq(side)
    power = np.abs(spectrum)
    distance = np.hypot(axis[None, :] - near[0], axis[:, None] - near[1])
    row, col = np.unravel_index(np.argmax(np.where(distance > tolerance, 0, power)), power.shape)
    around = np.median(power[distance < 0.3 * np.hypot(*near)])
    if power[row, col] <= _PEAK_ABOVE * around:
        return None
    offset = []
    for line in (
        power[row, (col + np.arange(-1, 2)) % side],
        power[(row + np.arange(-1, 2)) % side, col],
    ):
        before, top, after = np.log(line + 1e-12)
        curvature = before - 2 * top + after
        offset.append(0.0 if curvature >= 0 else float((before - after) / (2 * curvature)))
    return np.array([axis[col] + offset[0] / side, axis[row] + offset[1] / side])


def _refined(image: Image, grid: LensletGrid, reach: float, where: str) -> LensletGrid:
    """Least squares over the centres of up to _MOST_CENTRES lenslets within reach of the middle."""
    height, width = image.shape
    half = int(np.ceil(grid.pitch_px / 2))
    index = grid.within(image.shape, half + 1, reach)
    if len(index) < _FEWEST_LENSLETS:
        raise InputError(f"{where}: {width}x{height} px hold too few lenslets")
    i, j = index[:: len(index) // _MOST_CENTRES + 1].T
    measured, weight = _measured_centres(image, grid.centres(i, j), half, grid.pitch_px)
    design = np.stack([np.ones(len(i)), i, j], axis=1)
    for _ in range(3):
        scaled = np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(design * scaled, measured * scaled, rcond=None)[0]
        distance = np.hypot(*(measured - design @ solution).T)
        spread = np.median(distance[weight > 0]) + 1e-3
        weight = np.where(distance > _OUTLIER * spread, 0, weight)
    used = weight > 0
    scatter = float(np.sqrt(np.mean(distance[used] ** 2)))
    origin, along, down = (_pair(v) for v in solution)
    return LensletGrid(origin, along, down, scatter)


def _measured_centres(
    image: Image, expected: Floats, half: int, pitch_px: float
) -> tuple[Floats, Floats]:
    """Centroids (N, 2) of the light above the gaps' level around expected centres, and weights."""
    whole = np.round(expected).astype(np.intp)
    offset = np.arange(-half, half + 1)
    rows = whole[:, 1, None, None] + offset[None, :, None]
    cols = whole[:, 0, None, None] + offset[None, None, :]
    patches = image[rows, cols].astype(np.float64)
    dx = cols - expected[:, 0, None, None]
    dy = rows - expected[:, 1, None, None]
    window = np.clip((pitch_px / 2 - np.hypot(dx, dy)) + 0.5, 0, 1)
    floor = np.min(np.where(window > 0, patches, np.inf), axis=(1, 2), keepdims=True)
    light = (patches - floor) * window
    level = light.sum(axis=(1, 2)) / window.sum(axis=(1, 2))
    flat = np.minimum(light, _FLAT_ABOVE * level[:, None, None])
    total = np.maximum(flat.sum(axis=(1, 2)), 1e-9)
    shift = np.stack([(flat * dx).sum(axis=(1, 2)), (flat * dy).sum(axis=(1, 2))], axis=1)
    bright = level > 0.1 * np.percentile(level, 90)
    return expected + shift / total[:, None], bright.astype(float)


def _pair(values: Floats) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _no_grid(where: str, pitch_px: float) -> InputError:
    return InputError(
        f"{where}: no grid of lenslets about {pitch_px:.1f} px apart is to be seen; the picture "
        "may be black, or its metadata those of another camera. White images help (--white)"
    )
