"""What textures and silhouettes are drawn with: random numbers, periodic noise, stamps.

A family draws n scalar tiles of (n, side, side). x counts texels to the right, y downwards;
a number per tile has the shape (n, 1, 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from epinet.synth.dice import Dice

_WINDOWS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)
_ENTRIES_AT_ONCE = 1 << 22


Draw = Callable[[Dice, int, int], Tensor]
"""(dice, n, side) -> (n, side, side)."""


@dataclass(frozen=True)
class Family:
    """One kind of tile."""

    weight: float
    """How often it is drawn, relative to the others of its mapping."""
    draw: Draw
    wraps: bool = True
    """Whether the tiles continue seamlessly across their borders."""


def draw_mixed(
    families: Mapping[str, Family], dice: Dice, n: int, side: int
) -> tuple[Tensor, Tensor]:
    """(n, side, side) float32 tiles of families drawn by weight, and (n,) which family each is."""
    members = list(families.values())
    weights = torch.tensor([f.weight for f in members])
    choice = torch.multinomial(weights, n, replacement=True, generator=dice.g) if n else None
    out = torch.empty(n, side, side, device=dice.device)
    if choice is None:
        return out, torch.empty(0, dtype=torch.long)
    for k, family in enumerate(members):
        chosen = torch.nonzero(choice == k)[:, 0]
        if len(chosen):
            out[chosen.to(dice.device)] = family.draw(dice, len(chosen), side).float()
    return out, choice


def grid(dice: Dice, side: int) -> tuple[Tensor, Tensor]:
    """(side, side) x and y in texels, of the texels' centres."""
    t = torch.arange(side, device=dice.device) + 0.5
    return t.expand(side, side), t[:, None].expand(side, side)


def centred_grid(dice: Dice, n: int, side: int) -> tuple[Tensor, Tensor]:
    """(n, side, side) x and y in texels from the tile's centre, each tile turned at random."""
    x, y = grid(dice, side)
    x, y = x - side / 2, y - side / 2
    angle = dice.each(n, 0, 2 * math.pi)
    return x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin()


def standardised(t: Tensor) -> Tensor:
    """Tiles shifted and scaled to mean 0 and deviation 1."""
    t = t - t.mean((-2, -1), keepdim=True)
    return t / t.std((-2, -1), keepdim=True).clamp_min(1e-6)


def periodic_noise(
    dice: Dice,
    n: int,
    side: int,
    slope: float | Tensor,
    *,
    cycles: int | None = None,
    stretch: float | Tensor = 1.0,
    shape: Callable[[Tensor], Tensor] | None = None,
) -> Tensor:
    """(n, side, side) seamless Gaussian noise of mean 0, deviation 1.

    Args:
        slope: the amplitude falls as frequency ** -slope.
        cycles: the highest frequency, cycles per tile; to the Nyquist frequency by default.
        stretch: features are this much longer than wide, in a random direction.
        shape: amplitude for (n, rows, columns) frequencies in cycles per tile, in place of slope.
    """
    half = max(2, min(cycles or side // 2, side // 2))
    right = torch.arange(half, device=dice.device).float()
    down = torch.cat([right, right - half])[:, None]
    angle = dice.each(n, 0, math.pi)
    along = right * angle.cos() + down * angle.sin()
    across = down * angle.cos() - right * angle.sin()
    frequency = torch.hypot(along * stretch, across).clamp_min(1.0)
    amplitude = shape(frequency) if shape else frequency**-slope
    amplitude = amplitude * (torch.hypot(right, down) > 0)
    drawn = torch.view_as_complex(dice.normal(n, 2 * half, half, 2)) * amplitude
    spectrum = torch.zeros(n, side, side // 2 + 1, dtype=torch.complex64, device=dice.device)
    spectrum[:, :half, :half] = drawn[:, :half]
    spectrum[:, -half:, :half] = drawn[:, half:]
    return standardised(torch.fft.irfft2(spectrum, s=(side, side)))


def lookup(table: Tensor, *index: Tensor) -> Tensor:
    """Entries of each tile's own table (n, rows, ...) at integer positions (n, H, W)."""
    tile = torch.arange(len(table), device=table.device)[:, None, None]
    out: Tensor = table[(tile, *index)]
    return out


def edge(distance: Tensor) -> Tensor:
    """Coverage 0..1 at a signed distance in texels, positive inside: one texel wide."""
    return (distance + 0.5).clamp(0, 1)


def wrapped(difference: Tensor, period: float | Tensor) -> Tensor:
    """The shortest difference of two positions on a circle of a period."""
    return difference - period * torch.round(difference / period)


Stamp = Callable[[Tensor, Tensor, Tensor], Tensor]
"""(dx, dy, which) -> values: (m, K, K) texels from the m shapes' centres, (m,) which shapes."""


def stamp(
    n: int, side: int, tile: Tensor, x: Tensor, y: Tensor, reach: Tensor, field: Stamp, floor: float
) -> Tensor:
    """(n, side, side) greatest value of many small shapes, each evaluated near itself only.

    Args:
        tile, x, y: (m,) tile and centre in texels of each shape; shapes wrap around.
        reach: (m,) distance in texels beyond which a shape has no value above `floor`.
        floor: value where no shape lies.
    """
    out = torch.full((n * side * side,), floor, device=x.device)
    smallest = 0
    for window in _WINDOWS:
        last = window == _WINDOWS[-1]
        fits = (2 * reach > smallest) & ((2 * reach <= window) | last)
        smallest = window
        chosen = torch.nonzero(fits)[:, 0]
        step = max(1, _ENTRIES_AT_ONCE // window**2)
        for k in range(0, len(chosen), step):
            _stamp_window(out, side, tile, x, y, window, field, chosen[k : k + step])
    return out.view(n, side, side)


def _stamp_window(
    out: Tensor,
    side: int,
    tile: Tensor,
    x: Tensor,
    y: Tensor,
    window: int,
    field: Stamp,
    which: Tensor,
) -> None:
    offset = torch.arange(window, device=x.device) - window // 2
    i = torch.round(x[which]).long()[:, None] + offset
    j = torch.round(y[which]).long()[:, None] + offset
    dx = (i + 0.5 - x[which, None])[:, None, :]
    dy = (j + 0.5 - y[which, None])[:, :, None]
    values = field(dx, dy, which)
    row = (tile[which, None] * side + j % side) * side
    index = row[:, :, None] + (i % side)[:, None, :]
    out.scatter_reduce_(0, index.flatten(), values.expand(index.shape).flatten(), "amax")


def strokes(n: int, side: int, tile: Tensor, x: Tensor, y: Tensor, radius: Tensor) -> Tensor:
    """(n, side, side) signed distance in texels, at least -1, to paths given by dense points.

    Args:
        tile: (m,) tile of each path.
        x, y, radius: (m, points) in texels; points closer than the radius give a smooth border.
    """
    points = x.shape[1]
    r = radius.expand(x.shape).flatten()

    def disc(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        return r[which, None, None] - torch.hypot(dx, dy)

    # radius + 1 around a centre up to half a texel away from the window's
    reach = r + 1.5
    flat = tile[:, None].expand(-1, points).flatten()
    return stamp(n, side, flat, x.flatten(), y.flatten(), reach, disc, -1.0)


def walks(
    dice: Dice, m: int, points: int, start: Tensor, bend: Tensor, wiggle: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """x, y, heading, (m, points) each: smooth curves of unit length from the origin.

    Args:
        start: (m, 1) heading at the beginning, radians.
        bend: (m, 1) how far the heading turns over the whole length.
        wiggle: (m, 1) amplitude in radians of slow swings of the heading.
    """
    t = torch.linspace(0, 1, points, device=dice.device)
    heading = start + bend * t
    for k in range(1, 5):
        phase = dice.uniform(0, 2 * math.pi, m, 1)
        heading = heading + wiggle * torch.sin(math.pi * k * t + phase) / k
    step = 1 / points
    return (heading.cos() * step).cumsum(1), (heading.sin() * step).cumsum(1), heading
