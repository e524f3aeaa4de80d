"""A network over a picture of any size within a bound on memory; exactly as if in one piece."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.model.network import MARGIN_PX, Epinet

FLOATS_PER_PX_AND_CHANNEL = 5.3
"""Peak of what the merge part holds at once (measured; see benchmarks/memory.py)."""


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


def _tiles(height: int, width: int, side: int) -> Iterator[tuple[int, int, int, int]]:
    for top, bottom in even_tiles(height, side):
        for left, right in even_tiles(width, side):
            yield top, bottom, left, right
