"""Pictures moved by parts of a pixel, and how they change from one pixel to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional as F


class Margined:
    """Images (N, H, W) whose border repeats as far as they will be shifted.

    Args:
        images: them.
        reach_px: up to which they can be shifted, in rows and columns.
    """

    def __init__(self, images: Tensor, reach_px: float) -> None:
        self.margin = math.floor(reach_px) + 1
        self.images = F.pad(images, (self.margin,) * 4, mode="replicate")

    def shifted(self, rows: float, cols: float) -> Tensor:
        """They at (y + rows, x + cols), bilinear."""
        down, right = math.floor(rows), math.floor(cols)
        height, width = (side - 2 * self.margin for side in self.images.shape[-2:])
        top, left = self.margin + down, self.margin + right
        seen = self.images[..., top : top + height + 1, left : left + width + 1]
        seen = _between(seen[..., :-1, :], seen[..., 1:, :], rows - down)
        return _between(seen[..., :-1], seen[..., 1:], cols - right)


def sampled(
    views: Tensor,
    disparity: Tensor,
    moves: Sequence[tuple[float, float]],
    top: int = 0,
) -> Tensor:
    """Views where they show the centre view's points, bilinear; the border repeats.

    Args:
        views: (B, P, H, W), or `doubled` so often that they are so many times as large.
        disparity: (B, 1, R, W) of the centre view's rows from `top` on, px per unit of `moves`.
        moves: (rows, columns) of the views from the centre view. A view at (r, c) shows the point
            of (x, y) at (x - c d, y - r d).

    Returns:
        (B, P, R, W).
    """
    b, p, h, w = views.shape
    rows, width = disparity.shape[-2:]
    per_px = w // width
    places = _places(h, w, per_px, views.device, views.dtype)[:, top : top + rows]
    by = [(2 * per_px * col / w, 2 * per_px * row / h) for row, col in moves]
    by_px = torch.tensor(by, dtype=views.dtype, device=views.device).view(1, p, 2, 1, 1)
    grid = torch.addcmul(places, disparity[:, :, None], by_px, value=-1)  # (B, P, 2, R, W)
    seen = F.grid_sample(
        views.reshape(b * p, 1, h, w),
        grid.flatten(0, 1).permute(0, 2, 3, 1),
        padding_mode="border",
        align_corners=False,
    )
    return seen.view(b, p, rows, width)


def _between(first: Tensor, second: Tensor, share: float) -> Tensor:
    return torch.lerp(first, second, share) if share else first


def gradients_of(image: Tensor) -> Tensor:
    """(B, 2, H, W) of an image (B, 1, H, W): down and to the right; the border repeats."""
    padded = F.pad(image, (1, 1, 1, 1), mode="replicate")
    down = (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2
    right = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    return torch.cat([down, right], 1)


@lru_cache(maxsize=4)
def _places(
    height: int, width: int, per_px: int, device: torch.device, dtype: torch.dtype
) -> Tensor:
    """(2, H, W) of every so many-th point of a grid, x and y from -1 to 1 between its borders: most
    calls ask again."""
    with torch.inference_mode(False):  # training may ask for them, too
        y = torch.arange(0, height, per_px, device=device, dtype=dtype)
        x = torch.arange(0, width, per_px, device=device, dtype=dtype)
        across, down = (2 * x + 1) / width - 1, (2 * y + 1) / height - 1
        return torch.stack(torch.meshgrid(across, down, indexing="xy"))
