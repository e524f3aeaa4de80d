"""A network over a picture of any size within a bound on memory.

EPINET's convolutions are valid, so its tiles give exactly what the whole picture gives. SweepNet
sees far: its tiles overlap by `OVERLAP_PX`, beyond which little reaches (see docs/sweepnet.md).
They begin where pixels of its smallest pictures begin, or those would show other means than in the
whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.model.epinet import MARGIN_PX, Epinet
from epinet.model.sweepnet import SweepNet

FLOATS_PER_PX_AND_CHANNEL = 5.3
"""Peak of what the merge part holds at once (measured; see benchmarks/memory.py)."""


OVERLAP_PX = 64
"""What SweepNet's tiles share with each neighbour."""

FLOATS_PER_PX = 800
"""Peak of what SweepNet holds at once (measured; see benchmarks/memory.py)."""


def tile_side_px(net: Epinet, memory_mb: float) -> int:
    """Side of the largest square tile whose intermediate results fit into `memory_mb`."""
    channels = net.config.streams * net.config.stream_width
    pixels = memory_mb * 2**20 / (4 * channels * FLOATS_PER_PX_AND_CHANNEL)
    return max(16, math.isqrt(int(pixels)) - 2 * MARGIN_PX)


def even_tiles(length: int, side: int) -> list[tuple[int, int]]:
    """Bounds (start, stop) of the fewest tiles of about equal length, none longer than `side`."""
    count = math.ceil(length / side)
    edges = [round(i * length / count) for i in range(count + 1)]
    return list(pairwise(edges))


def pad_views(stacks: Tensor) -> Tensor:
    """Stacks (S, N, H, W) with each view's edge repeated, so that the map comes out H x W."""
    return F.pad(stacks, (MARGIN_PX,) * 4, mode="replicate")


@torch.inference_mode()
def run_tiled(
    net: Epinet, stacks: Tensor, side: int, advance: Callable[[float], None] = lambda share: None
) -> Tensor:
    """Disparity (H, W) of stacks (S, N, H, W), computed in tiles of at most side x side.

    All convolutions are valid and act pixel by pixel, so a tile with its margin gives what the
    whole picture gives there. `advance` receives the share of the work done since its last call.
    """
    height, width = stacks.shape[-2:]
    padded = pad_views(stacks)
    out = torch.empty(height, width, device=stacks.device)
    for top, bottom, left, right in _tiles(height, width, side):
        tile = padded[..., top : bottom + 2 * MARGIN_PX, left : right + 2 * MARGIN_PX]
        with torch.backends.cudnn.flags(allow_tf32=False):  # float32 means float32
            out[top:bottom, left:right] = net(tile[None])[0, 0]
        advance((bottom - top) * (right - left) / (height * width))
    return out


@torch.inference_mode()
def run_overlapping(
    net: SweepNet,
    stacks: Tensor,
    range_px: tuple[float, float],
    memory_mb: float,
    advance: Callable[[float], None] = lambda share: None,
) -> tuple[Tensor, Tensor]:
    """Disparity and its expected error (H, W), both px, of stacks (4, N, H, W)."""
    height, width = stacks.shape[-2:]
    side = math.isqrt(int(memory_mb * 2**20 / 4 / FLOATS_PER_PX))
    inner = max(64, side - 2 * OVERLAP_PX) if max(height, width) > side else side
    disparity, error = torch.empty(2, height, width, device=stacks.device)
    coarsest = net.coarsest_px(range_px, stacks.shape[1])

    def shown(start: int, stop: int) -> slice:
        first = max(0, start - OVERLAP_PX) // coarsest
        return slice(first * coarsest, -(-(stop + OVERLAP_PX) // coarsest) * coarsest)

    for top, bottom, left, right in _tiles(height, width, inner):
        rows, cols = shown(top, bottom), shown(left, right)
        with torch.backends.cudnn.flags(allow_tf32=False):  # float32 means float32
            made = net(stacks[None, :, :, rows, cols], range_px)
        for whole, tile in ((disparity, made.maps[-1]), (error, made.log_error.exp())):
            tile = tile[0, 0, top - rows.start :, left - cols.start :]
            whole[top:bottom, left:right] = tile[: bottom - top, : right - left]
        advance((bottom - top) * (right - left) / (height * width))
    return disparity, error


def _tiles(height: int, width: int, side: int) -> Iterator[tuple[int, int, int, int]]:
    for top, bottom in even_tiles(height, side):
        for left, right in even_tiles(width, side):
            yield top, bottom, left, right
