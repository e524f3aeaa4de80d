"""Operations in the layout of torch's convolutions, channels last, for which its own are slow."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

PIECE = 2**14
"""Pixels that are brought to another layout at once."""


def pointwise(parts: Sequence[Tensor], weights: Sequence[Tensor], bias: Tensor) -> Tensor:
    """A convolution of 1x1 over images (B, C, H, W) of any layout, of which there may be parts.

    The result has the layout of the next convolutions; nothing is gathered or copied before.

    Args:
        parts: the channels that the convolution takes, in their order.
        weights: (channels out, channels in, 1, 1) of each part.
        bias: (channels out,)
    """
    rows = [part.flatten(2).transpose(1, 2) for part in parts]
    flat = F.linear(rows[0], weights[0].flatten(1), bias)
    for row, weight in zip(rows[1:], weights[1:], strict=True):
        # In place, which autocast leaves alone.
        own = weight.flatten(1).T.to(flat.dtype)
        flat.baddbmm_(row.to(flat.dtype), own.expand(len(row), -1, -1))
    return flat.transpose(1, 2).view(len(flat), -1, *parts[0].shape[-2:])


def to_one(layer: nn.Conv2d, images: Tensor) -> Tensor:
    """A convolution of 3x3 to one channel, padded by zeros, of images (B, C, H, W)."""
    height, width = images.shape[-2:]
    of_taps = layer.weight[0].flatten(1).T.expand(len(images), -1, -1)
    taps = torch.unflatten(of_taps @ images.flatten(2), -1, (height, width)).float()
    padded = F.pad(taps, (1, 1, 1, 1))
    parts = [
        padded[:, k : k + 1, k // 3 : k // 3 + height, k % 3 : k % 3 + width] for k in range(9)
    ]
    assert layer.bias is not None
    return sum(parts, layer.bias.view(1, -1, 1, 1))


def channels_first(images: Tensor) -> Tensor:
    """The same images (B, C, H, W), each channel in one piece of memory."""
    b, c, h, w = images.shape
    rows = images.movedim(1, -1).reshape(-1, c)
    # Torch transposes a matrix on one core; piece by piece, on all.
    channels = torch.cat([piece.T for piece in torch.split(rows, PIECE)], 1)
    return channels.view(c, b, h, w).movedim(0, 1)
