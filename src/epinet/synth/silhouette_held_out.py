"""Silhouettes for validation scenes only: signed distances in texels, positive inside."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.silhouette_repeating import along_axis, scattered_sizes, slope_of
from epinet.synth.silhouette_solid import radial, reach
from epinet.synth.silhouette_thin import fitted, radius
from epinet.synth.tiles import centred_grid, grid, periodic_noise, stamp, strokes, wrapped


def _circle(dice: Dice) -> Tensor:
    """(512,) angles of the corners of finely drawn outlines."""
    return torch.arange(512, device=dice.device) * (2 * math.pi / 512)


def hearts(dice: Dice, n: int, side: int) -> Tensor:
    """Hearts, slim to plump: two discs on a square that stands on its corner."""
    u, v = centred_grid(dice, n, side)
    aspect, size = dice.each(n, 0.55, 1), reach(side) / 0.71
    x, y = u.abs() / aspect / size, v / size + 0.5
    lobe = math.sqrt(2) / 4 - torch.hypot(x - 0.25, y - 0.75)
    # the sides of the square: x = y from the tip, x + y = 1 to the discs
    tip = torch.minimum(y - x, 1 - x - y) / math.sqrt(2)
    return torch.maximum(lobe, tip) * size * aspect


def gears(dice: Dice, n: int, side: int) -> Tensor:
    """Toothed wheels with a hole."""
    u, v = centred_grid(dice, n, side)
    teeth = dice.each_count(n, 6, 30)[..., 0]
    wave = torch.tanh(torch.sin(_circle(dice) * teeth) * dice.log_uniform(1.5, 8, n, 1))
    depth = dice.uniform(0.05, 0.2, n, 1)
    wheel = radial(u, v, reach(side) * (1 - depth + depth * wave * 0.98))
    return torch.minimum(wheel, torch.hypot(u, v) - dice.each(n, 0.1, 0.5) * reach(side))


def superellipses(dice: Dice, n: int, side: int) -> Tensor:
    """Between a diamond with hollow sides and a square with soft corners."""
    u, v = centred_grid(dice, n, side)
    t, power = _circle(dice), dice.log_uniform(0.6, 5, n, 1)
    radii = (t.cos().abs() ** power + t.sin().abs() ** power) ** (-1 / power)
    return radial(u, v, radii * reach(side) / radii.amax(1, keepdim=True))


def flowers(dice: Dice, n: int, side: int) -> Tensor:
    """Round petals around a middle."""
    u, v = centred_grid(dice, n, side)
    petals = dice.integers(3, 9, n, 1)
    wave = torch.cos(_circle(dice) * petals / 2).abs() ** dice.log_uniform(0.4, 1.5, n, 1)
    depth = dice.uniform(0.3, 0.8, n, 1)
    return radial(u, v, 0.98 * reach(side) * (1 - depth + depth * wave))


def spirals(dice: Dice, n: int, side: int) -> Tensor:
    """Spirals of two to seven turns."""
    points = 8 * side
    t = torch.linspace(0.02, 1, points, device=dice.device).sqrt()
    angle = 2 * math.pi * dice.uniform(2, 7, n, 1) * t + dice.uniform(0, 6.3, n, 1)
    x, y = fitted(t * angle.cos(), t * angle.sin(), n, side)
    return strokes(n, side, torch.arange(n, device=dice.device), x, y, radius(dice, n)[..., 0])


def zigzags(dice: Dice, n: int, side: int) -> Tensor:
    """A wire that turns sharply to and fro."""
    points = 5 * side
    t = torch.linspace(0, 1, points, device=dice.device)
    fold = 2 * wrapped(t * dice.uniform(2, 9, n, 1), 1.0).abs() * dice.uniform(0.2, 1, n, 1)
    angle = dice.uniform(0, 6.3, n, 1)
    x, y = t * angle.cos() + fold * angle.sin(), t * angle.sin() - fold * angle.cos()
    x, y = fitted(x, y, n, side)
    return strokes(n, side, torch.arange(n, device=dice.device), x, y, radius(dice, n)[..., 0])


def springs(dice: Dice, n: int, side: int) -> Tensor:
    """A wire in loops."""
    points = 10 * side
    t = torch.linspace(0, 1, points, device=dice.device)
    angle = 2 * math.pi * dice.uniform(4, 10, n, 1) * t
    size, lean = dice.uniform(0.05, 0.3, n, 1), dice.uniform(0, 6.3, n, 1)
    a, b = t + size * angle.cos(), 1.5 * size * angle.sin()
    x, y = fitted(a * lean.cos() + b * lean.sin(), b * lean.cos() - a * lean.sin(), n, side)
    return strokes(n, side, torch.arange(n, device=dice.device), x, y, radius(dice, n)[..., 0])


def wheels(dice: Dice, n: int, side: int) -> Tensor:
    """A thin rim with spokes."""
    u, v = centred_grid(dice, n, side)
    r, room = radius(dice, n), reach(side) - 1
    rim = r - (torch.hypot(u, v) - room + r).abs()
    count = dice.integers(3, 12, n, 1, 1)
    sector = 2 * math.pi / count
    angle = wrapped(torch.atan2(v, u), sector)
    away = torch.hypot(u, v)
    spoke = torch.minimum(0.8 * r - away * angle.sin().abs(), room - away)
    hub = dice.each(n, 0.05, 0.3) * room
    spoke = torch.minimum(spoke, away - hub)
    return torch.maximum(torch.maximum(rim, spoke), r - (away - hub).abs())


def honeycombs(dice: Dice, n: int, side: int) -> Tensor:
    """Nets of hexagons."""
    x, y = grid(dice, side)
    r = radius(dice, n)
    rows = 2 * dice.each_count(n, 1, side // 40)
    columns = (rows * math.sqrt(3) / 2).round().clamp_min(1).long()
    u, v = x * columns / side, y * rows / side
    first = torch.full((n, side, side), math.inf, device=dice.device)
    second = first.clone()
    for down in (-1, 0, 1):
        row = v.floor() + down
        du = wrapped(u - 0.5 * torch.remainder(row, 2), 1.0)
        dv = (v - row - 0.5) * math.sqrt(3) / 2
        for right in (-1, 0, 1):
            distance = torch.hypot(du + right, dv)
            second = torch.minimum(second, torch.maximum(first, distance))
            first = torch.minimum(first, distance)
    pitch = side / columns
    return torch.minimum(r, pitch / 6) - (second - first) * pitch / 2


def zigzag_wires(dice: Dice, n: int, side: int) -> Tensor:
    """Wires that turn sharply to and fro, side by side: wire fences."""
    u, v = along_axis(dice, n, side)
    r, folds = radius(dice, n), dice.each_count(n, 1, 10)
    rise = dice.each_log(n, 0.3, 1.5)  # texels down for each to the right
    gap = torch.maximum(dice.each_log(n, 16, side / 3), 4 * r)
    steep = torch.hypot(rise, torch.ones_like(rise))
    pitch = side / (side / ((2 * r + gap) * steep)).floor().clamp_min(1)
    height = wrapped(u, side / folds).abs() * rise
    crossing = torch.where(dice.each_chance(n, 0.5), -height, height)
    away = torch.minimum(wrapped(v - height, pitch).abs(), wrapped(v - crossing, pitch).abs())
    return r - away / steep


def chains(dice: Dice, n: int, side: int) -> Tensor:
    """Rings side by side that touch or overlap: chain mail."""
    x, y = grid(dice, side)
    r, count = radius(dice, n), dice.each_count(n, 2, side // 40)
    pitch = side / count
    size = (0.5 * dice.each(n, 0.85, 1.3)) * pitch - r
    out = torch.full((n, side, side), -math.inf, device=dice.device)
    for right in (-0.5, 0.5):
        for down in (-0.5, 0.5):
            u = torch.remainder(x, pitch) - (0.5 + right) * pitch
            v = torch.remainder(y, pitch) - (0.5 + down) * pitch
            out = torch.maximum(out, r - (torch.hypot(u, v) - size).abs())
    return out


def waves(dice: Dice, n: int, side: int) -> Tensor:
    """Broad wavy bands."""
    u, v = along_axis(dice, n, side)
    count, cycles = dice.each_count(n, 2, 8), dice.each_count(n, 1, 5)
    turn = 2 * math.pi * cycles / side
    swing = dice.each(n, 0.2, 1) / turn
    slope = swing * turn * torch.cos(turn * u)
    phase = wrapped((v + swing * torch.sin(turn * u)) * count / side, 1.0).abs()
    distance = (0.5 * dice.each(n, 0.3, 0.7) - phase) * side / count
    return distance / torch.hypot(slope, torch.ones_like(slope))


def triangles(dice: Dice, n: int, side: int) -> Tensor:
    """A regular field of triangles."""
    x, y = grid(dice, side)
    columns, rows = dice.each_count(n, 2, 8), dice.each_count(n, 2, 8)
    row = (y * rows / side).floor()
    u = wrapped(x * columns / side + 0.5 * torch.remainder(row, 2) * (rows % 2 == 0), 1.0).abs()
    v = torch.remainder(y * rows / side, 1)
    size = dice.each(n, 0.6, 0.95)
    down = (size - v) * side / rows
    return torch.minimum(torch.minimum(down, v * side / rows), (0.5 * v - u) * side / columns)


def winding(dice: Dice, n: int, side: int) -> Tensor:
    """Winding bands of one width."""
    middle = dice.each_log(n, 4, 16)
    noise = periodic_noise(
        dice,
        n,
        side,
        0.0,
        cycles=side // 8,
        shape=lambda f: torch.exp(-(((f / middle - 1) / 0.12) ** 2)),
    )
    return (noise - dice.each(n, -0.5, 0.5)) / slope_of(noise).clamp_min(0.01)


def blossoms(dice: Dice, n: int, side: int) -> Tensor:
    """Scattered flowers."""
    many = 120
    size, shown = scattered_sizes(dice, n, side, many)
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    x, y = dice.uniform(0, side, 2, n * many)
    petals = dice.integers(3, 7, n, 1).expand(n, many).flatten()[shown]
    depth = dice.uniform(0.3, 0.8, n, 1).expand(n, many).flatten()[shown]
    start, r = dice.uniform(0, 6.3, n * many)[shown], size[shown]

    def flower(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        own, p, d, s = (t[which, None, None] for t in (r, petals, depth, start))
        petal = torch.cos((torch.atan2(dy, dx) + s) * p / 2).abs().sqrt()
        return own * (1 - d + d * petal) - torch.hypot(dx, dy)

    return stamp(n, side, tile[shown], x[shown], y[shown], r + 1, flower, -1.0)
