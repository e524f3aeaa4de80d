"""Texture families without shapes: noise of many spectra, and what is made from it."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.tiles import centred_grid, grid, lookup, periodic_noise


def noise(dice: Dice, n: int, side: int) -> Tensor:
    """Spectra from white to very smooth."""
    return periodic_noise(dice, n, side, dice.each(n, 0, 3))


def brushed(dice: Dice, n: int, side: int) -> Tensor:
    """Noise drawn out in one direction: brushed metal, plaster, fur."""
    return periodic_noise(dice, n, side, dice.each(n, 0.3, 1.8), stretch=dice.each_log(n, 3, 60))


def patches(dice: Dice, n: int, side: int) -> Tensor:
    """A few flat tones with sharp irregular borders."""
    level = torch.round(
        periodic_noise(dice, n, side, dice.each(n, 1.2, 2.6)) * dice.each_log(n, 0.6, 3)
    )
    tones = dice.uniform(0, 1, n, 64)
    return lookup(tones, level.long().clamp(-31, 31) + 31)


def speckle(dice: Dice, n: int, side: int) -> Tensor:
    """Granite and gravel: grains of one size, dark or bright on a plainer ground."""
    size = dice.each_log(n, 2, 12)
    middle = side / size
    grains = periodic_noise(
        dice, n, side, 0.0, shape=lambda f: torch.exp(-((f / middle - 0.5) ** 2) * 8)
    )
    threshold = dice.each(n, 0.7, 2.0)
    ground = 0.3 * dice.each(n, 0, 1) * periodic_noise(dice, n, side, dice.each(n, 0.5, 1.5))
    sharp = dice.each_log(n, 2, 12)
    return torch.tanh((grains - threshold) * sharp) + ground


def marble(dice: Dice, n: int, side: int) -> Tensor:
    """Veins: plane waves bent by turbulence."""
    x, y = grid(dice, side)
    across, down = dice.integers(-4, 4, n, 1, 1), dice.integers(1, 5, n, 1, 1)
    bent = periodic_noise(dice, n, side, dice.each(n, 1.5, 2.3)) * dice.each(n, 0.2, 1.0)
    wave = torch.sin(2 * math.pi * ((across * x + down * y) / side + bent))
    veins = wave.abs() ** dice.each_log(n, 0.2, 1.5)
    return torch.where(dice.each_chance(n, 0.6), veins, wave)


def turbulence(dice: Dice, n: int, side: int) -> Tensor:
    """Creases: the absolute value of noise, several octaves of it."""
    low = periodic_noise(dice, n, side, dice.each(n, 1.5, 2.5), cycles=max(4, side // 16)).abs()
    high = periodic_noise(dice, n, side, dice.each(n, 1.0, 2.0)).abs()
    return (low + dice.each(n, 0, 0.8) * high) ** dice.each_log(n, 0.4, 1.5)


def wood(dice: Dice, n: int, side: int) -> Tensor:
    """Growth rings bent by drawn-out noise, fine grain along them; planks in a part of them."""
    x, y = grid(dice, side)
    upright = dice.each_chance(n, 0.5)
    along, across = torch.where(upright, y, x), torch.where(upright, x, y)
    board = torch.where(dice.each_chance(n, 0.5), dice.each_count(n, 2, 8), 1)
    index = (across * board / side).floor().long()
    shift = lookup(dice.uniform(0, 1, n, 8), index)
    bend = torch.zeros(n, side, side, device=dice.device)
    for k in (1, 2, 3):
        phase, other = dice.each(n, 0, 6.3), dice.each(n, 0, 6.3)
        bend = (
            bend
            + torch.sin(2 * math.pi * (k * along / side + shift) + phase)
            * torch.sin(2 * math.pi * across / side + other * k)
            / k
        )
    rings = dice.each_count(n, 3, max(4, side // 8)) * across / side
    ring = torch.remainder(rings + bend * dice.each_log(n, 0.1, 2) + shift * 7, 1)
    grain = periodic_noise(dice, n, side, 0.3, stretch=1.0, cycles=side // 2)
    grain = (grain + _shifted_sum(grain, upright)) / 2
    gap = (torch.remainder(across * board / side, 1) * side / board < 1.5) & (board > 1)
    tone = ring + dice.each(n, 0, 0.4) * grain + dice.each(n, 0, 0.8) * shift
    return torch.where(gap, tone.amin((-2, -1), keepdim=True), tone)


def _shifted_sum(t: Tensor, upright: Tensor) -> Tensor:
    """Noise smeared over 15 texels along the grain, wrapping around."""
    down = sum((t.roll(k, 1) for k in range(15)), torch.zeros_like(t))
    right = sum((t.roll(k, 2) for k in range(15)), torch.zeros_like(t))
    return torch.where(upright, down, right) / math.sqrt(15)


def gradients(dice: Dice, n: int, side: int) -> Tensor:
    """Slow changes only: a linear, a round or an irregular ramp."""
    u, v = centred_grid(dice, n, side)
    u = u / side - dice.each(n, -0.4, 0.4)
    v = v / side - dice.each(n, -0.4, 0.4)
    irregular = 0.2 * periodic_noise(dice, n, side, dice.each(n, 2.5, 3.5))
    kind = dice.integers(0, 2, n, 1, 1)
    ramp = torch.where(kind == 0, u, torch.hypot(u, v))
    return torch.where(kind == 2, irregular, ramp)


def labyrinth(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Winding bands of one width, like a zebra's or a fingerprint's."""
    middle = side / dice.each_log(n, 4, 30)
    width = dice.each(n, 0.08, 0.25)
    bands = periodic_noise(
        dice, n, side, 0.0, shape=lambda f: torch.exp(-(((f / middle - 1) / width) ** 2))
    )
    return torch.tanh((bands + dice.each(n, -0.5, 0.5)) * dice.each_log(n, 0.7, 12))


def ripples(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Rings around a few centres that add up."""
    x, y = grid(dice, side)
    total = torch.zeros(n, side, side, device=dice.device)
    for _ in range(3):
        du, dv = x - dice.each(n, 0, side), y - dice.each(n, 0, side)
        period = dice.each_log(n, 3, side / 4)
        total = total + dice.each(n, 0, 1) * torch.sin(2 * math.pi * torch.hypot(du, dv) / period)
    return total
