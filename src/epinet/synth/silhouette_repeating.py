"""Silhouettes that wrap around seamlessly: signed distances in texels, positive on surface."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.silhouette_thin import radius
from epinet.synth.texture_scattered import leaf_distance
from epinet.synth.tiles import grid, lookup, periodic_noise, stamp, strokes, walks, wrapped


def along_axis(dice: Dice, n: int, side: int) -> tuple[Tensor, Tensor]:
    """(n, side, side) x and y of each tile, swapped in half of them."""
    x, y = grid(dice, side)
    swapped = dice.each_chance(n, 0.5)
    return torch.where(swapped, y, x), torch.where(swapped, x, y)


def slope_of(t: Tensor) -> Tensor:
    """(n, H, W) how fast a seamless tile changes, per texel."""
    dx = (t.roll(-1, 2) - t.roll(1, 2)) / 2
    dy = (t.roll(-1, 1) - t.roll(1, 1)) / 2
    return torch.hypot(dx, dy)


def _pitch(dice: Dice, n: int, side: int, r: Tensor, widest: float) -> Tensor:
    """(n, 1, 1) texels from one thin bar to the next, a whole number of times in a side."""
    gap = dice.each_log(n, 8, widest)
    return side / (side / (2 * r + gap)).round().clamp_min(1)


def fences(dice: Dice, n: int, side: int) -> Tensor:
    """Upright bars, even or uneven, with one to three rails across in a part of them."""
    u, v = along_axis(dice, n, side)
    r = radius(dice, n)
    pitch = _pitch(dice, n, side, r, side / 4)
    index = (u / pitch).floor().long()
    shift = lookup(dice.uniform(-1, 1, n, side), index) * dice.each_chance(n, 0.4)
    room = (pitch / 2 - r - 1).clamp_min(0) * dice.each(n, 0, 1)
    bars = r - (torch.remainder(u, pitch) - pitch / 2 - shift * room).abs()
    rails = torch.full_like(bars, -1.0)
    count = dice.integers(0, 3, n, 1, 1)
    for k in range(3):
        rail = radius(dice, n) - wrapped(v - dice.each(n, 0, side), side).abs()
        rails = torch.where(k < count, torch.maximum(rails, rail), rails)
    return torch.maximum(bars, rails)


def grids(dice: Dice, n: int, side: int) -> Tensor:
    """Square and oblong meshes."""
    u, v = along_axis(dice, n, side)
    r = radius(dice, n)
    first = _pitch(dice, n, side, r, side / 4)
    second = torch.where(dice.each_chance(n, 0.5), first, _pitch(dice, n, side, r, side / 2))
    other = torch.where(dice.each_chance(n, 0.6), r, radius(dice, n))
    other = torch.minimum(other, second / 4)
    return torch.maximum(r - wrapped(u, first).abs(), other - wrapped(v, second).abs())


def nets(dice: Dice, n: int, side: int) -> Tensor:
    """Diagonal meshes, stretched and pulled out of shape."""
    x, y = grid(dice, side)
    r = radius(dice, n)
    right = (side / _pitch(dice, n, side, r, side / 5)).round()
    down = (right * dice.each_log(n, 0.4, 1.5)).round().clamp_min(1)
    period = side / torch.hypot(right, down)
    warp = [periodic_noise(dice, n, side, 3.0, cycles=8) for _ in range(2)]
    pulled = dice.each(n, 0, 0.5) * dice.each_chance(n, 0.6)
    threads = []
    for sign, bent in zip((1, -1), warp, strict=True):
        phase = (right * x + sign * down * y) / side + pulled * bent
        # meshes pulled together stay open
        threads.append(torch.minimum(r, period / 8) - wrapped(phase, 1.0).abs() * period)
    return torch.maximum(*threads)


def cables(dice: Dice, n: int, side: int) -> Tensor:
    """Wires across the whole tile, straight to wavy."""
    u, v = along_axis(dice, n, side)
    r, count = radius(dice, n), dice.integers(2, 9, n, 1, 1)
    amplitude = dice.each_log(n, 0.002, 0.12) * side
    turn = 2 * math.pi / side
    out = torch.full_like(u, -1.0)
    for k in range(9):
        height, slope = dice.each(n, 0, side), torch.zeros_like(u)
        for cycles in (1, 2, 3):
            phase, swing = dice.each(n, 0, 6.3), amplitude * dice.each(n, 0, 1) / cycles
            height = height + swing * torch.sin(turn * cycles * u + phase)
            slope = slope + swing * turn * cycles * torch.cos(turn * cycles * u + phase)
        wire = r - wrapped(v - height, side).abs() / torch.hypot(slope, torch.ones_like(slope))
        out = torch.where(k < count, torch.maximum(out, wire), out)
    return out


def perforated(dice: Dice, n: int, side: int) -> Tensor:
    """Sheets with so many round or square holes that thin webs remain."""
    x, y = grid(dice, side)
    web = 2 * radius(dice, n)
    gap = torch.maximum(dice.each_log(n, 8, side / 6), 2 * web)
    pitch = side / (side / (web + gap) / 2).floor().clamp_min(1) / 2
    shift = 0.5 * pitch * dice.each_chance(n, 0.5) * ((y / pitch).floor().long() % 2)
    u, v = torch.remainder(x + shift, pitch) - pitch / 2, torch.remainder(y, pitch) - pitch / 2
    square = torch.maximum(u.abs(), v.abs())
    hole = torch.where(dice.each_chance(n, 0.4), square, torch.hypot(u, v))
    return hole - (pitch - web) / 2


def brambles(dice: Dice, n: int, side: int) -> Tensor:
    """Stalks and hairs scattered in all directions."""
    many, points = 24, side
    m = n * many
    main, spread = dice.uniform(0, 6.3, n, 1), dice.log_uniform(0.1, 3, n, 1)
    heading = (main + spread * dice.normal(n, many)).view(m, 1)
    bend = dice.uniform(0, 2, n, 1).repeat_interleave(many, 0) * dice.normal(m, 1)
    x, y, _ = walks(dice, m, points, heading, bend, dice.uniform(0, 0.6, m, 1))
    length = side * dice.uniform(0.2, 0.8, m, 1)
    x = x * length + dice.uniform(0, side, m, 1)
    y = y * length + dice.uniform(0, side, m, 1)
    r = (radius(dice, n)[..., 0] * dice.uniform(0.5, 1, n, many)).clamp_min(0.55).view(m, 1)
    taken = torch.arange(many, device=dice.device) < dice.integers(5, many, n, 1)
    shown = taken.flatten()
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    return strokes(n, side, tile[shown], x[shown], y[shown], r[shown])


def scattered_sizes(dice: Dice, n: int, side: int, many: int) -> tuple[Tensor, Tensor]:
    """(n * many,) sizes in texels, and which of the things show so that gaps remain."""
    share = dice.uniform(0.15, 1.3, n, 1)
    size = dice.log_uniform(side / 45, side / 8, n, 1)
    # as many as cover the share of the tile, did they not overlap
    count = (share * side**2 / (math.pi * size**2)).clamp(6, many)
    shown = torch.arange(many, device=dice.device) < count
    return (size * dice.uniform(0.6, 1.2, n, many)).flatten(), shown.flatten()


def leaf_clutter(dice: Dice, n: int, side: int) -> Tensor:
    """Leaves scattered sparsely to densely, of all directions or one."""
    many = 220
    size, shown = scattered_sizes(dice, n, side, many)
    length = 1.3 * size
    slim = dice.uniform(0.15, 0.65, n, 1) * dice.uniform(0.8, 1.2, n, many)
    angle = dice.uniform(0, 6.3, n, 1) + dice.log_uniform(0.2, 4, n, 1) * dice.normal(n, many)
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    x, y = dice.uniform(0, side, 2, n * many)
    parts = [t[shown] for t in (length, length * slim.flatten(), angle.flatten())]

    def leaf(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        return leaf_distance(dx, dy, *(t[which, None, None] for t in parts))[0]

    return stamp(n, side, tile[shown], x[shown], y[shown], parts[0] + 1, leaf, -1.0)


def spots(dice: Dice, n: int, side: int) -> Tensor:
    """Discs and ellipses scattered sparsely to densely."""
    many = 220
    size, shown = scattered_sizes(dice, n, side, many)
    flat = torch.where(dice.uniform(0, 1, n, 1) < 0.5, 1.0, dice.uniform(0.3, 1, n, 1))
    aspect = flat.expand(n, many).flatten()[shown]
    angle = dice.uniform(0, 6.3, n * many)[shown]
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    x, y = dice.uniform(0, side, 2, n * many)
    r = size[shown]

    def disc(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        own, turn, narrow = (t[which, None, None] for t in (r, angle, aspect))
        u, v = dx * turn.cos() + dy * turn.sin(), dy * turn.cos() - dx * turn.sin()
        return (own - torch.hypot(u, v / narrow)) * narrow

    return stamp(n, side, tile[shown], x[shown], y[shown], r + 1, disc, -1.0)


def shards(dice: Dice, n: int, side: int) -> Tensor:
    """Convex polygons scattered sparsely to densely."""
    many = 220
    size, shown = scattered_sizes(dice, n, side, many)
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    x, y = dice.uniform(0, side, 2, n * many)
    corners = dice.integers(3, 6, n * many)[shown].float()
    ragged, start = dice.uniform(0.5, 1, n * many, 6)[shown], dice.uniform(0, 6.3, n * many)[shown]
    r = size[shown]

    def polygon(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        inside = r[which, None, None] - torch.hypot(dx, dy)
        for k in range(6):
            # the sixth side of a triangle falls on its third
            angle = start[which] + 2 * math.pi * (k % corners[which]) / corners[which]
            depth = r[which] * 0.8 * ragged[which, k]
            side_k = depth[:, None, None] - (
                dx * angle.cos()[:, None, None] + dy * angle.sin()[:, None, None]
            )
            inside = torch.minimum(inside, side_k)
        return inside

    return stamp(n, side, tile[shown], x[shown], y[shown], r + 1, polygon, -1.0)


def camouflage(dice: Dice, n: int, side: int) -> Tensor:
    """Level sets of noise."""
    noise = periodic_noise(dice, n, side, dice.each(n, 1.6, 3.4), cycles=side // 8)
    return (noise - dice.each(n, -0.8, 0.8)) / slope_of(noise).clamp_min(0.01)


def boards(dice: Dice, n: int, side: int) -> Tensor:
    """Large checkerboards, square or oblong fields."""
    x, y = grid(dice, side)
    columns, rows = dice.each_count(n, 1, 7), dice.each_count(n, 1, 7)
    u = wrapped(x * columns / side, 1.0).abs() - 0.25
    v = wrapped(y * rows / side, 1.0).abs() - 0.25
    nearer = torch.minimum(u.abs() * side / columns, v.abs() * side / rows)
    return torch.where((u > 0) == (v > 0), nearer, -nearer)


def slats(dice: Dice, n: int, side: int) -> Tensor:
    """Broad boards with gaps, each of its own width."""
    u, _ = along_axis(dice, n, side)
    count = dice.each_count(n, 2, 12)
    pitch = side / count
    index = (u / pitch).floor().long()
    half = (
        0.5
        * dice.each(n, 0.3, 0.85)
        * (1 - dice.each(n, 0, 0.4) * lookup(dice.uniform(0, 1, n, 12), index))
    )
    return (half - (torch.remainder(u / pitch, 1) - 0.5).abs()) * pitch
