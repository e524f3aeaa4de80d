"""How far the rows of a grid of views stand apart, in units of the columns' distance.

The views of the centre row tell the disparity; those of the centre column show the same point moved
by so many times that, down instead of right. The factor that makes them agree best is looked for,
among those from MIN to MAX.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from epinet.inspect.sweep import Match, Star, fine_match
from epinet.lightfield import LightField

MIN, MAX = 0.3, 3.4
TRIED = 18
"""Factors, apart by equal ratios."""
NARROWED = 3
"""So often the best is looked for again, among finer ones."""
UNTOLD = 0.04
"""Rows spaced within this of the columns count as spaced alike."""
MIN_GAIN = 1.15
"""Rows in their places must leave so many times less than rows spaced like columns."""
MIN_FIT = 1.8
"""And so many times less than any spacing does: none mends rows in a wrong order."""


@dataclass(frozen=True)
class Spacing:
    """Of the rows, in units of the columns' distance."""

    factor: float
    gain: float
    """What rows spaced like columns leave over what rows of this spacing leave."""
    fit: float
    """What the other spacings tried leave, in the median, over what this one leaves."""

    @property
    def is_square(self) -> bool:
        """Whether nothing tells the rows' spacing from the columns'."""
        told = MIN < self.factor < MAX and self.gain >= MIN_GAIN and self.fit >= MIN_FIT
        return not told or abs(self.factor - 1) <= UNTOLD


def row_spacing(spacing: Spacing | None) -> float:
    """Distance of the rows in units of the columns'; 1 where nothing tells another."""
    return 1.0 if spacing is None or spacing.is_square else spacing.factor


@torch.inference_mode()
def estimate_spacing(star: Star) -> Spacing | None:
    """Measure the spacing of a star's rows, be they flipped or not. None where the views of the
    centre row tell no disparity.

    Good to about 2 percent where disparities differ from 0 by more than about a pixel.
    """
    across = _arm(star, axis=1)
    match = fine_match(across)
    if match is None:
        return None
    reach = max(map(abs, match.disparity_percentiles(0.05)))
    down = _arm(star, axis=0).rings(MAX / 2 * reach)
    explained = match.usable & (match.cost <= 2 * match.typical_cost)
    factors, best, left = np.geomspace(0.9 * MIN, 1.1 * MAX, TRIED), 1.0, float("inf")
    chance = 0.0
    for _ in range(1 + NARROWED):
        tried = [_left(down, match, explained, factor) for factor in factors.tolist()]
        chance = chance or float(np.median(tried))
        best, left = float(factors[int(np.argmin(tried))]), min(tried)
        ratio = (factors[1] / factors[0]) ** 0.75
        factors = np.geomspace(best / ratio, best * ratio, 4)
    left = max(left, 1e-9)
    return Spacing(best, _left(down, match, explained, 1) / left, chance / left)


def stretched(lf: LightField, factor: float) -> LightField:
    """The light field with its pictures stretched so that rows are spaced like columns.

    Rows that stand closer make points move less from row to row; in pictures that are so much
    higher they move as much as from column to column. Pictures become wider where rows stand
    farther apart. Truth, masks and objects, which are of the unstretched centre view, go. A factor
    of 1 changes nothing.
    """
    if factor == 1:
        return lf
    height, width = lf.size
    size = (height, round(width * factor)) if factor > 1 else (round(height / factor), width)
    views = np.zeros((*lf.grid, *size, lf.views.shape[-1]), lf.views.dtype)
    for row, col in np.argwhere(lf.present):
        views[row, col] = resized(lf.views[row, col], size)
    camera = lf.camera and replace(lf.camera, width_px=size[1], height_px=size[0])
    return replace(
        lf, views=views, camera=camera, truth=None, masks={}, objects=None, view_truths={}
    )


def resized(image: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """An image (H, W) or (H, W, C) in another size, bicubic; samples keep their type and range."""
    channels = image.reshape(*image.shape[:2], -1)
    tensor = torch.from_numpy(np.moveaxis(channels, 2, 0).astype(np.float32))[None]
    scaled = functional.interpolate(tensor, size, mode="bicubic", antialias=True)[0]
    low, high = float(image.min()), float(image.max())
    result = np.moveaxis(scaled.clamp(low, high).numpy(), 0, 2).reshape(*size, *image.shape[2:])
    return (result if image.dtype.kind == "f" else np.round(result)).astype(image.dtype)


def _arm(star: Star, axis: int) -> Star:
    kept = [i for i, offset in enumerate(star.offsets) if offset[1 - axis] == 0]
    offsets = tuple(star.offsets[i] for i in kept)
    return replace(star, views=star.views[kept], offsets=offsets)


def _left(arm: Star, match: Match, explained: Tensor, factor: float) -> float:
    """Mean difference of an arm's views to the centre view where they show its pixels, their rows
    spaced so, or flipped and so."""
    height, width = arm.centre.shape
    y, x = torch.arange(height)[:, None], torch.arange(width)
    left = []
    for sign in (1, -1) if arm.offsets[0][0] else (1,):
        moves = [(sign * factor * row, float(col)) for row, col in arm.offsets]
        difference = arm.differences(match.disparity, moves)
        shown = torch.stack(
            [
                _within(y - row * match.disparity, height)
                & _within(x - col * match.disparity, width)
                for row, col in moves
            ]
        )
        shown &= explained
        left.append(float((difference * shown).sum() / shown.sum().clamp_min(1)))
    return min(left)


def _within(positions: Tensor, side: int) -> Tensor:
    return (positions >= 0) & (positions <= side - 1)
