"""A function of views over pictures of any size, tile by tile, within a bound on memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import torch
from torch import Tensor

LEAST_SIDE_PX = 64
"""Of tiles, whatever the bound."""


def even_tiles(length: int, side: int) -> list[tuple[int, int]]:
    """Bounds (start, stop) of the fewest tiles of about equal length, none longer than `side`."""
    count = math.ceil(length / side)
    edges = [round(i * length / count) for i in range(count + 1)]
    return list(pairwise(edges))


def tiles(height: int, width: int, side: int) -> Iterator[tuple[int, int, int, int]]:
    """Top, bottom, left and right of tiles of at most side x side px."""
    for top, bottom in even_tiles(height, side):
        for left, right in even_tiles(width, side):
            yield top, bottom, left, right


def overlapping_tiles(
    run: Callable[[Tensor], tuple[Tensor, Tensor | None]],
    stacks: Tensor,
    pixels: float,
    overlap_px: int,
    align_px: int,
    advance: Callable[[float], None],
) -> tuple[Tensor, Tensor | None]:
    """Images that a function makes of views, from tiles that share a border with their neighbours.

    Args:
        run: makes one or two images (1, 1, h, w) of stacks (1, S, N, h, w).
        stacks: (S, N, H, W)
        pixels: of views at once, at most.
        overlap_px: width of the border, or a little more.
        align_px: tiles begin at multiples of this.
        advance: receives the share of the work done since its last call.

    Returns:
        the images, (H, W) each.
    """
    height, width = stacks.shape[-2:]
    side = math.isqrt(int(pixels))
    inner = max(LEAST_SIDE_PX, side - 2 * overlap_px) if max(height, width) > side else side
    images: list[Tensor] = []

    def shown(start: int, stop: int) -> slice:
        first = max(0, start - overlap_px) // align_px
        return slice(first * align_px, -(-(stop + overlap_px) // align_px) * align_px)

    for top, bottom, left, right in tiles(height, width, inner):
        rows, cols = shown(top, bottom), shown(left, right)
        with torch.backends.cudnn.flags(allow_tf32=False):  # float32 means float32
            made = [t for t in run(stacks[None, :, :, rows, cols]) if t is not None]
        if not images:
            images = [torch.empty(height, width, device=t.device) for t in made]
        for whole, tile in zip(images, made, strict=True):
            part = tile[0, 0, top - rows.start :, left - cols.start :]
            whole[top:bottom, left:right] = part[: bottom - top, : right - left]
        advance((bottom - top) * (right - left) / (height * width))
    return images[0], images[1] if len(images) > 1 else None
