"""Textures and silhouettes of layers, drawn on canvases finer than the pixels.

A canvas covers a rectangle of the centre view at `TEXELS_PER_PX` texels per pixel, so that
bilinear sampling at sub-pixel positions neither blurs nor aliases visibly. Every function takes
coordinates in pixels, (n, H, W) each, and returns (n, H, W).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

TEXELS_PER_PX = 2


def uniform(g: Generator, low: float, high: float, n: int) -> Tensor:
    """(n, 1, 1) uniform numbers."""
    return low + (high - low) * torch.rand(n, 1, 1, generator=g)


def log_uniform(g: Generator, low: float, high: float, n: int) -> Tensor:
    """(n, 1, 1) numbers uniform in their logarithm."""
    return torch.exp(uniform(g, math.log(low), math.log(high), n))


def canvas_coordinates(height: int, width: int) -> tuple[Tensor, Tensor]:
    """(H, W) x and y in pixels from the canvas centre."""
    y = (torch.arange(height) - (height - 1) / 2) / TEXELS_PER_PX
    x = (torch.arange(width) - (width - 1) / 2) / TEXELS_PER_PX
    return x.expand(height, width), y[:, None].expand(height, width)


def _rotated(g: Generator, x: Tensor, y: Tensor, n: int) -> tuple[Tensor, Tensor]:
    angle = uniform(g, 0, 2 * math.pi, n)
    return x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin()


def _standardised(t: Tensor) -> Tensor:
    t = t - t.mean((-2, -1), keepdim=True)
    return t / t.std((-2, -1), keepdim=True).clamp_min(1e-6)


def spectral_noise(
    g: Generator, x: Tensor, n: int, slope: tuple[float, float] = (0.4, 1.8)
) -> Tensor:
    """Gaussian noise whose amplitude falls as frequency ** -slope, band-limited to the pixel."""
    height, width = x.shape
    frequency = torch.hypot(torch.fft.fftfreq(height)[:, None], torch.fft.rfftfreq(width)[None])
    white = torch.fft.rfft2(torch.randn(n, height, width, generator=g))
    falloff = frequency.clamp_min(1 / max(height, width)) ** -uniform(g, *slope, n)
    cutoff = 0.5 / TEXELS_PER_PX
    band = torch.exp(-((frequency / cutoff) ** 4))
    return _standardised(torch.fft.irfft2(white * falloff * band, s=(height, width)))


def _patches(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Noise cut into a few flat tones: irregular regions with sharp borders."""
    noise = spectral_noise(g, x, n, slope=(1.2, 2.2))
    tones = uniform(g, 0.6, 2.5, n)
    return torch.round(noise * tones)


def _cells(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Tiles of random tone; a warp of random strength turns them into irregular cells."""
    u, v = _rotated(g, x, y, n)
    warp = log_uniform(g, 0.05, 6.0, n)
    u = u + warp * spectral_noise(g, x, n, slope=(1.5, 2.5))
    v = v + warp * spectral_noise(g, x, n, slope=(1.5, 2.5))
    period = log_uniform(g, 2.5, 30, n)
    aspect = log_uniform(g, 0.5, 2.0, n)
    i = torch.floor(u / period).long()
    j = torch.floor(v / (period * aspect)).long()
    tones = torch.randn(n, 64, 64, generator=g)
    layer = torch.arange(n)[:, None, None]
    out: Tensor = tones[layer, i % 64, j % 64]
    return out


def _stripes(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Periodic stripes or checks, from sine-like to hard-edged."""
    u, v = _rotated(g, x, y, n)
    period = log_uniform(g, 2.5, 25, n)
    wave = torch.sin(2 * math.pi * u / period + uniform(g, 0, 6.3, n))
    other = torch.sin(2 * math.pi * v / (period * log_uniform(g, 0.5, 2, n)))
    wave = torch.where(uniform(g, 0, 1, n) < 0.4, wave * other, wave)
    return torch.tanh(wave * log_uniform(g, 0.5, 10, n))


def _dots(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Round spots of random tone on a jittered lattice."""
    u, v = _rotated(g, x, y, n)
    period = log_uniform(g, 4, 20, n)
    i, j = torch.floor(u / period).long(), torch.floor(v / period).long()
    layer = torch.arange(n)[:, None, None]
    jitter = 0.6 * torch.rand(3, n, 64, 64, generator=g) + 0.2
    du, dv, tone = jitter[:, layer, i % 64, j % 64]
    distance = period * torch.hypot(u / period - i - du, v / period - j - dv)
    radius = period * uniform(g, 0.1, 0.3, n)
    spots: Tensor = torch.clamp(radius - distance + 0.5, 0, 1) * (tone - 0.1)
    return spots


def _smooth(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Slow variations only: walls, sky, painted surfaces."""
    return spectral_noise(g, x, n, slope=(2.0, 3.5))


Family = Callable[[Generator, Tensor, Tensor, int], Tensor]
_TEXTURES: tuple[tuple[float, Family], ...] = (
    (0.40, lambda g, x, y, n: spectral_noise(g, x, n)),
    (0.10, _patches),
    (0.18, _cells),
    (0.12, _stripes),
    (0.08, _dots),
    (0.12, _smooth),
)


def _mixed_families(
    families: tuple[tuple[float, Family], ...], g: Generator, x: Tensor, y: Tensor, n: int
) -> Tensor:
    weights = torch.tensor([w for w, _ in families])
    choice = torch.multinomial(weights, n, replacement=True, generator=g)
    out = torch.empty(n, *x.shape)
    for k, (_, family) in enumerate(families):
        chosen = torch.nonzero(choice == k)[:, 0]
        if len(chosen):
            out[chosen] = family(g, x, y, len(chosen)).float()
    return out


def blur(t: Tensor, sigma_texels: float) -> Tensor:
    """Gaussian blur of (n, H, W), edges replicated."""
    reach = max(1, math.ceil(2.5 * sigma_texels))
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / sigma_texels) ** 2)
    kernel = kernel / kernel.sum()
    t = F.pad(t[:, None], (reach,) * 4, mode="replicate")
    t = F.conv2d(F.conv2d(t, kernel.view(1, 1, 1, -1)), kernel.view(1, 1, -1, 1))
    return t[:, 0]


def draw_textures(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """(n, H, W) gray textures in 0..1 on canvas coordinates (H, W) in px."""
    main = _standardised(_mixed_families(_TEXTURES, g, x, y, n))
    fine = _standardised(_mixed_families(_TEXTURES, g, x, y, n))
    shade = spectral_noise(g, x, n, slope=(2.0, 3.5))
    mix = torch.rand(n, 1, 1, generator=g) ** 2
    pattern = _standardised(main + mix * fine + 0.7 * torch.rand(n, 1, 1, generator=g) * shade)
    contrast = log_uniform(g, 0.005, 0.35, n)
    mean = uniform(g, 0.08, 0.85, n)
    sharp = mean + contrast * torch.sqrt(mean / 0.5) * pattern
    return blur(sharp.clamp(0, 1), sigma_texels=0.35 * TEXELS_PER_PX)


# Silhouettes: signed distances in px, positive inside.


def _discs(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    u, v = _rotated(g, x, y, n)
    radius = log_uniform(g, 2, 40, n)
    aspect = uniform(g, 0.4, 1.0, n)
    return (radius - torch.hypot(u, v / aspect)) * aspect


def _boxes(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    u, v = _rotated(g, x, y, n)
    return torch.minimum(log_uniform(g, 3, 50, n) - u.abs(), log_uniform(g, 3, 50, n) - v.abs())


def _bars(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Long thin bars, sometimes a fence of them."""
    u, v = _rotated(g, x, y, n)
    half_width = log_uniform(g, 0.6, 5, n)
    period = half_width * uniform(g, 4, 12, n)
    folded = torch.remainder(u + period / 2, period) - period / 2
    u = torch.where(uniform(g, 0, 1, n) < 0.35, folded, u)
    return torch.minimum(half_width - u.abs(), log_uniform(g, 15, 300, n) - v.abs())


def _polygons(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Convex polygons of 1 (a half plane) to 5 sides."""
    sides = torch.randint(1, 6, (n, 1, 1), generator=g)
    radius = log_uniform(g, 4, 40, n)
    start = uniform(g, 0, 2 * math.pi, n)
    inside = torch.full((n, *x.shape), math.inf)
    for k in range(5):
        angle = start + 2 * math.pi * (k + uniform(g, -0.3, 0.3, n)) / sides
        edge = radius * uniform(g, 0.5, 1.2, n) - (x * angle.cos() + y * angle.sin())
        inside = torch.where(k < sides, torch.minimum(inside, edge), inside)
    return inside


def _blobs(g: Generator, x: Tensor, y: Tensor, n: int) -> Tensor:
    """Free-form regions: a level set of smooth noise, divided by its slope."""
    noise = spectral_noise(g, x, n, slope=(1.8, 3.0))
    dy, dx = torch.gradient(noise, dim=(-2, -1))
    slope = (torch.hypot(dx, dy) * TEXELS_PER_PX).clamp_min(0.01)
    return (noise - uniform(g, -0.3, 1.3, n)) / slope


_SILHOUETTES: tuple[tuple[float, Family], ...] = (
    (0.20, _discs),
    (0.15, _boxes),
    (0.20, _bars),
    (0.25, _polygons),
    (0.20, _blobs),
)


def draw_silhouettes(g: Generator, x: Tensor, y: Tensor, n: int, size: tuple[int, int]) -> Tensor:
    """(n, H, W) coverage in 0..1 of shapes centred inside (height, width); edges 1 px wide.

    Shapes grow with pictures larger than a training patch.
    """
    growth = max(1.0, min(size) / 128)
    x, y = x / growth, y / growth
    reach_y, reach_x = 0.5 * size[0] / growth, 0.5 * size[1] / growth
    signed = torch.empty(n, *x.shape)
    shift_x = uniform(g, -reach_x, reach_x, n)
    shift_y = uniform(g, -reach_y, reach_y, n)
    weights = torch.tensor([w for w, _ in _SILHOUETTES])
    choice = torch.multinomial(weights, n, replacement=True, generator=g)
    for k, (_, family) in enumerate(_SILHOUETTES):
        chosen = torch.nonzero(choice == k)[:, 0]
        for i in chosen.tolist():  # each has its own origin
            signed[i] = family(g, x - shift_x[i], y - shift_y[i], 1)[0]
    return torch.clamp(growth * signed + 0.5, 0, 1)
