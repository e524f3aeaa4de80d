"""What networks see of gray views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from epinet.networks.contrast import WINDOW_PX, contrast_unit, local_contrast


@dataclass(frozen=True)
class Input:
    """One way to show views to a network."""

    name: str
    """In the metadata of weights."""
    margin_px: int
    """A pixel's value follows from the views so far around."""
    of: Callable[[Tensor], Tensor]
    """What the network sees of gray views (..., H, W) in 0..1; of the same shape."""
    unit: Callable[[Tensor], Tensor]
    """What is 1 in there, in gray values of images (N, 1, H, W); of the same shape."""


GRAY = Input("gray", 0, lambda views: views, torch.ones_like)
LOCAL_CONTRAST = Input("local contrast", WINDOW_PX // 2, local_contrast, contrast_unit)

INPUTS = {kind.name: kind for kind in (GRAY, LOCAL_CONTRAST)}
