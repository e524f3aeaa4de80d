"""The exact weighted median of a map in windows, guided by a picture.

Of pixel p, the value at which the sorted values q of its window first reach half of the window's
weight; a neighbour weighs exp(-|c_p - c_q|^2 / (2 sigma^2)) by the colours c of the picture (Ma et
al., "Constant time weighted median filtering for stereo matching and beyond", ICCV 2013), times
how far it is trusted. Values are sorted as they are, not counted in bins.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

WINDOW_PX = 9
"""Side of the window, unless told otherwise."""

SIGMA = 0.03
"""Distance of two colours of 0..1 at which a neighbour weighs exp(-1/2)."""

LARGEST_WINDOW_PX = 15
"""Of wider ones the weights could not be summed exactly."""

GRAIN = 2.0**-16
"""Weights are multiples of this, so that float32 sums them exactly, in any order."""

NEIGHBOURS_AT_ONCE = 2**22
"""Bounds the memory: some 200 MB."""


class Medians(NamedTuple):
    """Weighted medians, and what they rest on."""

    values: Tensor
    """(H, W), or (P,) at the pixels that were asked for."""
    weights: Tensor
    """The same shape: sums of the weights of the whole windows."""


def weighted_median(
    values: Tensor,
    guide: Tensor,
    trust: Tensor | None = None,
    *,
    pixels: Tensor | None = None,
    window_px: int = WINDOW_PX,
    spacing_px: int = 1,
    sigma: float = SIGMA,
) -> Medians:
    """The weighted median of a map, at all pixels or at some.

    A value that is not finite weighs nothing; where the whole window weighs nothing, the value
    stays as it is.

    Args:
        values: (H, W) float32.
        guide: (H, W, C) in 0..1, the picture that the map belongs to.
        trust: (H, W) in 0..1, how much each value weighs beside its colour; None trusts all.
        pixels: (P,) flat indices of the pixels wanted; None means all.
        window_px: side of the window, odd.
        spacing_px: only every so many-th pixel of a window that is so many times larger.
        sigma: of the weights.

    Example:
        >>> speck = torch.zeros(5, 5)
        >>> speck[2, 2] = 9
        >>> weighted_median(speck, torch.ones(5, 5, 3), window_px=3).values.max()
        tensor(0.)
    """
    if values.shape != guide.shape[:2] or (trust is not None and trust.shape != values.shape):
        raise ValueError(f"map {tuple(values.shape)} and guide {tuple(guide.shape)} do not fit")
    if window_px % 2 == 0 or not 1 <= window_px <= LARGEST_WINDOW_PX:
        raise ValueError(f"the window is odd and at most {LARGEST_WINDOW_PX} px, not {window_px}")
    height, width = values.shape
    reach = window_px // 2 * spacing_px
    weights = values.isfinite().float() if trust is None else trust * values.isfinite()
    values, weights, *channels = (
        _padded(image, reach) for image in (values, weights, *guide.unbind(2))
    )
    index = torch.arange(height * width, device=values.device) if pixels is None else pixels
    row_px = width + 2 * reach
    places = (index // width + reach) * row_px + index % width + reach
    steps = torch.arange(-reach, reach + 1, spacing_px, device=values.device)
    offsets = (steps[:, None] * row_px + steps).flatten()
    chunks = torch.split(places, max(1, NEIGHBOURS_AT_ONCE // len(offsets)))
    parts = [_medians(values, weights, channels, c, offsets, sigma) for c in chunks]
    medians, totals = (torch.cat(p) for p in zip(*parts, strict=True))
    if pixels is None:
        medians, totals = medians.view(height, width), totals.view(height, width)
    return Medians(medians, totals)


def _padded(image: Tensor, reach: int) -> Tensor:
    """Flat (H + 2 reach) * (W + 2 reach), zeros around."""
    return F.pad(image, (reach,) * 4).flatten()


def _medians(
    values: Tensor,
    weights: Tensor,
    channels: list[Tensor],
    places: Tensor,
    offsets: Tensor,
    sigma: float,
) -> tuple[Tensor, Tensor]:
    """(P,) weighted medians around flat places (P,), of flat images, and (P,) whole weights."""
    around = places[:, None] + offsets
    distance = torch.zeros(around.shape, device=values.device)
    for channel in channels:
        distance += (channel[around] - channel[places, None]).square_()
    weight = distance.mul_(-1 / (2 * sigma**2)).exp_().mul_(weights[around])
    weight = weight.div_(GRAIN).round_().mul_(GRAIN)
    ordered, order = values[around].sort(-1)
    reached = weight.gather(1, order).cumsum_(-1)
    total = reached[:, -1:]
    first = (2 * reached < total).sum(-1, keepdim=True)
    median = ordered.gather(1, first)
    return torch.where(total > 0, median, values[places, None])[:, 0], total[:, 0]
