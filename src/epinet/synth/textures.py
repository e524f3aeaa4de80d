"""Textures: square tiles of colour that the surfaces of rendered scenes wear.

A tile is sampled with wrap-around at 0.7 to 2 texels per pixel of the picture. Its patterns come
from the families of `FAMILIES`, for validation scenes from those of `HELD_OUT`; two families mix
in a part of the tiles. Colours are drawn apart from the patterns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import torch
from torch import Generator, Tensor

from epinet.errors import InputError
from epinet.synth import texture_noise as noisy
from epinet.synth import texture_regular as regular
from epinet.synth import texture_scattered as scattered
from epinet.synth.dice import Dice
from epinet.synth.photographs import Photographs
from epinet.synth.tiles import Family, draw_mixed, edge, periodic_noise, standardised

__all__ = ["FAMILIES", "HELD_OUT", "Photographs", "draw_textures"]

_MOTIFS: Mapping[str, Family] = MappingProxyType(
    {
        "noise": Family(1.0, noisy.noise),
        "patches": Family(1.0, noisy.patches),
        "cells": Family(1.0, regular.cells),
        "dots": Family(1.0, scattered.dots),
        "foliage": Family(1.5, scattered.foliage),
        "panels": Family(1.0, scattered.panels),
        "glyphs": Family(0.7, scattered.glyphs),
    }
)


def _wallpaper(dice: Dice, n: int, side: int) -> Tensor:
    """A piece of another family, again and again: exactly periodic."""
    times = [t for t in (2, 3, 4, 5, 6, 8) if side % t == 0 and side // t >= 16] or [1]
    choice = torch.randint(len(times), (n,), generator=dice.g)
    out = torch.empty(n, side, side, device=dice.device)
    for k, repeats in enumerate(times):
        chosen = torch.nonzero(choice == k)[:, 0]
        motif, _ = draw_mixed(_MOTIFS, dice, len(chosen), side // repeats)
        out[chosen.to(dice.device)] = motif.repeat(1, repeats, repeats)
    return out


FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "noise": Family(3.0, noisy.noise),
        "brushed": Family(1.5, noisy.brushed),
        "patches": Family(1.2, noisy.patches),
        "speckle": Family(1.0, noisy.speckle),
        "marble": Family(1.0, noisy.marble),
        "turbulence": Family(0.8, noisy.turbulence),
        "wood": Family(1.0, noisy.wood, wraps=False),
        "gradients": Family(0.8, noisy.gradients, wraps=False),
        "stripes": Family(1.5, regular.stripes),
        "checks": Family(1.0, regular.checks),
        "barcodes": Family(0.7, regular.barcodes),
        "repeats": Family(1.0, regular.repeats),
        "bricks": Family(1.2, regular.bricks),
        "cells": Family(1.5, regular.cells),
        "weave": Family(0.8, regular.weave),
        "dots": Family(1.0, scattered.dots),
        "scratches": Family(0.8, scattered.scratches),
        "glyphs": Family(1.0, scattered.glyphs, wraps=False),
        "foliage": Family(1.2, scattered.foliage),
        "panels": Family(0.8, scattered.panels),
        "wallpaper": Family(0.8, _wallpaper),
    }
)
"""What training scenes wear."""

HELD_OUT: Mapping[str, Family] = MappingProxyType(
    {
        "labyrinth": Family(1.0, noisy.labyrinth),
        "ripples": Family(1.0, noisy.ripples, wraps=False),
        "hexagons": Family(1.0, regular.hexagons),
        "chevrons": Family(1.0, regular.chevrons),
        "scales": Family(1.0, regular.scales),
        "crosses": Family(1.0, scattered.crosses),
    }
)
"""What only validation scenes wear."""

FAINTEST = 0.005
"""The smallest contrast drawn: about one step of 8 bits; below lie wholly flat tiles only."""

GRAINED, GRAIN = 0.75, (0.004, 0.15)
"""Share of the tiles with grain, and its deviation as a share of their brightness."""

_AT_ONCE = 1 << 22


def draw_textures(
    g: Generator,
    n: int,
    side: int,
    *,
    held_out: bool = False,
    contrast: tuple[float, float] = (0.0, 1.0),
    photographs: Photographs | None = None,
    photograph_share: float = 0.3,
    device: str | torch.device = "cpu",
) -> Tensor:
    """(n, 3, side, side) float32 RGB tiles in 0..1.

    Args:
        g: a generator on the CPU; the same state gives the same tiles, on every device.
        side: texels, at least 16.
        held_out: draw from `HELD_OUT` instead of `FAMILIES`.
        contrast: bounds of a tile's contrast. A tile is `mean + contrast * (pattern - mean)`
            with a pattern that spans about 0..1, beside its grain; `(0, 0)` makes every tile flat.
        photographs: where crops come from that are a share of the tiles.
        photograph_share: that share, of 0..1.

    Raises:
        InputError: a side below 16, or bounds or a share outside 0..1.
    """
    low, high = contrast
    problems = [f"a texture needs 16 texels at least, not {side}"] if side < 16 else []
    if not 0 <= low <= high <= 1:
        problems.append(f"contrast is a range inside 0..1, not {contrast}")
    if not 0 <= photograph_share <= 1:
        problems.append(f"the share of photographs lies in 0..1, not {photograph_share:g}")
    if problems:
        raise InputError(problems)
    dice = Dice(g, torch.device(device))
    out = torch.empty(n, 3, side, side, device=dice.device)
    step = max(1, _AT_ONCE // side**2)  # bounds the memory of the steps between
    for start in range(0, n, step):
        part = out[start : start + step]
        taken = torch.rand(len(part), generator=g) < (photograph_share if photographs else 0)
        crops, made = torch.nonzero(taken)[:, 0], torch.nonzero(~taken)[:, 0]
        if len(made):
            families = HELD_OUT if held_out else FAMILIES
            part[made.to(dice.device)] = _made(dice, families, len(made), side, contrast)
        if photographs and len(crops):
            crop = photographs.draw(dice, len(crops), side)
            mean = crop.mean((-2, -1), keepdim=True)
            amount = _contrasts(dice, len(crops), contrast, faint=0.3)
            part[crops.to(dice.device)] = torch.lerp(mean.expand_as(crop), crop, amount)
    return out


def _contrasts(dice: Dice, n: int, bounds: tuple[float, float], faint: float) -> Tensor:
    """(n, 1, 1, 1) contrasts: a share uniform in the logarithm, the others in the upper half."""
    low, high = bounds
    if high <= 0:
        return torch.zeros(n, 1, 1, 1, device=dice.device)
    least = min(max(low, FAINTEST), high)
    small = dice.log_uniform(least, high, n, 1, 1, 1)
    large = dice.uniform(max(low, 0.5 * high), high, n, 1, 1, 1)
    return torch.where(dice.uniform(0, 1, n, 1, 1, 1) < faint, small, large)


def _made(
    dice: Dice, families: Mapping[str, Family], n: int, side: int, bounds: tuple[float, float]
) -> Tensor:
    """(n, 3, side, side) tiles of patterns in random colours."""
    pattern, mask, other = _combined(dice, families, n, side)
    level = _means(dice, n)
    amount = _contrasts(dice, n, bounds, faint=0.4)
    hue = _hues(dice, n)
    # a power moves the pattern's own middle towards the tile's
    power = (level.log() / math.log(0.5)).clamp(0.35, 2.5)
    first = _painted(dice, pattern[:, None] ** power, hue)
    second = _painted(dice, other[:, None] ** power, hue)
    colour = torch.lerp(first, second, mask[:, None])
    shade = periodic_noise(dice, n, side, 2.5, cycles=4)[:, None]
    shade = shade * dice.uniform(0, 0.3, n, 1, 1, 1) * dice.each_chance(n, 0.4)[:, None]
    colour = (colour * (1 + shade)).clamp(0, 1)
    flat = (level * _tint(dice, n, hue, 0.1)).clamp(0, 1)
    tile = torch.lerp(flat.expand_as(colour), colour, amount)
    return (tile * (1 + _grain(dice, n, side, bounds))).clamp(0, 1)


def _grain(dice: Dice, n: int, side: int, bounds: tuple[float, float]) -> Tensor:
    """(n, 1, side, side) fine noise that most surfaces have, whatever their pattern.

    Without it, what lies between the edges of a pattern is flat, as few things are.
    """
    if bounds[1] <= 0:
        return torch.zeros(n, 1, 1, 1, device=dice.device)
    noise = periodic_noise(dice, n, side, dice.each(n, 0, 1.5))[:, None]
    strength = dice.log_uniform(*GRAIN, n, 1, 1, 1) * bounds[1]
    return noise * strength * dice.each_chance(n, GRAINED)[:, None]


def _combined(
    dice: Dice, families: Mapping[str, Family], n: int, side: int
) -> tuple[Tensor, Tensor, Tensor]:
    """(n, side, side) each, 0..1: a pattern, where a second one shows instead, and that one."""
    pattern = _unit_range(draw_mixed(families, dice, n, side)[0])
    kind = torch.rand(n, generator=dice.g)
    mask, other = torch.zeros_like(pattern), torch.zeros_like(pattern)
    mixed = torch.nonzero(kind < 0.6)[:, 0]
    m = len(mixed)
    if not m:
        return pattern, mask, other
    second = _unit_range(draw_mixed(families, dice, m, side)[0])
    own, kind = mixed.to(dice.device), kind[mixed, None, None].to(dice.device)
    first = pattern[own]
    weight = dice.each(m, 0.1, 1)
    added = _unit_range(first + weight * second)
    product = first * (1 - weight + weight * second)
    pattern[own] = torch.where(kind < 0.15, added, torch.where(kind < 0.3, product, first))
    region = periodic_noise(dice, m, side, dice.each(m, 1.5, 2.5), cycles=side // 8)
    region = edge((region - dice.each(m, -0.5, 1.0)) * dice.each_log(m, 0.5, side / 8))
    # a second pattern inside regions, or the second one choosing between two colourings
    coloured = kind >= 0.45
    mask[own] = torch.where(kind < 0.3, 0.0, torch.where(coloured, second, region))
    other[own] = torch.where(coloured, first, second)
    return pattern, mask, other


def _unit_range(t: Tensor) -> Tensor:
    """Tiles scaled to 0..1; the rarest tones of a long-tailed pattern are cut off."""
    if not len(t):
        return t
    t = standardised(t)
    low, high = t.amin((-2, -1), keepdim=True), t.amax((-2, -1), keepdim=True)
    low, high = low.clamp_min(-3.0), high.clamp_max(3.0)
    return ((t - low) / (high - low).clamp_min(1e-6)).clamp(0, 1)


def _means(dice: Dice, n: int) -> Tensor:
    """(n, 1, 1, 1) brightness of the tiles, dark ones as often as on a logarithmic scale."""
    even, dark = dice.uniform(0.05, 0.95, n, 1, 1, 1), dice.log_uniform(0.03, 0.4, n, 1, 1, 1)
    return torch.where(dice.uniform(0, 1, n, 1, 1, 1) < 0.65, even, dark)


def _hues(dice: Dice, n: int) -> tuple[Tensor, Tensor]:
    """(n, 1, 1, 1) hue in radians and saturation: gray, natural or, rarely, vivid."""
    kind = dice.uniform(0, 1, n, 1, 1, 1)
    natural, vivid = dice.uniform(0.03, 0.35, n, 1, 1, 1), dice.uniform(0.4, 1, n, 1, 1, 1)
    saturation = torch.where(kind < 0.2, 0.0, torch.where(kind < 0.82, natural, vivid))
    # reds to yellows and blues are more common in the world than violets
    common = torch.where(dice.uniform(0, 1, n, 1, 1, 1) < 0.7, 0.5, 3.9)
    near = common + 0.5 * dice.normal(n, 1, 1, 1)
    hue = torch.where(kind < 0.6, near, dice.uniform(0, 2 * math.pi, n, 1, 1, 1))
    return hue, saturation


def _tint(dice: Dice, n: int, hue: tuple[Tensor, Tensor], spread: float) -> Tensor:
    """(n, 3, 1, 1) factors of the channels, of mean 1, near a hue."""
    angle = hue[0] + spread * dice.normal(n, 1, 1, 1)
    channels = torch.arange(3, device=dice.device).view(1, 3, 1, 1) * (2 * math.pi / 3)
    return 1 + hue[1] * torch.cos(angle - channels) * dice.uniform(0.5, 1.2, n, 1, 1, 1)


def _painted(dice: Dice, pattern: Tensor, hue: tuple[Tensor, Tensor]) -> Tensor:
    """(n, 3, H, W): a pattern (n, 1, H, W) in 0..1 as a way between three colours."""
    n = len(pattern)
    # alike hues for most; all over the circle for some
    spread = torch.where(dice.uniform(0, 1, n, 1, 1, 1) < 0.75, 0.0, 1.0)
    hues = [(hue[0] + spread * dice.uniform(-2, 2, n, 1, 1, 1), hue[1]) for _ in range(3)]
    levels = (
        dice.uniform(0, 0.12, n, 1, 1, 1),
        dice.uniform(0.35, 0.65, n, 1, 1, 1),
        dice.uniform(0.85, 1, n, 1, 1, 1),
    )
    dark, middle, bright = (
        (level * _tint(dice, n, h, 0.25)).clamp(0, 1) for level, h in zip(levels, hues, strict=True)
    )
    upper, lower = (2 * pattern - 1).clamp(0, 1), (1 - 2 * pattern).clamp(0, 1)
    turned = dice.uniform(0, 1, n, 1, 1, 1) < 0.35
    ends = torch.where(turned, bright, dark), torch.where(turned, dark, bright)
    painted: Tensor = middle + (ends[0] - middle) * lower + (ends[1] - middle) * upper
    return painted
