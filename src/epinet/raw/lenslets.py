"""The hexagonal grid of the lenslets' centres, found in a white image or in the picture itself.

Peaks of the Fourier transform give a start (pitch, rotation, offset). Then the image is cut into
blocks of some 70 lenslets, the phases at the grid's frequencies tell how far a block's lenslets
are off the grid, and the grid is fitted to that by least squares: from the middle of the sensor
outwards, so that a small error of the start never adds up to a whole lenslet. Blocks, as what the
picture shows inside of a single lenslet shifts its centre of light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, uniform_filter

from epinet.errors import InputError
from epinet.raw.bayer import Image

Floats = NDArray[np.float64]

_CROP_PX = 1024
_MOST_CROPS = 12
_PITCH_TOLERANCE = 0.01
_PEAK_BINS = 1.5
"""How far from the nominal the spectrum's peak is sought: as share of its frequency, and beyond
that in bins. Textures make peaks of their own beside it."""
_PEAK_ABOVE = 6.0
"""How many times the spectrum's median around it a peak is to be."""
_BLOCK_PITCHES = 9
_MOST_BLOCKS = 40
"""Per row and column of blocks; they overlap by half where that is enough."""
_ROUNDS, _LAST_ROUNDS = 2, 4
_OUTLIER = 3.0
_FEWEST_BLOCKS = 4
_MOST_CHANGE = 0.1
"""Of pitch and direction by one fit, in pitches."""
_SCATTER_PITCHES = 0.15
"""Offsets that scatter more than this are not those of a grid."""


@dataclass(frozen=True)
class LensletGrid:
    """Centres of lenslets: origin + i * along + j * down for all whole i, j; (x, y) in pixels.

    `along` runs along a row of lenslets; `down` leads to the next row, half a pitch further on.
    """

    origin: tuple[float, float]
    along: tuple[float, float]
    down: tuple[float, float]
    scatter_px: float = 0.0
    """Typical (median) distance from the grid of where blocks of lenslets were found."""

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

    def centres(self, i: NDArray[Any], j: NDArray[Any]) -> Floats:
        """(..., 2) points (x, y) of lenslets, or between them."""
        i, j = np.asarray(i, float)[..., None], np.asarray(j, float)[..., None]
        points = np.array(self.origin) + i * np.array(self.along) + j * np.array(self.down)
        return np.asarray(points)

    def indices(self, points: Floats) -> Floats:
        """(..., 2) coordinates (i, j) of points (x, y); whole at the centres."""
        basis = np.stack([self.along, self.down], axis=1)
        return np.asarray((points - np.array(self.origin)) @ np.linalg.inv(basis).T)

    def within(self, size: tuple[int, ...], margin_px: float) -> NDArray[np.intp]:
        """(N, 2) lenslets (i, j) in an image (height, width), by rows.

        Args:
            margin_px: least distance of their centres from its edges.
        """
        low = np.array([margin_px, margin_px])
        high = np.array([size[1], size[0]]) - 1 - margin_px
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
    try:
        return _fit(_evened(image, pitch_px), pitch_px, where)
    except (np.linalg.LinAlgError, FloatingPointError) as error:  # singular, or not finite
        raise _no_grid(where, pitch_px) from error


def _fit(even: Image, pitch_px: float, where: str) -> LensletGrid:
    grid = _start(even, pitch_px, where)
    last = max(even.shape)
    reach = min(_CROP_PX / 2, last)
    while reach < last:
        for _ in range(_ROUNDS):
            grid = _refined(even, grid, reach, where)
        reach = min(2 * reach, last)
    for _ in range(_LAST_ROUNDS):
        grid = _refined(even, grid, last, where)
    if grid.scatter_px > _SCATTER_PITCHES * grid.pitch_px:
        raise _no_grid(where, pitch_px)
    return grid


def _evened(image: Image, pitch_px: float) -> Image:
    """Lenslets without what they show, as far as may be: brightness evened out, and cut off.

    The mosaic's colours are averaged away first, which does not shift the image.
    """
    even = np.asarray(image, np.float32)
    for axis in (0, 1):
        even = correlate1d(even, np.array([0.25, 0.5, 0.25]), axis, mode="mirror")
    brightness = uniform_filter(even, 2 * round(pitch_px) + 1, mode="mirror")
    even /= np.maximum(brightness, np.float32(1e-3))
    return np.clip(even, 0, 1, out=even)


def _start(image: Image, pitch_px: float, where: str) -> LensletGrid:
    """From two of the peaks of the spectrum that a hexagonal grid with horizontal rows has."""
    height, width = image.shape
    side = min(_CROP_PX, height, width)
    if side < 2 * _BLOCK_PITCHES * pitch_px:
        raise InputError(f"{where}: {width}x{height} px hold too few lenslets")
    power = _mean_power(image, side)
    radius = 2 / (np.sqrt(3) * pitch_px)
    frequencies = []
    for angle in (-np.pi / 6, np.pi / 2):
        near = radius * np.array([np.cos(angle), np.sin(angle)])
        peak = _peak(power, near, _PITCH_TOLERANCE * radius + _PEAK_BINS / side)
        if peak is None:
            raise _no_grid(where, pitch_px)
        frequencies.append(peak)
    along, down = np.linalg.inv(np.array(frequencies)).T
    middle = np.array([width / 2, height / 2])
    grid = LensletGrid(_pair(middle), _pair(along), _pair(down))
    offset, _ = _block_offset(image, grid, middle, side)
    return LensletGrid(_pair(middle + offset), grid.along, grid.down)


def _mean_power(image: Image, side: int) -> Floats:
    """Power spectrum, the mean over crops: the grid is in all of them, textures differ."""
    height, width = image.shape
    window = np.outer(np.hanning(side), np.hanning(side)).astype(np.float32)
    corners = [
        (top, left)
        for top in np.linspace(0, height - side, -(-height // side)).astype(int)
        for left in np.linspace(0, width - side, -(-width // side)).astype(int)
    ]
    corners = corners[:: -(-len(corners) // _MOST_CROPS)]
    total = np.zeros((side, side))
    for top, left in corners:
        crop = image[top : top + side, left : left + side]
        total += np.abs(np.fft.fft2((crop - crop.mean()) * window)) ** 2
    return total / len(corners)


def _peak(power: Floats, near: Floats, tolerance: float) -> Floats | None:
    """Frequency (x, y) of the strongest peak near one, to a part of a bin; None if none stands out.

    It is to stand out of the spectrum within 30 % of its frequency around.
    """
    side = power.shape[0]
    axis = np.fft.fftfreq(side)
    distance = np.hypot(axis[None, :] - near[0], axis[:, None] - near[1])
    row, col = np.unravel_index(np.argmax(np.where(distance > tolerance, 0, power)), power.shape)
    around = np.median(power[distance < 0.3 * np.hypot(*near)])
    if power[row, col] <= _PEAK_ABOVE**2 * around:
        return None
    three = np.arange(-1, 2)
    offset = []
    for line in (power[row, (col + three) % side], power[(row + three) % side, col]):
        before, top, after = np.log(line + 1e-12)
        curvature = before - 2 * top + after
        offset.append(0.0 if curvature >= 0 else float((before - after) / (2 * curvature)))
    return np.array([axis[col] + offset[0] / side, axis[row] + offset[1] / side])


def _refined(image: Image, grid: LensletGrid, reach: float, where: str) -> LensletGrid:
    """Least squares over the offsets of the blocks within reach of the image's middle."""
    height, width = image.shape
    side = round(_BLOCK_PITCHES * grid.pitch_px)
    middle = np.array([width / 2, height / 2])
    half = np.minimum(middle - side / 2, reach)
    counts = np.round(4 * half / side).astype(int).clip(1, _MOST_BLOCKS - 1) + 1
    x, y = (np.linspace(m - h, m + h, n) for m, h, n in zip(middle, half, counts, strict=True))
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    found = [_block_offset(image, grid, centre, side) for centre in centres]
    offset, weight = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    if len(centres) < _FEWEST_BLOCKS or not weight.any():
        raise _no_grid(where, grid.pitch_px)
    design = np.column_stack([np.ones(len(centres)), grid.indices(centres)])
    for _ in range(3):
        scaled = np.sqrt(weight)[:, None]
        change = np.linalg.lstsq(design * scaled, offset * scaled, rcond=None)[0]
        distance = np.hypot(*(offset - design @ change).T)
        scatter = float(np.median(distance[weight > 0]))
        weight = np.where(distance > _OUTLIER * scatter + 1e-3, 0, weight)
    moved = np.array([grid.origin, grid.along, grid.down]) + change
    origin, along, down = (_pair(v) for v in moved)
    refined = LensletGrid(origin, along, down, scatter)
    if not _alike(refined, grid):
        raise _no_grid(where, grid.pitch_px)
    return refined


def _alike(refined: LensletGrid, start: LensletGrid) -> bool:
    """Whether a fit stayed near its start; a singular one may be anywhere, or not finite."""
    moved = np.array([refined.along, refined.down]) - np.array([start.along, start.down])
    return bool(np.abs(moved).max() < _MOST_CHANGE * start.pitch_px)  # false of NaN


def _block_offset(
    image: Image, grid: LensletGrid, centre: Floats, side: int
) -> tuple[Floats, float]:
    """How far (x, y) the lenslets of a square block lie from the grid, and how clear that is.

    A shift e turns the phase at each of the grid's three shortest frequencies f by -2 pi f e.
    """
    left, top = np.round(centre - side / 2).astype(int).clip(0)
    block = image[top : top + side, left : left + side]
    rows, cols = block.shape
    first, second = np.linalg.inv(np.array([grid.along, grid.down]).T)
    frequencies = np.array([first, second, first + second])
    x, y = left + np.arange(cols) - grid.origin[0], top + np.arange(rows) - grid.origin[1]
    waves_x = np.exp(-2j * np.pi * np.outer(x, frequencies[:, 0])) * np.hanning(cols)[:, None]
    waves_y = np.exp(-2j * np.pi * np.outer(y, frequencies[:, 1])) * np.hanning(rows)[:, None]
    seen = np.sum(waves_y * ((block - block.mean()) @ waves_x), axis=0)
    turns = -np.angle(seen) / (2 * np.pi)
    turns[2] = turns[0] + turns[1] + (turns[2] - turns[0] - turns[1] + 0.5) % 1 - 0.5
    scaled = np.abs(seen)[:, None]
    offset = np.linalg.lstsq(frequencies * scaled, turns * scaled[:, 0], rcond=None)[0]
    return offset, float(np.abs(seen).sum())


def _pair(values: Floats) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _no_grid(where: str, pitch_px: float) -> InputError:
    return InputError(
        f"{where}: no grid of lenslets about {pitch_px:.1f} px apart is to be seen; the picture "
        "may be black, or its metadata those of another camera. White images help (--white)"
    )
