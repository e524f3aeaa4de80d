"""Pictures moved by parts of a pixel, and how they change from one pixel to the next."""

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


def gradients_of(image: Tensor) -> Tensor:
    """(B, 2, H, W) of an image (B, 1, H, W): down and to the right; the border repeats."""
    padded = F.pad(image, (1, 1, 1, 1), mode="replicate")
    down = (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2
    right = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    return torch.cat([down, right], 1)
