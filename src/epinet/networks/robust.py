"""Robust errors of maps, and their means over pixels that count differently."""

from __future__ import annotations

import torch
from torch import Tensor

FAR = 0.1
"""Share of the plain absolute error in the robust one, so that gross errors count."""


def robust(error: Tensor, scale_px: float | None) -> Tensor:
    """The loss of absolute errors, px.

    Args:
        error: of any shape.
        scale_px: errors far above it hardly count; None takes the plain absolute error.
    """
    if scale_px is None:
        return error
    return scale_px * torch.log1p(error / scale_px) + FAR * error


def weighted_mean(loss: Tensor, weight: Tensor) -> Tensor:
    """Mean over pixels by their weights, which are of the same shape; 0 where all of them are."""
    return (loss * weight).sum() / weight.sum().clamp_min(1)
