"""What a camera does to the views: blur, vignetting, exposure, gamma, noise, 8 bits.

Parameters come from a CPU generator, pixel noise from a counter's hash, so that every device
makes the same picture. A strength of 1 bounds what is drawn for a scene; most scenes get far
less, and 0 turns a fault off exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.synth.dice import Dice
from epinet.synth.options import Faults

BLUR_PX = 0.9
"""Largest sigma of the blur, at strength 1."""

LENS_RADIUS = 0.35
"""Largest radius of a view's lens in distances between views, at strength 1."""

MISALIGNED_PX = 0.06
"""Largest standard deviation of a view's position in its picture, at strength 1."""

NOISE = 0.03
"""Largest standard deviation of noise on white, at strength 1."""

AT_ONCE_ON_CPU = 2**16
"""Pixels whose noise is made at once: what a core's cache holds."""

DARKEST = 0.04
"""Least exposure of scenes taken in the dark, at strength 1."""

ROUNDING = 1 / 255 / math.sqrt(12)
"""Standard deviation of what rounding to 8 bits adds."""


class Photos(NamedTuple):
    """What a camera makes of the views."""

    views: Tensor
    """(B, P, C, H, W) in 0..1."""
    deviation: Tensor
    """The same shape: standard deviation of noise and rounding."""


def _share(g: Generator, faults: Faults, power: float, *shape: int) -> Tensor:
    """How much of a strength a scene gets: 0..1, seldom much."""
    drawn = Dice(g).uniform(0, 1, *shape) ** power
    return torch.ones_like(drawn) if faults.full else drawn


def draw_lens_radius(g: Generator, count: int, faults: Faults) -> Tensor:
    """(B,) radius of the lens of each view, in distances between views: defocus blur."""
    return LENS_RADIUS * faults.defocus * _share(g, faults, 2, count)


def draw_misalignment(g: Generator, count: int, views: int, faults: Faults) -> Tensor:
    """(B, P, 2) px by which each view is off, 0 in most scenes; the largest is 2 px."""
    much = _share(g, faults, 6, count, 1, 1)
    off = MISALIGNED_PX * faults.misalignment * much * torch.randn(count, views, 2, generator=g)
    return off.clamp(-2, 2)


def blurred(g: Generator, views: Tensor, faults: Faults) -> Tensor:
    """(B, P, C, H, W) blurred by a Gaussian, one for each scene."""
    sigmas = BLUR_PX * faults.blur * _share(g, faults, 1.5, len(views))
    if faults.blur == 0:
        return views
    return torch.stack([_blur(v, s) for v, s in zip(views, sigmas.tolist(), strict=True)])


def _blur(views: Tensor, sigma: float) -> Tensor:
    if sigma < 0.1:
        return views
    reach = math.ceil(3 * sigma)
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / sigma) ** 2)
    kernel = (kernel / kernel.sum()).to(views.device)
    flat = F.pad(views.flatten(0, 1)[:, None], (reach,) * 4, mode="replicate")
    flat = F.conv2d(F.conv2d(flat, kernel.view(1, 1, 1, -1)), kernel.view(1, 1, -1, 1))
    return flat.view_as(views)


def photographed(
    g: Generator, views: Tensor, faults: Faults, *, picture_px: int | None = None
) -> Photos:
    """Exposure, vignetting, gamma, noise and rounding of clean views.

    Args:
        views: (B, P, C, H, W) in 0..1.
        picture_px: side of the pictures that the views are windows into, anywhere; None: they are
            whole pictures.
    """
    b, p, c, height, width = views.shape
    device = views.device
    dice = Dice(g)
    one = (b, 1, 1, 1, 1)
    uneven = 0.04 * faults.exposure * _share(g, faults, 4, *one)
    dark = torch.where(dice.chance(0.2, *one), dice.log_uniform(DARKEST, 1, *one), 1.0)
    gain = (dark * torch.exp(dice.uniform(-0.4, 0.4, *one))) ** faults.exposure
    gain = gain * (1 + uneven * torch.randn(b, p, 1, 1, 1, generator=g))
    gain = gain * (1 + 0.5 * uneven * torch.randn(b, p, c, 1, 1, generator=g))
    gamma = torch.exp(faults.gamma * dice.uniform(-0.22, 0.22, *one))
    darker = faults.vignetting * 0.3 * _share(g, faults, 3, *one)
    sway = faults.vignetting * dice.uniform(-0.3, 0.3, b, p, 1, 1, 1)
    noise = NOISE * faults.noise * _share(g, faults, 7, *one)
    read = dice.uniform(0.1, 0.7, *one)
    key = int(torch.randint(2**31, (), generator=g))
    y, x = (_across(b, length, picture_px, dice).to(device) for length in (height, width))
    radius = (x.view(b, 1, 1, 1, -1) + sway.to(device)) ** 2 + y.view(b, 1, 1, -1, 1) ** 2
    seen = views * gain.to(device) * (1 - darker.to(device) * radius).clamp_min(0)
    seen = seen.clamp(0, 1) ** gamma.to(device)
    # Shot noise grows with the light, read noise does not.
    deviation = noise.to(device) * torch.sqrt(seen + read.to(device) ** 2)
    if faults.noise > 0:
        seen = seen + deviation * hashed_normal(views.shape, key, device)
    seen = seen.clamp(0, 1)
    if faults.quantise:
        seen, deviation = (
            torch.round(seen * 255) / 255,
            torch.hypot(deviation, torch.tensor(ROUNDING)),
        )
    return Photos(seen, deviation)


def _across(count: int, length: int, picture_px: int | None, dice: Dice) -> Tensor:
    """(B, length) places of each window's pixels in a picture from -1 to 1."""
    whole = torch.linspace(-1, 1, max(length, picture_px or length))
    if len(whole) == length:
        return whole.expand(count, -1)
    first = dice.integers(0, len(whole) - length, count)
    return whole[first[:, None] + torch.arange(length)]


def hashed_normal(shape: torch.Size, key: int, device: torch.device | str) -> Tensor:
    """Nearly normal noise that depends on the key and the position alone, on any device.

    The sum of four 16-bit parts of a splitmix64 hash: mean 0, deviation 1, within +-3.5.
    """
    count = math.prod(shape)
    piece = count if torch.device(device).type == "cuda" else AT_ONCE_ON_CPU
    pieces = [
        _hashed(torch.arange(first, min(first + piece, count), device=device) + (key << 32))
        for first in range(0, count, piece)
    ]
    return torch.cat(pieces).view(shape)


def _hashed(x: Tensor) -> Tensor:
    x = x * -7046029254386353131
    x = (x ^ ((x >> 30) & 0x3FFFFFFFF)) * -4658895280553007687
    x = (x ^ ((x >> 27) & 0x1FFFFFFFFF)) * -7723592293110705685
    x = x ^ ((x >> 31) & 0x1FFFFFFFF)
    total = (x & 0xFFFF) + ((x >> 16) & 0xFFFF) + ((x >> 32) & 0xFFFF) + ((x >> 48) & 0xFFFF)
    scale = math.sqrt(3.0) / 65536
    return (total.float() - 2 * 65535) * scale
