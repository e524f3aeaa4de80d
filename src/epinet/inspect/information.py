"""How well the views of a light field tell a disparity at all."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from epinet.shifts import gradients_of
from epinet.squares import box_mean

WINDOW_PX = 25
"""A disparity is taken to be the same over this square, unless told otherwise."""


def disparity_deviation(
    centre: Tensor,
    noise: Tensor,
    offsets: Sequence[tuple[int, int]],
    other: Tensor | float = 0.0,
    window_px: int = WINDOW_PX,
    halves: tuple[Tensor, Tensor] | None = None,
) -> Tensor:
    """Standard deviation of the best estimate of each disparity: its Cramer-Rao bound.

    A view at offset (r, c) differs by -e (r dI/dy + c dI/dx) under a disparity that is off by e;
    so much information the squares of these bear against the noise, summed over all views and a
    window. The noise of the centre view cancels where views stand on both sides of it.

    Args:
        centre: (B, 1, H, W) centre view, with its noise.
        noise: (B, 1, H, W) standard deviation of the noise of every view, in the same units.
        offsets: (row, column) of the views from the centre view.
        other: standard deviation of what else makes views differ, which the centre view does not
            show as noise.
        window_px: side of the square over which a disparity is taken to be the same.
        halves: (B, 1, H, W) means of two halves of the other views, moved onto the centre view.
            Texture then counts only as far as both show it: noise differs from view to view, and
            where samples are clipped its deviation alone does not tell it from texture.

    Returns:
        (B, 1, H, W) px per adjacent view; infinite where there is no texture. The window's half
        from the border on it leans on repeated samples.
    """
    rows, cols = (sum(o[axis] ** 2 for o in offsets) for axis in (0, 1))
    down, across = gradients_of(centre).chunk(2, 1)
    variance = noise * noise
    # Noise itself has differences: half its variance in each direction.
    texture = cols * across**2 + rows * down**2 - 0.5 * (rows + cols) * variance
    told, against = (box_mean(t, window_px) for t in (texture, variance + other * other))
    if halves is not None:
        down, across = (gradients_of(halves[0]) * gradients_of(halves[1])).chunk(2, 1)
        told = torch.minimum(told, box_mean(cols * across + rows * down, window_px))
    return (window_px**2 * told.clamp_min(0) / against).rsqrt()
