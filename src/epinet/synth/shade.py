"""The colour of what the rays meet: texture, light, shadow, highlight and reflection."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.synth.bank import sample
from epinet.synth.scenes import Scenes
from epinet.synth.surfaces import Rays


def shade(scenes: Scenes, rays: Rays, d: Tensor, surface: Tensor) -> Tensor:
    """Colours (B, P, H, W, C) in 0..1 of what `cast.nearest` found.

    Texture, diffuse light and shadow belong to the point of the surface; highlights and
    reflections move with the view.
    """
    m = scenes.materials
    count, number = m.tile.shape
    first = torch.arange(count, device=d.device)[:, None, None, None] * number
    index = (surface.to(torch.int64) + first).view(-1)
    x, y = rays.at(d)
    at = tuple(t.reshape(-1) for t in (x, y, d))
    table = m.texels.reshape(count * number, 8).T.contiguous().index_select(1, index)
    u, v = _affine(table[:4], at), _affine(table[4:], at)
    tint = m.tint.view(-1, 3)
    gray = scenes.bank.textures.shape[-1] == 1
    tint = tint.mean(-1, keepdim=True) if gray else tint
    colour = sample(scenes.bank.textures, m.tile.view(-1).index_select(0, index), u, v)
    colour = colour * tint.index_select(0, index)
    colour = _near_lit(scenes, _shadowed(scenes, colour, at), at)
    colour = _lit(scenes, rays, colour, at, index, d.shape)
    return colour.clamp_(0, 1).view(*d.shape, -1)


Points = tuple[Tensor, ...]
"""X, Y and d of the points, (N,) each."""


def _affine(table: Tensor, at: Points) -> Tensor:
    x, y, d = at
    return torch.addcmul(
        torch.addcmul(torch.addcmul(table[0], table[1], x), table[2], y), table[3], d
    )


def _shadowed(scenes: Scenes, colour: Tensor, at: Points) -> Tensor:
    light = scenes.light
    if not (light.shade_strength > 0).any():
        return colour
    points = [t.view(len(light.shade), -1) for t in at]
    u, v = (_affine(light.shade_texels[:, row].T[..., None], tuple(points)) for row in (0, 1))
    shadow = sample(scenes.bank.shades, light.shade[:, None], u, v)
    return colour * (1 - light.shade_strength[:, None, None] * shadow).view(-1, 1)


def _near_lit(scenes: Scenes, colour: Tensor, at: Points) -> Tensor:
    light = scenes.light
    if not light.reach.isfinite().any():
        return colour
    away = torch.zeros_like(at[0]).view(len(light.reach), -1)
    for t, brightest, reach in zip(at, light.brightest.T, light.reach.T, strict=True):
        away += ((t.view_as(away) - brightest[:, None]) / reach[:, None]) ** 2
    ambient = light.ambient[:, None]
    return colour * (ambient + (1 - ambient) / (1 + away)).view(-1, 1)


def _lit(
    scenes: Scenes, rays: Rays, colour: Tensor, at: Points, index: Tensor, shape: torch.Size
) -> Tensor:
    """Light that varies over a surface, where there is any: only those pixels are worked on."""
    m, light = scenes.materials, scenes.light
    varied = m.curved | (m.highlight[..., 0] > 0) | (m.mirror[..., 0] > 0)
    chosen = varied.view(-1).index_select(0, index).nonzero()[:, 0]
    if not len(chosen):
        return colour
    index = index[chosen]
    here = tuple(t[chosen] for t in at)
    scene = index // m.tile.shape[1]
    normal = _normals(scenes, here, index, scene)
    du, dv = (t.expand(shape).reshape(-1)[chosen] for t in (rays.du, rays.dv))
    seen = colour[chosen]
    direction = light.direction[scene]
    bright = diffuse(normal, direction, light.ambient[scene])
    curved = m.curved.view(-1)[index]
    seen = seen * torch.where(curved, bright, 1.0)[:, None]
    share, apart, bend = m.mirror.view(-1, 3)[index].unbind(-1)
    xs = here[0] + (apart - here[2]) * du + bend * normal[:, 0]
    ys = here[1] + (apart - here[2]) * dv + bend * normal[:, 1]
    second = sample(scenes.bank.textures, m.second.view(-1)[index], xs, ys)
    seen = torch.lerp(seen, second, share[:, None])
    strength, exponent = m.highlight.view(-1, 2)[index].unbind(-1)
    focal_px, depth_px = light.focal_px[scene], light.depth_px[scene]
    per_view = focal_px / depth_px
    towards = torch.stack([du * per_view - here[0], dv * per_view - here[1], focal_px], -1)
    half = F.normalize(F.normalize(towards, dim=-1) + direction, dim=-1)
    glare = (normal * half).sum(-1).clamp_min(0) ** exponent
    seen = seen + (strength * glare)[:, None]
    return colour.index_copy(0, chosen, seen)


def _normals(scenes: Scenes, at: Points, index: Tensor, scene: Tensor) -> Tensor:
    """(N, 3) unit normals towards the viewer, in the frame of the light."""
    table = scenes.materials.normal.reshape(-1, 3, 4)[index]
    x, y, d = at
    normal = table[..., 0] + table[..., 1] * x[:, None]
    normal = normal + table[..., 2] * y[:, None] + table[..., 3] * d[:, None]
    first = scenes.first_ids[2]
    relief = (index % scenes.materials.tile.shape[1]) == first
    if relief.any():
        chosen = relief.nonzero()[:, 0]
        slopes = _relief_slopes(scenes, x[chosen], y[chosen], scene[chosen])
        depth_px = scenes.light.depth_px[scene[chosen]]
        steep = torch.stack([-slopes[0], -slopes[1], 1 / depth_px], -1)
        normal = normal.index_copy(0, chosen, steep)
    normal = F.normalize(normal, dim=-1)
    return torch.where(normal[:, 2:] < 0, -normal, normal)


def _relief_slopes(scenes: Scenes, x: Tensor, y: Tensor, scene: Tensor) -> tuple[Tensor, Tensor]:
    coefficients = scenes.reliefs.coefficients[scene, 0]
    per_x, per_y = coefficients[:, 1], coefficients[:, 2]
    for wave in scenes.reliefs.waves[:, 0].unbind(1):
        amplitude, fx, fy, phase = wave[scene].unbind(-1)
        slope = amplitude * (phase + fx * x + fy * y).cos()
        per_x, per_y = per_x + slope * fx, per_y + slope * fy
    return per_x, per_y


def diffuse(normal: Tensor, direction: Tensor, ambient: Tensor) -> Tensor:
    """Lambert's law for the side that is seen, (...), from unit vectors (..., 3)."""
    seen = torch.where(normal[..., 2:] < 0, -normal, normal)
    return ambient + (1 - ambient) * (seen * direction).sum(-1).clamp_min(0)
