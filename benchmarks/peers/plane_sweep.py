"""A plane sweep whose cost volume is filtered along the edges of the picture.

Costs and filter as in Hosni, Rhemann, Bleyer, Rother and Gelautz, "Fast cost-volume filtering for
visual correspondence and beyond" (CVPR 2011, PAMI 2013), with their parameters, averaged over all
views of the star; the least cost wins, and a parabola through it and its neighbours refines it.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from epinet.angular import star_positions
from epinet.lightfield import LightField

Array = NDArray[Any]
"""Of float32."""

SPACING_PX = 0.1
"""Between hypotheses: .4 px in the outermost views of nine."""
COLOUR_SHARE = 0.1
COLOUR_LIMIT = 7 / 255
GRADIENT_LIMIT = 2 / 255
"""Differences count no more beyond their limit: where the pixel is hidden they say nothing."""
RADIUS_PX = 9
EPSILON = 1e-4
"""Of the guided filter: a variance, of gray levels in 0..1."""


def estimate(lf: LightField, range_px: tuple[float, float]) -> Array:
    """Disparity (H, W) of the centre view from the views of the star."""
    low, high = range_px
    count = max(3, 1 + math.ceil((high - low) / SPACING_PX))
    hypotheses = np.linspace(low, high, count)
    sweep, guided = Sweep(lf), GuidedFilter(lf.rgb(*lf.centre))
    costs = np.stack([guided(sweep.cost(d)) for d in hypotheses])
    best = np.clip(costs.argmin(axis=0), 1, count - 2)
    before, at, after = (np.take_along_axis(costs, (best + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = np.maximum(before - 2 * at + after, 1e-9)
    offset = np.clip(0.5 * (before - after) / bend, -1, 1)
    disparity: Array = np.interp(best + offset, np.arange(count), hypotheses).astype(np.float32)
    return disparity


class Sweep:
    """Matching costs of the views of the star with the centre view."""

    def __init__(self, lf: LightField) -> None:
        row, col = lf.centre
        self.centre = _features(lf, row, col)
        self.others = [
            (r - row, c - col, _features(lf, r, c))
            for r, c in star_positions(lf.grid[0])
            if (r, c) != lf.centre
        ]

    def cost(self, disparity_px: float) -> Array:
        """(H, W): the mean over the views of truncated differences of colour and gradient."""
        total = np.zeros(self.centre[0].shape[:2], np.float32)
        for rows, cols, images in self.others:
            moved = [_moved(image, -disparity_px * cols, -disparity_px * rows) for image in images]
            colour, gradient = (
                _summed(cv2.absdiff(a, b)) / a.shape[2]
                for a, b in zip(moved, self.centre, strict=True)
            )
            total += COLOUR_SHARE * np.minimum(colour, COLOUR_LIMIT)
            total += (1 - COLOUR_SHARE) * np.minimum(gradient, GRADIENT_LIMIT)
        return total / len(self.others)


def _features(lf: LightField, row: int, col: int) -> tuple[Array, Array]:
    """RGB (H, W, 3) and the gradient of gray (H, W, 2) of a view."""
    gray = lf.gray(row, col)
    gradient = [0.5 * cv2.filter2D(gray, -1, np.array(k)) for k in ([[-1, 0, 1]], [[-1], [0], [1]])]
    return lf.rgb(row, col), np.stack(gradient, axis=-1)


def _moved(image: Array, dx: float, dy: float) -> Array:
    """The image (H, W, C) read at (x + dx, y + dy), cubic; its edge goes on beyond it."""
    there = np.array([[1, 0, dx], [0, 1, dy]], np.float64)
    moved: Array = cv2.warpAffine(
        image,
        there,
        image.shape[1::-1],
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return moved


class GuidedFilter:
    """He, Sun and Tang's filter (ECCV 2010), guided by a colour picture (H, W, 3) in 0..1."""

    def __init__(self, guide: Array) -> None:
        self.guide = guide
        self.mean = _box(guide)
        products = guide[..., :, None] * guide[..., None, :]
        covariance = _box(products.reshape(*guide.shape[:2], 9)).reshape(products.shape)
        covariance -= self.mean[..., :, None] * self.mean[..., None, :]
        self.inverse = np.linalg.inv(covariance + EPSILON * np.eye(3, dtype=np.float32))

    def __call__(self, image: Array) -> Array:
        """The image (H, W), locally a linear function of the guide."""
        mean = _box(image)
        covariance = _box(self.guide * image[..., None]) - self.mean * mean[..., None]
        slope = (self.inverse @ covariance[..., None])[..., 0]
        offset = mean - _summed(slope * self.mean)
        return _summed(_box(slope) * self.guide) + _box(offset)


def _box(image: Array) -> Array:
    side = 2 * RADIUS_PX + 1
    box: Array = cv2.blur(image, (side, side), borderType=cv2.BORDER_REFLECT)
    return box


def _summed(image: Array) -> Array:
    """(H, W): the sum over the channels of (H, W, C)."""
    summed: Array = cv2.transform(image, np.ones((1, image.shape[2])))
    return summed
