"""How much brighter each view is than the centre view, measured and taken back.

Exposures differ from view to view, and a lens darkens its rim, about another centre in each view.
Where texture is faint, that looks like disparity. Both together are a gain of each view that
changes linearly across the picture.

A wrong disparity makes views differ, too: with the slope s = g . p of a pixel, of gradient g, in
the view at offset p, by s times the error. Gains and the errors of a rough match are fitted in
turn, a few times: where the two can hardly be told apart, gains stay small. What the match gets
wholly wrong, or another surface hides, is told from it as an outlier (iterated least squares with
Cauchy's weights, squared).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.inspect.sweep import Match, Star
from epinet.shifts import gradients_of, sampled
from epinet.squares import box_mean

BLUR_PX = 9
"""Means over this square of the centre view are what gains multiply: between their pixels moved
views lose fine texture, which would pass for a loss of brightness."""
ENOUGH_PX = 6000
"""Of more usable pixels some are left out."""
TURNS = 8
"""So often the errors of the match are fitted, and gains after them."""
MOST_GAIN = 0.3
"""Gains are at most this, either way, and of about this deviation where views tell nothing else."""
GRAY_LEVEL = 1 / 255
"""Views that match differ by about this, whatever their noise."""
FAINT = 0.001
"""Gradients (intensity per px) well below this tell nothing of a match's error."""
UNTOLD = 1e-3
"""Gains of this rms are not told from none: so much is measured where there is none."""


@torch.inference_mode()
def estimate_gains(star: Star, match: Match) -> Tensor:
    """The gains of a star's views where a match explains them.

    Args:
        star: its views as they are, not exposed alike.
        match: of the same star.

    Returns:
        (N, 3) of each view, as shares: in the middle of the picture, and how much more at its
        right and at its lower border. Zeros where they are no more than the error of their fit.
    """
    moves = [(float(row), float(col)) for row, col in star.offsets]
    seen = sampled(star.views[None], match.disparity[None, None], moves)
    mean = (seen.sum(1, keepdim=True) + star.centre) / (len(moves) + 1)
    known = match.usable.flatten().nonzero()[:, 0]
    known = known[:: math.ceil(len(known) / ENOUGH_PX)]
    places = torch.tensor(moves)
    down, right = gradients_of(mean)[0].flatten(1)[:, known]
    slopes = places[:, :1] * down + places[:, 1:] * right
    differences = (seen[0] - star.centre).flatten(1)[:, known]
    centre = box_mean(star.centre, BLUR_PX)
    bright = torch.stack([centre, centre * _across(centre), centre * _down(centre)])
    bright = bright.flatten(1)[:, known]
    products = (bright[:, None] * bright).flatten(0, 1).T  # (pixels, 9)
    told = slopes.square().sum(0) + FAINT**2 * places.square().sum() / 2
    gains = differences.new_zeros(len(moves), 3)
    with torch.autocast("cpu", enabled=False):  # of a run that validates: it rounds to a percent
        for turn in range(TURNS):
            errors = (slopes * (differences - gains @ bright)).sum(0) / told
            explained = differences - slopes * errors
            off = (explained - gains @ bright).abs()
            if turn == 0:
                usual = 2 * off.median(-1, keepdim=True).values + GRAY_LEVEL
                prior = (usual[..., None] / MOST_GAIN).square() * torch.eye(3)
            weights = (1 + (off / usual).square()).reciprocal().square()
            normal = (weights @ products).view(-1, 3, 3) + prior
            gains = torch.linalg.solve(normal, (weights * explained) @ bright.T)
    constant, right, lower = gains.square().mean(0)
    mean_square: Tensor = constant + (right + lower) / 3  # over the picture
    return gains * (1 - UNTOLD**2 / mean_square.clamp_min(1e-12)).clamp_min(0)


def even(stacks: Tensor, gains: Tensor) -> None:
    """Divides the views of stacks (4, N, H, W) by their gains, in place.

    Args:
        stacks: of the star that the gains are of.
        gains: (4 * (N - 1), 3), in the order of `epinet.inspect.sweep.star_of_stacks`.
    """
    if not gains.any():
        return
    middle = stacks.shape[1] // 2
    across, down = _across(stacks), _down(stacks)
    others = [view for stack in stacks for k, view in enumerate(stack) if k != middle]
    for view, (constant, right, lower) in zip(others, gains.tolist(), strict=True):
        field = (constant + right * across) + lower * down
        view /= field.clamp_(-MOST_GAIN, MOST_GAIN).add_(1)


def _across(images: Tensor) -> Tensor:
    """(W,) from -1 to 1 to the right, in the middle of each pixel of images (..., H, W)."""
    width = images.shape[-1]
    return (2 * torch.arange(width).to(images) + 1) / width - 1


def _down(images: Tensor) -> Tensor:
    """(H, 1), as `_across`."""
    return _across(images.mT)[:, None]
