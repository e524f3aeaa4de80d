"""Operations in the layout of torch's convolutions, channels last, for which its own are slow."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional as F


def pointwise(parts: Sequence[Tensor], weight: Tensor, bias: Tensor) -> Tensor:
    """A convolution of 1x1 over images (B, C, H, W) of any layout, of which there may be parts.

    The result has the layout of the next convolutions; nothing is gathered or copied before.

    Args:
        parts: the channels that the convolution takes, in their order.
        weight: (channels out, channels in, 1, 1).
        bias: (channels out,)
    """
    weights = torch.split(weight.flatten(1), [part.shape[1] for part in parts], 1)
    rows = [part.flatten(2).transpose(1, 2) for part in parts]
    flat = F.linear(rows[0], weights[0], bias)
    for row, own in zip(rows[1:], weights[1:], strict=True):
        # In place, which autocast leaves alone.
        flat.baddbmm_(row.to(flat.dtype), own.T.to(flat.dtype).expand(len(row), -1, -1))
    return flat.transpose(1, 2).view(len(flat), -1, *parts[0].shape[-2:])


def softmax(x: Tensor) -> Tensor:
    """Over the channels of images (B, C, H, W)."""
    return x.movedim(1, -1).softmax(-1).movedim(-1, 1)
