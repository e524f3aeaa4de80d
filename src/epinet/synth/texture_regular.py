"""Texture families on a lattice: stripes, checks, bricks, cells, cloth, and exact repetition."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.tiles import edge, grid, lookup, periodic_noise, wrapped


def _phase(dice: Dice, n: int, side: int, longest: float = 1.0) -> tuple[Tensor, Tensor]:
    """(n, side, side) phase in cycles of a seamless plane wave, (n, 1, 1) its period in texels.

    Periods go from 2 texels to `longest` of the tile; the direction is random, but along an axis
    for one wave in three.
    """
    x, y = grid(dice, side)
    count = side / dice.each_log(n, 2, max(2.5, side * longest))
    angle = dice.each(n, 0, 2 * math.pi)
    angle = torch.where(dice.each_chance(n, 0.35), torch.round(angle / 1.5708) * 1.5708, angle)
    right, down = torch.round(count * angle.cos()), torch.round(count * angle.sin())
    right = torch.where((right == 0) & (down == 0), 1.0, right)
    period = side / torch.hypot(right, down)
    return (right * x + down * y) / side + dice.each(n, 0, 1), period


def _profile(dice: Dice, n: int, phase: Tensor, period: Tensor) -> Tensor:
    """0..1 wave: a sine, a hard bar of any width, or a ramp."""
    sine = 0.5 + 0.5 * torch.sin(2 * math.pi * phase)
    within = wrapped(phase, 1.0).abs()
    bar = edge((0.5 * dice.each(n, 0.15, 0.85) - within) * period)
    ramp = torch.remainder(phase, 1)
    kind = dice.uniform(0, 1, n, 1, 1)
    # a ramp of few texels would be no ramp
    return torch.where(kind < 0.4, sine, torch.where((kind < 0.85) | (period < 6), bar, ramp))


def stripes(dice: Dice, n: int, side: int) -> Tensor:
    """Parallel stripes of every period, straight or bent a little."""
    phase, period = _phase(dice, n, side)
    bend = periodic_noise(dice, n, side, 2.5, cycles=6) * dice.each(n, 0, 0.6)
    phase = torch.where(dice.each_chance(n, 0.25) & (period > 6), phase + bend, phase)
    return _profile(dice, n, phase, period)


def checks(dice: Dice, n: int, side: int) -> Tensor:
    """Two sets of stripes: a checkerboard, gingham, or a product of waves."""
    first, period = _phase(dice, n, side, 0.5)
    x, y = grid(dice, side)
    # the other set runs across the first: its wave numbers are swapped
    columns = torch.round((first[:, :1, -1:] - first[:, :1, :1]) * side / (side - 1))
    rows = torch.round((first[:, -1:, :1] - first[:, :1, :1]) * side / (side - 1))
    second = (rows * x - columns * y) / side + dice.each(n, 0, 1)
    a, b = _profile(dice, n, first, period), _profile(dice, n, second, period)
    hard_a = edge((0.25 - wrapped(first, 1.0).abs()) * period)
    hard_b = edge((0.25 - wrapped(second, 1.0).abs()) * period)
    board = hard_a + hard_b - 2 * hard_a * hard_b
    kind = dice.integers(0, 2, n, 1, 1)
    return torch.where(kind == 0, board, torch.where(kind == 1, a + b, a * b))


def barcodes(dice: Dice, n: int, side: int) -> Tensor:
    """Lines of random widths and tones along one axis, or along both (tartan)."""
    x, y = grid(dice, side)
    lines: list[Tensor] = []
    for coordinate in (x, y):
        count = dice.each_count(n, 3, side // 3)
        cuts = dice.uniform(0, 1, n, 1, side) * 0.9 + torch.arange(side, device=dice.device)
        cell = (coordinate[0] if coordinate is x else coordinate[:, 0]) * count[..., 0] / side
        index = cell.floor().long()
        moved = index - (cell < cuts[:, 0].gather(1, index)).long()
        tones = dice.uniform(0, 1, n, side)
        profile = tones.gather(1, torch.remainder(moved, count[..., 0]))
        lines.append(profile[:, None, :] if coordinate is x else profile[:, :, None])
    kind = dice.uniform(0, 1, n, 1, 1)
    right, down = lines
    one = torch.where(kind < 0.25, right + 0 * down, down + 0 * right)
    return torch.where(kind < 0.5, one, right + down)


def repeats(dice: Dice, n: int, side: int) -> Tensor:
    """A small random motif, again and again: exactly periodic, texel by texel.

    The motif's width and height are divisors of the tile's side, 2 texels to half a tile.
    """
    sizes = [d for d in range(2, side // 2 + 1) if side % d == 0] or [side]
    out = torch.empty(n, side, side, device=dice.device)
    for k in range(n):
        height, width = (sizes[int(i)] for i in torch.randint(len(sizes), (2,), generator=dice.g))
        motif = dice.uniform(0, 1, height, width)
        kind = int(torch.randint(4, (1,), generator=dice.g))
        if kind == 1:  # black and white
            motif = (motif > dice.uniform(0.2, 0.8, 1)).float()
            # texels that all fell on one side would leave the tile flat
            motif[0, 0], motif[-1, -1] = 0, 1
        elif kind == 2:  # smooth
            full = periodic_noise(dice, 1, max(height, width, 4), 1.5)[0]
            motif = full[:height, :width]
        elif kind == 3:  # blocks of a quarter
            coarse = dice.uniform(0, 1, 4, 4)
            rows = torch.arange(height, device=dice.device) * 4 // height
            motif = coarse[rows][:, torch.arange(width, device=dice.device) * 4 // width]
        out[k] = motif.repeat(side // height, side // width)
    return out


def bricks(dice: Dice, n: int, side: int) -> Tensor:
    """Bricks, tiles and planks between joints of mortar."""
    x, y = grid(dice, side)
    upright = dice.each_chance(n, 0.3)
    x, y = torch.where(upright, y, x), torch.where(upright, x, y)
    rows = 2 * dice.each_count(n, 1, side // 12)
    columns = (rows / dice.each_log(n, 0.8, 4)).round().clamp(1, side / 6).long()
    v = y * rows / side
    row = v.floor().long()
    shift = torch.where(dice.each_chance(n, 0.6), 0.5, 0.0) * (row % 2)
    random_shift = lookup(dice.uniform(0, 1, n, side), row)
    u = x * columns / side + torch.where(dice.each_chance(n, 0.2), random_shift, shift)
    column = torch.remainder(u.floor().long(), columns)
    to_joint = torch.minimum(
        wrapped(u, 1.0).abs() * side / columns, wrapped(v, 1.0).abs() * side / rows
    )
    joint = edge(to_joint - dice.each_log(n, 0.5, 4))
    tone = lookup(dice.uniform(0, 1, n, side, side // 4 + 1), row, column)
    spread = dice.each(n, 0, 0.6)
    rough = 0.1 * dice.each(n, 0, 1) * periodic_noise(dice, n, side, dice.each(n, 0.3, 1.5))
    return joint * (1 - spread + spread * tone + rough)


def nearest_points(
    dice: Dice, n: int, u: Tensor, v: Tensor, count: Tensor, jitter: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Distances to the two nearest points of a jittered lattice, and the nearest one's tone.

    u, v: (n, H, W) in cells of the lattice, which wraps after `count` cells.
    """
    size = int(count.max())
    points = dice.uniform(0, 1, n, size, size, 3)
    first = torch.full_like(u, math.inf)
    second, tone = first.clone(), torch.zeros_like(u)
    i, j = u.floor().long(), v.floor().long()
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            column, row = i + right, j + down
            point = lookup(points, row % count, column % count)
            du = column + 0.5 + jitter * (point[..., 0] - 0.5) - u
            dv = row + 0.5 + jitter * (point[..., 1] - 0.5) - v
            distance = torch.hypot(du, dv)
            closer = distance < first
            second = torch.where(closer, first, torch.minimum(second, distance))
            first = torch.where(closer, distance, first)
            tone = torch.where(closer, point[..., 2], tone)
    return first, second, tone


def cells(dice: Dice, n: int, side: int) -> Tensor:
    """Irregular cells: flat tones, dark joints (cobbles, cracked mud), or domed ones."""
    x, y = grid(dice, side)
    count = dice.each_count(n, 4, side // 4)
    bend = dice.each(n, 0, 0.35) * dice.each_chance(n, 0.5)
    u = x * count / side + bend * periodic_noise(dice, n, side, 1.8)
    v = y * count / side + bend * periodic_noise(dice, n, side, 1.8)
    first, second, tone = nearest_points(dice, n, u, v, count, dice.each(n, 0.4, 1.0))
    joint = edge((second - first) * side / count / 2 - dice.each_log(n, 0.5, 3))
    kind = dice.integers(0, 2, n, 1, 1)
    domed = 1 - first**2 + 0.4 * tone
    return torch.where(kind == 0, tone, torch.where(kind == 1, joint * (0.4 + tone), domed))


def weave(dice: Dice, n: int, side: int) -> Tensor:
    """Cloth: rounded threads going over and under each other, plain, twill or basket."""
    x, y = grid(dice, side)
    threads = dice.each_count(n, max(2, side // 64), side // 12) * 4
    u, v = x * threads / side, y * threads / side
    i, j = u.floor().long(), v.floor().long()
    over = dice.integers(1, 2, n, 1, 1)
    twill = torch.remainder(i + j, 4) < 2
    plain = torch.remainder(i // over + j // over, 2) == 0
    warp_on_top = torch.where(dice.each_chance(n, 0.4), twill, plain)
    round_u = torch.cos(math.pi * wrapped(u - 0.5, 1.0))
    round_v = torch.cos(math.pi * wrapped(v - 0.5, 1.0))
    tone = dice.uniform(0, 1, n, 2, 4 * (side // 12 + 1))
    spread = dice.each(n, 0, 0.5)
    top = torch.where(
        warp_on_top,
        round_u * (1 + spread * lookup(tone[:, 0], i)),
        round_v * (dice.each(n, 0.4, 1) + spread * lookup(tone[:, 1], j)),
    )
    fuzz = dice.each(n, 0, 0.25) * periodic_noise(dice, n, side, 0.5)
    return top + fuzz


def hexagons(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Six-sided tiles between joints."""
    x, y = grid(dice, side)
    rows = 2 * dice.each_count(n, 1, side // 16)
    columns = (rows * math.sqrt(3) / 2).round().clamp_min(1).long()
    u, v = x * columns / side, y * rows / side
    first = torch.full((n, side, side), math.inf, device=dice.device)
    second, tone = first.clone(), torch.zeros_like(first)
    tones = dice.uniform(0, 1, n, int(rows.max()), int(columns.max()))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            row = v.floor().long() + down
            shift = 0.5 * (row % 2)
            column = (u - shift).floor().long() + right
            du, dv = column + shift + 0.5 - u, (row + 0.5 - v) * math.sqrt(3) / 2
            distance = torch.hypot(du, dv)
            closer = distance < first
            second = torch.where(closer, first, torch.minimum(second, distance))
            first = torch.where(closer, distance, first)
            tone = torch.where(closer, lookup(tones, row % rows, column % columns), tone)
    joint = edge((second - first) * side / columns / 2 - dice.each_log(n, 0.5, 3))
    return joint * (1 - dice.each(n, 0, 1) * tone)


def chevrons(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Zigzag stripes."""
    x, y = grid(dice, side)
    folds, rows = dice.each_count(n, 1, side // 16), dice.each_count(n, 2, side // 4)
    zigzag = 2 * wrapped(x * folds / side, 1.0).abs()
    phase = y * rows / side + zigzag * torch.round(dice.each_log(n, 1, 6))
    tones = lookup(dice.uniform(0, 1, n, side), torch.remainder(phase.floor().long(), rows))
    bars = _profile(dice, n, phase, side / rows / 2)
    return torch.where(dice.each_chance(n, 0.4), tones, bars)


def scales(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Overlapping round scales: fish, shingles."""
    x, y = grid(dice, side)
    columns = dice.each_count(n, 2, side // 10)
    rows = 2 * columns
    u, v = x * columns / side, y * rows / side
    out = torch.zeros(n, side, side, device=dice.device)
    taken = torch.zeros(n, side, side, dtype=torch.bool, device=dice.device)
    tones = dice.uniform(0, 1, n, int(rows.max()), int(columns.max()))
    spread, rim = dice.each(n, 0, 0.6), dice.each_log(n, 0.7, 3)
    for down in (1, 0, -1):  # the upper rows lie on top of the lower ones
        row = v.floor().long() - down
        shift = 0.5 * (row % 2)
        column = (u - shift).floor().long()
        du, dv = u - shift - column - 0.5, (v - row - 0.5) / 2
        distance = torch.hypot(du, dv)
        inside = (distance < 0.56) & ~taken & (dv > -0.25)
        line = edge((0.56 - distance) * side / columns - rim)
        tone = lookup(tones, row % rows, torch.remainder(column, columns))
        out = torch.where(inside, line * (1 - spread * tone - 0.5 * (0.56 - distance)), out)
        taken = taken | inside
    return out
