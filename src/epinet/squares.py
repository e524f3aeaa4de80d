"""Over the square around each pixel: in a few passes over the image, however large it is.

Torch's poolings look at every pixel of a window anew; here windows grow out of half as large ones.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn import functional as F


def box_mean(images: Tensor, side: int) -> Tensor:
    """Mean over the square of odd `side` around each pixel of (..., H, W), of what lies inside."""
    if side == 1:
        return images
    padded = F.pad(images, (side // 2,) * 4)
    for axis in (-2, -1):
        inside = torch.ones(images.shape[axis], device=images.device, dtype=images.dtype)
        inside = _sums(F.pad(inside, (side // 2,) * 2), side, -1)
        padded = _sums(padded, side, axis) / (inside[:, None] if axis == -2 else inside)
    return padded


def extremes(images: Tensor, side: int) -> tuple[Tensor, Tensor]:
    """Greatest and least in the square of odd `side` around each pixel of (B, C, H, W)."""
    padded = F.pad(images, (side // 2,) * 4, mode="replicate")
    return _chosen(padded, side, torch.maximum), _chosen(padded, side, torch.minimum)


def _sums(padded: Tensor, side: int, axis: int) -> Tensor:
    """Of `side` neighbours each: the windows of 1, 2, 4, ... that make up that many, end to end."""
    count = padded.shape[axis] - side + 1
    parts, begin, size = [], 0, 1
    while True:
        if side & size:
            parts.append(padded.narrow(axis, begin, count))
            begin += size
        if 2 * size > side:
            return sum(parts[1:], parts[0])
        rest = padded.shape[axis] - size
        padded = padded.narrow(axis, 0, rest) + padded.narrow(axis, size, rest)
        size *= 2


def _chosen(padded: Tensor, side: int, choose: Callable[[Tensor, Tensor], Tensor]) -> Tensor:
    """What is left of each square when, of every two values, one is chosen."""
    for axis in (-2, -1):
        size = 1
        while size < side:
            by = min(size, side - size)
            rest = padded.shape[axis] - by
            padded = choose(padded.narrow(axis, 0, rest), padded.narrow(axis, by, rest))
            size += by
    return padded
