"""The sign of disparity, from who covers whom.

Reversing both axes of the view grid turns every disparity d into -d and matches the images as
well as before; only occlusion tells the two apart. Where two centre pixels of different disparity
land on one pixel of another view, one of them is hidden there, and it must be the farther one.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from epinet.inspect.sweep import Match, Offset, Star
from epinet.squares import extremes

MIN_GAP_PX = 2.0
"""Two pixels count only if their disparities move them apart by this, in working pixels."""
EDGE_WINDOW = 3
"""A pixel with a jump of disparity in this window is left aside: windows fatten edges."""
NOISE_FLOOR = 0.01
"""Differences of intensity below this are never more than noise."""


@dataclass(frozen=True)
class Votes:
    """Pairs of pixels that compete for a pixel of a view, by which of them is seen."""

    near: int
    """The one of higher disparity: the sign is right."""
    far: int
    """The one of lower disparity: the sign is reversed."""

    @property
    def margin(self) -> float:
        """(near - far) / (near + far), -1..1; 0 without votes."""
        return (self.near - self.far) / max(self.near + self.far, 1)


def occlusion_votes(star: Star, match: Match) -> Votes:
    """Count votes over all views of the star.

    match: of the same star, with occlusions taken into account, in working pixels.
    """
    noise = max(NOISE_FLOOR, 3 * match.typical_cost)
    reliable = match.usable & (match.cost < noise) & ~_jumps(match.disparity, star.radius)
    near = far = 0
    for view, offset in zip(star.views, star.offsets, strict=True):
        pairs = _competitors(match.disparity, reliable, offset)
        intensity = star.centre.flatten()[pairs]
        seen = _sampled(view, match.disparity, offset, pairs)
        fits = (seen - intensity).abs()
        distinct = (intensity[0] - intensity[1]).abs() > 2 * noise
        sees_near, sees_far = (fits < noise) & (fits.flip(0) > 2 * fits.clamp(noise / 2))
        near += int((distinct & sees_near).sum())
        far += int((distinct & sees_far).sum())
    return Votes(near, far)


def _jumps(disparity: Tensor, radius: int) -> Tensor:
    """(H, W) bool: the outermost views move neighbours apart by more than half a pixel."""
    highest, lowest = extremes(disparity[None, None], EDGE_WINDOW)
    return ((highest - lowest) * radius > 0.6)[0, 0]


def _competitors(disparity: Tensor, reliable: Tensor, offset: Offset) -> Tensor:
    """(2, P) flat indices of centre pixels that land on one view pixel: nearest, farthest."""
    height, width = disparity.shape
    y, x = (position.round().long() for position in _positions(disparity, offset))
    landing = reliable & (y >= 0) & (y < height) & (x >= 0) & (x < width)
    source = landing.flatten().nonzero()[:, 0]
    by_disparity = source[disparity.flatten()[source].argsort()]
    target = (y * width + x).flatten()[by_disparity]
    rank = torch.arange(len(target))
    highest = torch.full((height * width,), -1).scatter_reduce(0, target, rank, "amax")
    lowest = torch.full((height * width,), len(target)).scatter_reduce(0, target, rank, "amin")
    contested = highest > lowest
    pairs = by_disparity[torch.stack([highest[contested], lowest[contested]])]
    nearest, farthest = disparity.flatten()[pairs]
    step = max(abs(offset[0]), abs(offset[1]))
    return pairs[:, (nearest - farthest) * step >= MIN_GAP_PX]


def _sampled(view: Tensor, disparity: Tensor, offset: Offset, pixels: Tensor) -> Tensor:
    """Intensity of a view (shape of `pixels`) where it should see these centre pixels."""
    height, width = view.shape
    y, x = (position.flatten()[pixels] for position in _positions(disparity, offset))
    grid = torch.stack([2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1], dim=-1)[None]
    return functional.grid_sample(
        view[None, None], grid, padding_mode="border", align_corners=True
    )[0, 0]


def _positions(disparity: Tensor, offset: Offset) -> tuple[Tensor, Tensor]:
    """(H, W) rows and columns of a view at which it sees each centre pixel."""
    height, width = disparity.shape
    y = torch.arange(height)[:, None] - disparity * offset[0]
    x = torch.arange(width)[None, :] - disparity * offset[1]
    return y, x
