"""Where no light falls: black corners that all views of a plenoptic camera have in common.

A scene's dark parts move from view to view as its disparity says; what the main lens or the
rectification of the lenslets leaves black stays in place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from epinet.angular import star_positions
from epinet.lightfield import LightField

BLACK = 0.02
"""Samples below this share of the brightest ones of their view hold no light."""
BRIGHTEST_PERCENTILE = 99
LARGEST_SHARE = 0.1
"""Of the picture that one corner takes; larger areas are a dark scene."""


def black_corners(lf: LightField) -> NDArray[np.bool_]:
    """(H, W) pixels that are black in every view of the star, as far as they reach a corner.

    Nothing is masked unless all four corners of the picture are black: a camera darkens all of
    them, a dark object in a corner is the scene's.
    """
    black = np.ones(lf.size, bool)
    for row, col in star_positions(lf.grid[0]):
        if lf.present[row, col]:
            samples = lf.unit(row, col).max(axis=2)
            black &= samples < BLACK * np.percentile(samples, BRIGHTEST_PERCENTILE)
    numbers, _ = label(black)
    corners = numbers[[0, 0, -1, -1], [0, -1, 0, -1]]
    sizes = np.bincount(numbers.ravel())[corners]
    if (corners == 0).any() or sizes.max() > LARGEST_SHARE * numbers.size:
        return np.zeros(lf.size, bool)
    return np.isin(numbers, corners)
