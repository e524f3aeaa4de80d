"""Silhouettes of single thin things, 1 to 8 texels wide: signed distances in texels."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.silhouette_solid import MARGIN, box, radial, reach, segment, wobbling_radii
from epinet.synth.tiles import centred_grid, strokes, walks, wrapped

_THINNEST, _THICKEST = 0.55, 4.0


def radius(dice: Dice, n: int) -> Tensor:
    """(n, 1, 1) half of a thin thing's width in texels, thin ones more often."""
    return dice.each_log(n, _THINNEST, _THICKEST)


def fitted(x: Tensor, y: Tensor, n: int, side: int) -> tuple[Tensor, Tensor]:
    """Paths (m, points) of n tiles, in order and equally many each, moved and scaled to fit."""
    x, y = x.view(n, -1), y.view(n, -1)
    room = side - 2 * (MARGIN + _THICKEST + 1)
    extent = torch.maximum(x.amax(1) - x.amin(1), y.amax(1) - y.amin(1))
    scale = (room / extent.clamp_min(1e-6))[:, None]
    middle_x = (x.amax(1, keepdim=True) + x.amin(1, keepdim=True)) / 2
    middle_y = (y.amax(1, keepdim=True) + y.amin(1, keepdim=True)) / 2
    return (x - middle_x) * scale + side / 2, (y - middle_y) * scale + side / 2


def _drawn(n: int, side: int, x: Tensor, y: Tensor, r: Tensor, taken: Tensor | None) -> Tensor:
    """Signed distances of (n, paths, points) paths of which only those `taken` (n, paths) show."""
    paths, points = x.shape[1:]
    x, y = (t.view(n * paths, points) for t in fitted(x, y, n, side))
    r = r.expand(n, paths, points).reshape(n * paths, points)
    tile = torch.arange(n, device=x.device).repeat_interleave(paths)
    if taken is not None:
        shown = taken.flatten()
        tile, x, y, r = tile[shown], x[shown], y[shown], r[shown]
    return strokes(n, side, tile, x, y, r)


def wires(dice: Dice, n: int, side: int) -> Tensor:
    """One to four bent wires."""
    most, points = 4, int(1.6 * side)
    m = n * most
    bend, wiggle = dice.uniform(-4, 4, m, 1), dice.log_uniform(0.05, 1.5, m, 1)
    x, y, _ = walks(dice, m, points, dice.uniform(0, 6.3, m, 1), bend, wiggle)
    x = (x + dice.uniform(-0.3, 0.3, m, 1)).view(n, most, points)
    y = (y + dice.uniform(-0.3, 0.3, m, 1)).view(n, most, points)
    taken = torch.arange(most, device=dice.device) < dice.integers(1, most, n, 1)
    # those not shown follow the first one, so that the others fill the tile
    x = torch.where(taken[..., None], x, x[:, :1])
    y = torch.where(taken[..., None], y, y[:, :1])
    return _drawn(n, side, x, y, radius(dice, n), taken)


def twigs(dice: Dice, n: int, side: int) -> Tensor:
    """A stem with branches that branch again, thinner and thinner."""
    points = side
    stem = dice.uniform(0, 2 * math.pi, n, 1)
    x, y, heading = walks(
        dice, n, points, stem, dice.uniform(-1, 1, n, 1), dice.uniform(0.1, 0.5, n, 1)
    )
    level = x.view(n, 1, -1), y.view(n, 1, -1), heading.view(n, 1, -1)
    levels, size = [level], 1.0
    thick = radius(dice, n)
    radii = [thick.expand(n, 1, points)]
    for many, share in ((7, 0.45), (20, 0.4)):
        size *= share
        parents = dice.integers(0, level[0].shape[1] - 1, n, many)
        along = dice.integers(points // 6, points - 1, n, many)
        tile = torch.arange(n, device=dice.device)[:, None]
        from_x, from_y, from_heading = (t[tile, parents, along] for t in level)
        turned = dice.uniform(0.4, 1.2, n, many) * (2 * dice.integers(0, 1, n, many) - 1)
        m = n * many
        start = (from_heading + turned).view(m, 1)
        bx, by, heading = walks(
            dice, m, points, start, dice.uniform(-0.8, 0.8, m, 1), dice.uniform(0, 0.5, m, 1)
        )
        length = size * dice.uniform(0.5, 1.2, m, 1)
        shape = (n, many, points)
        level = (
            (bx * length).view(shape) + from_x[..., None],
            (by * length).view(shape) + from_y[..., None],
            heading.view(shape),
        )
        levels.append(level)
        thick = thick * dice.each(n, 0.5, 0.9)
        radii.append(thick.clamp_min(_THINNEST).expand(shape))
    x, y = (torch.cat([part[k] for part in levels], 1) for k in (0, 1))
    return _drawn(n, side, x, y, torch.cat(radii, 1), None)


def bars(dice: Dice, n: int, side: int) -> Tensor:
    """One to six straight bars."""
    u, v = centred_grid(dice, n, side)
    r = radius(dice, n)
    room = reach(side) - _THICKEST - 1
    count = dice.integers(1, 6, n, 1, 1)
    out = torch.full_like(u, -1.0)
    for k in range(6):
        angle = dice.each(n, 0, 2 * math.pi), dice.each(n, 1.5, 4.8)
        ends = angle[0], angle[0] + angle[1]
        (ax, ay), (bx, by) = ((room * e.cos(), room * e.sin()) for e in ends)
        bar = r * dice.each(n, 0.6, 1).clamp_min(_THINNEST / r) - segment(u, v, ax, ay, bx, by)
        out = torch.where(k < count, torch.maximum(out, bar), out)
    return out


def hoops(dice: Dice, n: int, side: int) -> Tensor:
    """Thin rings: round, wobbling, or the outline of a polygon."""
    u, v = centred_grid(dice, n, side)
    room = (reach(side) - 1) / reach(side)
    radii = wobbling_radii(dice, n, side) * room
    corners = torch.full((n, 1), 256, device=dice.device)
    kind = dice.integers(0, 2, n, 1)
    radii = torch.where(kind == 1, (reach(side) - 1) * dice.uniform(0.4, 1, n, 256), radii)
    corners = torch.where(kind == 1, dice.integers(3, 8, n, 1), corners)
    radii = torch.where(kind == 2, reach(side) - 1, radii)
    aspect = dice.each(n, 0.4, 1)
    depth = radial(u, v / aspect, radii, corners) * aspect
    r = radius(dice, n)
    return r - (depth - r).abs()


def grass(dice: Dice, n: int, side: int) -> Tensor:
    """A tuft of blades that taper and bend."""
    many, points = 28, side
    m = n * many
    lean = dice.uniform(0.1, 0.7, n, 1).repeat_interleave(many, 0)
    heading = -math.pi / 2 + lean * dice.normal(m, 1)
    bend = lean * dice.normal(m, 1)
    x, y, _ = walks(dice, m, points, heading, bend, dice.uniform(0, 0.15, m, 1))
    length = dice.uniform(0.4, 1, m, 1)
    root = dice.uniform(-0.5, 0.5, m, 1) * dice.uniform(0.1, 1, n, 1).repeat_interleave(many, 0)
    x, y = (x * length + root).view(n, many, -1), (y * length).view(n, many, -1)
    taper = torch.linspace(1, 0, points, device=dice.device)
    r = _THINNEST + (radius(dice, n) - _THINNEST) * taper
    taken = torch.arange(many, device=dice.device) < dice.integers(4, many, n, 1)
    x = torch.where(taken[..., None], x, x[:, :1])
    y = torch.where(taken[..., None], y, y[:, :1])
    return _drawn(n, side, x, y, r, taken)


def lattices(dice: Dice, n: int, side: int) -> Tensor:
    """A piece of a grid, with or without a frame, in a rectangle or a disc."""
    u, v = centred_grid(dice, n, side)
    r = radius(dice, n)
    angle = dice.each(n, 0.3, math.pi / 4)
    room = reach(side) - 1
    width, height = room * angle.cos(), room * angle.sin()
    plate = box(u, v, width, height)
    plate = torch.where(dice.each_chance(n, 0.3), room - torch.hypot(u, v), plate)
    # bars apart enough that holes remain
    pitch_u = 2 * r + dice.each_log(n, 10, side / 5)
    pitch_v = torch.where(dice.each_chance(n, 0.5), pitch_u, 2 * r + dice.each_log(n, 10, side / 2))
    grid = torch.maximum(r - wrapped(u, pitch_u).abs(), r - wrapped(v, pitch_v).abs())
    frame = torch.where(dice.each_chance(n, 0.5), r - (plate - r).abs(), -1.0)
    return torch.minimum(torch.maximum(grid, frame), plate)
