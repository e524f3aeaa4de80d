"""Rays against all surfaces of a scene: the nearest one wins, pixel by pixel."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
import torch
from torch import Tensor

from epinet.synth.scenes import Scenes
from epinet.synth.surfaces import Boxes, Group, Planes, Quadrics, Rays, Reliefs

OPAQUE = 127
"""Alpha above which a silhouette belongs to the surface."""


def pixel_rays(
    size: tuple[int, int],
    offsets: Sequence[tuple[float, float]] | Tensor,
    within_px: tuple[float, float] = (0.0, 0.0),
    lens: Tensor | None = None,
    shift_px: Tensor | None = None,
    device: torch.device | str = "cpu",
) -> Rays:
    """The rays of all pixels of P views.

    Args:
        size: (height, width) in px.
        offsets: (row, col) of the views, counted from the centre view.
        within_px: (y, x) of the ray in its pixel, from the pixel's centre.
        lens: (B, 2) point (row, col) of the lens that the rays go through, in views.
        shift_px: (B, P, 2) misalignment (y, x) of the views.
    """
    height, width = size
    dv, du = torch.as_tensor(offsets, dtype=torch.float32).T[:, None, :, None, None].to(device)
    y = torch.arange(height, device=device)[:, None] - (height - 1) / 2 + within_px[0]
    x = torch.arange(width, device=device) - (width - 1) / 2 + within_px[1]
    x, y = x[None, None, None], y[None, None]
    if lens is not None:
        dv, du = dv + lens[:, 0, None, None, None], du + lens[:, 1, None, None, None]
    if shift_px is not None:
        y = y + shift_px[..., 0, None, None]
        x = x + shift_px[..., 1, None, None]
    reach = max(max(abs(float(r)), abs(float(c))) for r, c in offsets) + LENS_REACH
    return Rays(x, y, du, dv, reach)


LENS_REACH = 0.5
"""No lens reaches farther than half-way to the next view."""

SHIFT_REACH_PX = 2.0
"""No view is misaligned by more."""


def nearest(
    scenes: Scenes, rays: Rays, threshold: int = OPAQUE, among: Collection[int] | None = None
) -> tuple[Tensor, Tensor]:
    """Disparity and id of the surface that each ray meets first.

    Args:
        threshold: alpha above which a silhouette is opaque.
        among: ids of the only surfaces to look at; default: all.

    Returns:
        d in px per adjacent view, and the id (int16) into the scenes' materials, both (B, P, H, W).
    """
    broadcast = np.broadcast_shapes(rays.x.shape, rays.y.shape, rays.du.shape)
    shape = torch.Size((scenes.count, *broadcast[1:]))
    d = torch.full(shape, -math.inf, device=rays.x.device)
    surface = torch.zeros(shape, dtype=torch.int16, device=rays.x.device)
    for group, first in zip(scenes.groups, scenes.first_ids, strict=True):
        for k in range(group.exists.shape[1]):
            exists = group.exists[:, k]
            if not exists.any() or not _wanted(group, first, k, among):
                continue
            part = _window(group, k, rays, shape[-2:])
            if part is None:
                continue
            seen = rays if part == FULL else rays.window(*part)
            hit, at, name = _hit(group, k, seen, scenes, threshold)
            best, named = d[..., *part], surface[..., *part]
            closer = hit.logical_and_(at > best)
            if not exists.all():
                closer &= exists.to(d.device)[:, None, None, None]
            best.copy_(torch.where(closer, at, best))
            named.copy_(torch.where(closer, name + first, named))
    return d, surface


def _wanted(group: Group, first: int, k: int, among: Collection[int] | None) -> bool:
    if among is None:
        return True
    if isinstance(group, Boxes):
        return any(first + 6 * k + face in among for face in range(6))
    return first + k in among


FULL = (slice(None), slice(None))


def _hit(
    group: Group, k: int, rays: Rays, scenes: Scenes, threshold: int
) -> tuple[Tensor, Tensor, Tensor | int]:
    match group:
        case Planes():
            return *group.hit(k, rays, scenes.bank.silhouettes, threshold), k
        case Boxes():
            hit, d, face = group.hit(k, rays)
            return hit, d, face + 6 * k
        case Quadrics() | Reliefs():
            return *group.hit(k, rays), k
    raise TypeError(type(group))


def _window(group: Group, k: int, rays: Rays, size: torch.Size) -> tuple[slice, slice] | None:
    """The part of the pixels that surface k of a single scene can be seen in; None for nowhere."""
    if rays.reach is None or len(group.exists) > 1:
        return FULL
    x0, x1, y0, y1, d = group.bounds[0, k].tolist()
    if not math.isfinite(x1 - x0):
        return FULL
    margin = rays.reach * d + SHIFT_REACH_PX + 1
    part = []
    for low, high, length in ((y0, y1, size[0]), (x0, x1, size[1])):
        start = max(0, math.floor(low - margin + (length - 1) / 2))
        stop = min(length, math.ceil(high + margin + (length - 1) / 2) + 1)
        if start >= stop:
            return None
        part.append(slice(start, stop))
    return part[0], part[1]
