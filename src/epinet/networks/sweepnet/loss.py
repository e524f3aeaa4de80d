"""What training of SweepNet minimises."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.networks.robust import robust, weighted_mean
from epinet.networks.sweepnet.estimates import Estimates

CLASSES, ERROR = 0.2, 0.02
"""Weights of the sweep's classification and of the expected error, beside the maps' errors."""
EARLIER = 0.5
"""Weight of each map before the last."""
MARGIN_PX = 11
"""Views extend so far beyond their truth on each side."""


def sweepnet_loss(
    estimates: Estimates, disparity: Tensor, weight: Tensor, scale_px: float | None
) -> Tensor:
    """Errors of all maps, of the sweep's classes and of the expected error.

    Args:
        estimates: of views.
        disparity: (B, 1, P, P) the truth of their inner part, MARGIN_PX from their edges.
        weight: (B, 1, P, P) of its pixels.
        scale_px: of the robust loss.
    """
    loss = CLASSES * class_loss(estimates, disparity, weight)
    for k, map_ in enumerate(estimates.maps):
        error = (_inner(map_) - disparity).abs()
        share = 1.0 if k == len(estimates.maps) - 1 else EARLIER
        loss = loss + share * weighted_mean(robust(error, scale_px), weight)
    # Laplace's distribution about the last map, which this term leaves alone.
    log_error = _inner(estimates.log_error)
    unlikely = error.detach() * torch.exp(-log_error) + log_error
    return loss + ERROR * weighted_mean(unlikely, weight)


def class_loss(estimates: Estimates, disparity: Tensor, weight: Tensor) -> Tensor:
    """Cross entropy of the hypotheses with those of the pixels that the sweep sees as one."""
    hypotheses = estimates.hypotheses.view(1, -1, 1, 1)
    spacing = estimates.hypotheses[1] - estimates.hypotheses[0]
    wanted = (-2 * (hypotheses - disparity).abs() / spacing).softmax(1) * weight
    height, width = estimates.maps[-1].shape[-2:]
    side = 1 << round(math.log2(width / estimates.scores.shape[-1]))
    right, below = MARGIN_PX + -width % side, MARGIN_PX + -height % side
    wanted = F.avg_pool2d(F.pad(wanted, (MARGIN_PX, right, MARGIN_PX, below)), side)
    unlikely = -(wanted * estimates.scores.float().log_softmax(1)).sum() * side**2
    return unlikely / weight.sum().clamp_min(1)


def _inner(map_: Tensor) -> Tensor:
    return map_[..., MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
