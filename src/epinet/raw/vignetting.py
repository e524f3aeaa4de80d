"""How the light falls off from the middle of a lenslet's image to its rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epinet.raw.bayer import GREEN, Image
from epinet.raw.lenslets import LensletGrid

_BIN_PX = 0.25
_MIDDLE = 0.35
"""Share of the radius over which a lenslet's brightness is taken."""
_MOST_LENSLETS = 40_000


@dataclass(frozen=True)
class Falloff:
    """Mean brightness by distance from a lenslet's centre, 1 in the middle."""

    radius_px: NDArray[np.float64]
    brightness: NDArray[np.float64]

    def at(self, distance_px: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.interp(distance_px, self.radius_px, self.brightness)


def measured_falloff(image: Image, grid: LensletGrid, pattern: NDArray[np.intp]) -> Falloff:
    """Fold all lenslets of a white image, or of a picture, into one.

    A picture's content averages out over many lenslets. Only green pixels count, half of all, so
    that colours do not matter.

    Args:
        image: (H, W) mosaic with black at 0.
        pattern: its colours, as `mosaic` gives them.
    """
    half = int(np.ceil(grid.pitch_px / 2))
    index = grid.within(image.shape, half + 1)
    centres = grid.centres(*index[:: len(index) // _MOST_LENSLETS + 1].T)
    offset = np.arange(-half, half + 1)
    whole = np.round(centres).astype(np.intp)
    rows = whole[:, 1, None, None] + offset[None, :, None]
    cols = whole[:, 0, None, None] + offset[None, None, :]
    patches = image[rows, cols].astype(np.float64)
    green = pattern[rows % 2, cols % 2] == GREEN
    distance = np.hypot(cols - centres[:, 0, None, None], rows - centres[:, 1, None, None])
    middle = green & (distance < _MIDDLE * grid.pitch_px / 2)
    level = (patches * middle).sum(axis=(1, 2)) / middle.sum(axis=(1, 2))
    bins = (distance / _BIN_PX + 0.5).astype(np.intp)[green]
    light = np.bincount(bins, patches[green])
    due = np.bincount(bins, np.broadcast_to(level[:, None, None], green.shape)[green])
    radius = np.arange(len(due)) * _BIN_PX
    within = (radius <= grid.pitch_px / 2) & (due > 0)
    radius, brightness = radius[within], light[within] / due[within]
    middle_level = float(brightness[radius < 1].mean())
    return Falloff(np.asarray(radius, np.float64), np.asarray(brightness / middle_level, float))
