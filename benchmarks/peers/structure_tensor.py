"""Disparity from the orientation of lines in epipolar images (EPIs).

After Wanner and Goldluecke, "Globally consistent depth labeling of 4D light fields", CVPR 2012, and
"Variational light field analysis for disparity estimation and super-resolution", PAMI 2014: the
structure tensor of every horizontal and vertical EPI through the centre view gives a slope and a
coherence, EPIs are sheared for slopes beyond what one pixel per view can show, the most coherent
slope wins, and total variation smooths the map where it is not coherent.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.total_variation import smoothed
from epinet.lightfield import LightField

Array = NDArray[np.float32]

OUTER_SCALE = 1.3
"""Of the Gaussian that averages the tensor over the EPI; the value of the authors' code."""
LARGEST_SLOPE = 0.6
"""A sheared EPI is believed up to this slope, in px per view; the next shear sees beyond."""
LEAST_COHERENCE = 0.5
"""Less coherent slopes do not count. These two were chosen among few values on rendered scenes."""
DIFFERENCE = np.array([-0.5, 0, 0.5], np.float32)
SMOOTHING = np.array([3, 10, 3], np.float32) / 16
"""Scharr's filters, whose gradients turn with the lines."""


def estimate(lf: LightField, range_px: tuple[float, float]) -> Array:
    """Disparity (H, W) of the centre view, from its row and its column of views."""
    disparity, coherence = slopes(lf, range_px)
    trusted = np.where(coherence >= LEAST_COHERENCE, coherence, 0)
    return smoothed(disparity, trusted, lf.gray(*lf.centre))


def slopes(lf: LightField, range_px: tuple[float, float]) -> tuple[Array, Array]:
    """Disparity and coherence (H, W) before smoothing: the most coherent of all EPIs'."""
    row, col = lf.centre
    across = np.stack([lf.rgb(row, c) for c in range(lf.grid[1])])
    down = np.stack([lf.rgb(r, col).swapaxes(0, 1) for r in range(lf.grid[0])])
    disparity = np.full(lf.size, np.mean(range_px), np.float32)
    coherence = np.zeros(lf.size, np.float32)
    for shear in range(math.floor(range_px[0]), math.ceil(range_px[1]) + 1):
        horizontal = _slope(across, col, shear)
        vertical = [found.T for found in _slope(down, row, shear)]
        for found, sureness in (horizontal, vertical):
            inside = (found >= range_px[0]) & (found <= range_px[1])
            better = inside & (sureness > coherence)
            disparity[better], coherence[better] = found[better], sureness[better]
    return disparity, coherence


def _slope(views: Array, centre: int, shear: int) -> tuple[Array, Array]:
    """Disparity and coherence (H, W) from the EPIs (N, W) of every row of views (N, H, W, C).

    Sheared so that a disparity of `shear` px stands upright.
    """
    tensor = _structure_tensor(_sheared(views, centre, shear), centre)
    xx, xs, ss = cv2.split(cv2.GaussianBlur(tensor, (0, 1), OUTER_SCALE, sigmaY=1))
    # Along a line I(x - d s) is constant, so the gradient points to (1, d).
    slope = np.tan(0.5 * np.arctan2(2 * xs, xx - ss))
    coherence = np.sqrt((xx - ss) ** 2 + 4 * xs**2) / (xx + ss + 1e-9)
    coherence[np.abs(slope) > LARGEST_SLOPE] = 0
    return slope + np.float32(shear), coherence


def _sheared(views: Array, centre: int, shear: int) -> Array:
    """Views (N, H, W, C) moved by whole pixels."""
    x = np.arange(views.shape[2])
    moved = [
        view[:, np.clip(x - shear * (s - centre), 0, len(x) - 1)] for s, view in enumerate(views)
    ]
    return np.stack(moved)


def _structure_tensor(views: Array, centre: int) -> Array:
    """(H, W, 3): xx, xs and ss at the centre view, averaged over the views and summed over C."""
    distances = np.arange(1, len(views) - 1) - centre
    weights = np.exp(-0.5 * (distances / OUTER_SCALE) ** 2).astype(np.float32)
    tensor = np.zeros((*views.shape[1:3], 3), np.float32)
    for s, weight in zip(range(1, len(views) - 1), weights / weights.sum(), strict=True):
        before, at, after = views[s - 1 : s + 2]
        across_views = SMOOTHING[0] * (before + after) + SMOOTHING[1] * at
        dx = cv2.filter2D(across_views, -1, DIFFERENCE[None])
        ds = cv2.filter2D(0.5 * (after - before), -1, SMOOTHING[None])
        for k, product in enumerate((dx * dx, dx * ds, ds * ds)):
            tensor[..., k] += weight * product.sum(axis=-1)
    return tensor
