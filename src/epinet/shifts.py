"""Pictures moved by parts of a pixel."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F


def shifted(images: Tensor, rows: float, cols: float) -> Tensor:
    """Images (N, H, W) at (y + rows, x + cols), bilinear; the border repeats."""
    down, right = math.floor(rows), math.floor(cols)
    # A negative border is cut off.
    images = F.pad(images, (-right, right + 1, -down, down + 1), mode="replicate")
    images = _between(images[:, :-1], images[:, 1:], rows - down)
    return _between(images[..., :-1], images[..., 1:], cols - right)


def _between(first: Tensor, second: Tensor, share: float) -> Tensor:
    return torch.lerp(first, second, share) if share else first
