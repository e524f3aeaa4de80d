"""A compact generator: textured slanted layers, rendered into any view with exact truth.

A layer is a plane with disparity d(x, y) = a + b x + c y in the centre view (pixels from the
image centre), a texture and a silhouette, both fixed to centre-view coordinates. In the view
offset by (du, dv) = (col - c, row - c) from the centre, its point (x, y) is seen at

    x' = x - d du,   y' = y - d dv,   so   d = (a + b x' + c y') / (1 - b du - c dv),

which gives the disparity at any view pixel in closed form: views are exact plane warps and the
truth, in every view, is exact. Nearer layers cover farther ones, pixel by pixel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.synth.layer_textures import (
    TEXELS_PER_PX,
    canvas_coordinates,
    draw_silhouettes,
    draw_textures,
)

VERSION = "layers-2"
"""Stored with every weight trained on this generator; changes when its scenes change."""

MAX_SLANT = 0.1
"""Largest |b| and |c| in px per px: 1 - b du - c dv stays positive for |du|, |dv| <= 4."""


@dataclass(frozen=True)
class LayerScenes:
    """B scenes of L layers each, far to near."""

    canvases: Tensor
    """(B, L, C + 1, Hc, Wc): C texture channels in 0..1, then coverage in 0..1."""
    planes: Tensor
    """(B, L, 3): a in px, b and c in px per px."""
    size: tuple[int, int]
    """(height, width) of the views in pixels."""

    def render(self, offsets: Sequence[tuple[int, int]]) -> tuple[Tensor, Tensor]:
        """Views and their truth.

        Args:
            offsets: (row, col) of P views, counted from the centre view.

        Returns:
            views (B, P, C, H, W) in 0..1, without noise, and the disparity (B, P, H, W) of the
            surface at each pixel centre of each view, in px per adjacent view.
        """
        height, width = self.size
        dv, du = torch.tensor(offsets, dtype=torch.float32).T[:, None, :, None, None]
        y = (torch.arange(height) - (height - 1) / 2)[:, None]
        x = torch.arange(width) - (width - 1) / 2
        views = disparity = None
        for layer in range(self.planes.shape[1]):
            a, b, c = self.planes[:, layer].T[..., None, None, None]  # each (B, 1, 1, 1)
            d = (a + b * x + c * y) / (1 - b * du - c * dv)  # (B, P, H, W)
            sampled = self._sample(layer, x + d * du, y + d * dv)
            colour, coverage = sampled[:, :, :-1], sampled[:, :, -1]
            if views is None or disparity is None:
                views, disparity = colour, d
                continue
            coverage = coverage * (d > disparity)
            views = torch.lerp(views, colour, coverage[:, :, None])
            disparity = torch.where(coverage > 0.5, d, disparity)
        assert views is not None and disparity is not None
        return views, disparity

    def _sample(self, layer: int, x: Tensor, y: Tensor) -> Tensor:
        """(B, P, C + 1, H, W) of one layer at centre-view positions (B, P, H, W)."""
        canvas = self.canvases[:, layer]
        scale_x = 2 * TEXELS_PER_PX / canvas.shape[-1]
        scale_y = 2 * TEXELS_PER_PX / canvas.shape[-2]
        b, p, h, w = x.shape
        grid = torch.stack([x * scale_x, y * scale_y], dim=-1).view(b, p * h, w, 2)
        sampled = F.grid_sample(canvas, grid, padding_mode="reflection", align_corners=False)
        return sampled.view(b, -1, p, h, w).transpose(1, 2)


def draw_scenes(
    g: Generator,
    count: int,
    size: tuple[int, int],
    disparity_range_px: tuple[float, float] = (-4.0, 4.0),
    layers: int = 6,
    channels: int = 1,
) -> LayerScenes:
    """Draw `count` random scenes; the same generator state gives the same scenes.

    Args:
        g: source of randomness (CPU).
        size: (height, width) of the views to render.
        disparity_range_px: bounds of the layers' disparities at their reference point.
        layers: planes per scene, the farthest one without a silhouette.
        channels: 1 for gray, 3 for colour.
    """
    margin = 4 * max(abs(d) for d in disparity_range_px) + 4
    canvas_size = [TEXELS_PER_PX * math.ceil(s + 2 * margin) for s in size]
    x, y = canvas_coordinates(*canvas_size)
    n = count * layers
    textures = draw_textures(g, x, y, n)[:, None]
    if channels > 1:  # a hue for each layer, which changes with brightness
        tint = 0.5 + 0.5 * torch.rand(n, channels, 1, 1, generator=g)
        bend = torch.exp(0.8 * torch.rand(n, channels, 1, 1, generator=g) - 0.4)
        textures = tint * textures**bend
    coverage = draw_silhouettes(g, x, y, n, size)
    canvases = torch.cat([textures, coverage[:, None]], dim=1)
    canvases = canvases.view(count, layers, channels + 1, *canvas_size)
    return LayerScenes(canvases, _draw_planes(g, count, layers, size, disparity_range_px), size)


def _draw_planes(
    g: Generator, count: int, layers: int, size: tuple[int, int], bounds: tuple[float, float]
) -> Tensor:
    """(count, layers, 3), sorted from far to near by the disparity at the image centre."""
    low, high = bounds
    # Some scenes use all of the range, some a narrow part: small steps must be seen too.
    span = (high - low) * torch.rand(count, 1, generator=g)
    start = low + (high - low - span) * torch.rand(count, 1, generator=g)
    a = start + span * torch.rand(count, layers, generator=g)
    slant = MAX_SLANT * torch.rand(count, layers, 2, generator=g) ** 4
    sign = torch.where(torch.rand(count, layers, 2, generator=g) < 0.5, -1.0, 1.0)
    # A slant keeps the disparity inside the bounds over most of the image.
    limit = 0.5 * (high - low) / max(size)
    b, c = (slant * sign).clamp(-limit, limit).unbind(-1)
    reach = 0.5 * (b.abs() * size[1] + c.abs() * size[0])
    a = torch.maximum(torch.minimum(a, high - reach), low + reach)
    order = a.argsort(dim=1)
    return torch.stack([a, b, c], dim=-1).gather(1, order[..., None].expand(-1, -1, 3))
