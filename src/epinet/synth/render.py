"""Views of scenes, and the exact truth of any of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from epinet.synth.cast import nearest, pixel_rays
from epinet.synth.scenes import Scenes
from epinet.synth.shade import shade
from epinet.synth.surfaces import Rays

Offsets = Sequence[tuple[int, int]]
"""(row, col) of views, counted from the centre view."""

RAYS_ON_CPU, RAYS_ON_GPU = 2**17, 2**23
"""Bounds the memory; on a CPU, intermediate results also stay in the cache."""


@dataclass(frozen=True)
class Lens:
    """What makes a ray leave the pixel's centre or the view's centre."""

    samples: int = 4
    """Rays per pixel."""
    radius: Tensor | None = None
    """(B,) of each view's lens, in distances between views."""
    shift_px: Tensor | None = None
    """(B, P, 2) misalignment (y, x) of the views."""


def render(scenes: Scenes, offsets: Offsets, lens: Lens) -> Tensor:
    """Views (B, P, C, H, W) in 0..1, without faults beyond the lens's.

    A pixel is the mean over rays that are spread evenly over its square and over the lens; the
    rays also take turns in what they hold for opaque, so that half-transparent silhouettes mix
    with what lies behind.
    """
    channels = scenes.bank.textures.shape[-1]
    height, width = scenes.size
    views = torch.empty(
        (scenes.count, len(offsets), channels, height, width), device=scenes.light.ambient.device
    )
    for some, part in _chunks(scenes.count, len(offsets), height * width, views.device):
        views[some, part] = _render(
            scenes[some],
            offsets[part],
            lens.samples,
            None if lens.radius is None else lens.radius[some],
            None if lens.shift_px is None else lens.shift_px[some, part],
        )
    return views


def _render(
    scenes: Scenes,
    offsets: Offsets,
    samples: int,
    radius: Tensor | None,
    shift_px: Tensor | None,
) -> Tensor:
    device = scenes.light.ambient.device
    total: Tensor | None = None
    seen: set[int] | None = None
    on_lens = _lens_points(samples)
    for s, within_px in enumerate(_pixel_points(samples)):
        rim = None if radius is None else radius[:, None] * on_lens[s]
        rays = pixel_rays(
            scenes.size,
            offsets,
            within_px,
            None if rim is None else rim.to(device),
            None if shift_px is None else shift_px.to(device),
            device,
        )
        opaque = int(255 * ((s * 0.6180339887 + 0.5) % 1.0))
        d, surface = nearest(scenes, rays, opaque, seen)
        if s == 0:  # what the first rays see in no view is left out, but for what has no end
            endless = (~scenes.planes.cut).any(0).nonzero()[:, 0].tolist()
            seen = {*surface.view(-1).long().bincount().nonzero()[:, 0].tolist(), *endless}
        colour = shade(scenes, rays, d, surface)
        total = colour if total is None else total.add_(colour)
    assert total is not None
    return (total / samples).movedim(-1, 2)


def _pixel_points(count: int) -> list[tuple[float, float]]:
    """Points (y, x) that fill a pixel evenly in both directions, their mean its centre.

    Truth is that of the centre: views that are seen from beside it would teach a network to find
    edges beside where they are.
    """
    down = [(0.5 + 0.6180339887 * s) % 1 for s in range(count)]
    mean = sum(down) / count
    return [(y - mean, (s + 0.5) / count - 0.5) for s, y in enumerate(down)]


def _lens_points(count: int) -> Tensor:
    """Points (count, 2) of a sunflower about the size of the unit disc, their mean its centre."""
    s = torch.arange(count) + 0.5
    radius, angle = (s / count).sqrt(), 2.39996323 * s
    points = torch.stack([radius * angle.sin(), radius * angle.cos()], -1)
    return points - points.mean(0)


def truth(scenes: Scenes, offsets: Offsets = ((0, 0),)) -> tuple[Tensor, Tensor]:
    """What is seen at the pixel centres of views.

    Returns:
        The disparity (B, P, H, W) in px per adjacent view, and the surface's id (int16).
    """
    height, width = scenes.size
    device = scenes.light.ambient.device
    shape = (scenes.count, len(offsets), height, width)
    disparity = torch.empty(shape, device=device)
    surfaces = torch.empty(shape, dtype=torch.int16, device=device)
    for some, part in _chunks(scenes.count, len(offsets), height * width, device):
        rays = pixel_rays(scenes.size, offsets[part], device=device)
        disparity[some, part], surfaces[some, part] = nearest(scenes[some], rays)
    return disparity, surfaces


HIDDEN_PX = 0.01
"""A point is hidden where something is nearer by at least this disparity."""


def visible(scenes: Scenes, offsets: Offsets, disparity: Tensor) -> Tensor:
    """Which views see the points of the centre view: exact, whether or not inside the picture.

    Args:
        disparity: (B, 1, H, W) of the centre view.

    Returns:
        (B, P, H, W) bool.
    """
    height, width = scenes.size
    seen = torch.empty((scenes.count, len(offsets), height, width), dtype=torch.bool)
    for some, part in _chunks(scenes.count, len(offsets), height * width, disparity.device):
        rays = pixel_rays(scenes.size, offsets[part], device=disparity.device)
        d = disparity[some]
        there = Rays(rays.x - d * rays.du, rays.y - d * rays.dv, rays.du, rays.dv)
        seen[some, part] = (nearest(scenes[some], there)[0] < d + HIDDEN_PX).to(seen.device)
    return seen.to(disparity.device)


def _chunks(
    scenes: int, views: int, pixels: int, device: torch.device
) -> list[tuple[slice, slice]]:
    """Parts of (scenes, views): many scenes at a time on a GPU, parts of one on a CPU."""
    on_gpu = device.type != "cpu"
    rays = RAYS_ON_GPU if on_gpu else RAYS_ON_CPU
    at_once = max(1, rays // (views * pixels)) if on_gpu else 1
    step = views if at_once > 1 else max(1, rays // pixels)
    return [
        (slice(i, i + at_once), slice(j, j + step))
        for i in range(0, scenes, at_once)
        for j in range(0, views, step)
    ]
