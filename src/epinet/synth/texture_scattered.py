"""Texture families of scattered things: dots, scratches, glyphs, leaves, overlapping panels."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.tiles import edge, grid, lookup, stamp, strokes, wrapped


def dots(dice: Dice, n: int, side: int) -> Tensor:
    """Round spots on a regular or jittered lattice, of one or many tones and sizes."""
    x, y = grid(dice, side)
    count = dice.each_count(n, 3, side // 4)
    u, v = x * count / side, y * count / side
    shift = 0.5 * (v.floor().long() % 2) * (dice.each_chance(n, 0.4) & (count % 2 == 0))
    u = u + shift
    size = int(count.max())
    spots = dice.uniform(0, 1, n, size, size, 4)
    spot = lookup(spots, v.floor().long() % count, u.floor().long() % count)
    radius = dice.each(n, 0.12, 0.45) * (1 - dice.each(n, 0, 0.7) * spot[..., 3])
    jitter = torch.where(dice.each_chance(n, 0.4), 0.0, 1.0) * (0.5 - radius)
    du = torch.remainder(u, 1) - 0.5 - jitter * (2 * spot[..., 0] - 1)
    dv = torch.remainder(v, 1) - 0.5 - jitter * (2 * spot[..., 1] - 1)
    covered = edge((radius - torch.hypot(du, dv)) * side / count)
    return covered * (1 - dice.each(n, 0, 0.9) * spot[..., 2])


def scratches(dice: Dice, n: int, side: int) -> Tensor:
    """Fine lines and hairs, straight or bent, in one main direction or all."""
    many, points = 60, side
    tile = torch.arange(n, device=dice.device).repeat_interleave(many)
    main = dice.uniform(0, 2 * math.pi, n, 1).repeat_interleave(many, 0)
    spread = dice.log_uniform(0.03, 3, n, 1).repeat_interleave(many, 0)
    heading = main + spread * dice.normal(n * many, 1)
    bend = dice.log_uniform(0.02, 3, n, 1).repeat_interleave(many, 0) * dice.normal(n * many, 1)
    length = side * dice.log_uniform(0.05, 0.7, n * many, 1)
    t = torch.linspace(0, 1, points, device=dice.device)
    angle = heading + bend * t
    x = dice.uniform(0, side, n * many, 1) + length * (angle.cos() / points).cumsum(1)
    y = dice.uniform(0, side, n * many, 1) + length * (angle.sin() / points).cumsum(1)
    radius = dice.log_uniform(0.4, 1.2, n * many, 1)
    kept = dice.uniform(0, 1, n * many) < dice.uniform(0.2, 1, n).repeat_interleave(many)
    lines = strokes(n, side, tile[kept], x[kept], y[kept], radius[kept])
    return edge(lines)


def glyphs(dice: Dice, n: int, side: int) -> Tensor:
    """Rows of random strokes that look like text, words apart from each other."""
    many, points = 5, 24
    height = dice.each_log(n, 7, side / 5)
    rows = (side / height / 1.3).floor().clamp_min(1)
    columns = (side / height / 0.8).floor().clamp_min(1)
    size_r, size_c = int(rows.max()), int(columns.max())
    kept = (torch.arange(size_r, device=dice.device)[:, None] < rows) & (
        torch.arange(size_c, device=dice.device) < columns
    )
    kept = kept & (dice.uniform(0, 1, n, size_r, size_c) < 0.82)
    tile, row, column = torch.nonzero(kept).unbind(1)
    # an alphabet of 20 glyphs: strokes between points of a lattice of 3 x 4
    ends = dice.integers(0, 2, n, 20, many, 2), dice.integers(0, 3, n, 20, many, 2)
    curve = dice.uniform(-0.5, 0.5, n, 20, many) * dice.integers(0, 1, n, 20, many)
    letter = dice.integers(0, 19, n, size_r, size_c)[tile, row, column]
    x0, x1 = (ends[0][tile, letter] / 2).unbind(-1)
    y0, y1 = (ends[1][tile, letter] / 3).unbind(-1)
    t = torch.linspace(0, 1, points, device=dice.device)
    bulge = curve[tile, letter][..., None] * 4 * t * (1 - t)
    px = x0[..., None] + (x1 - x0)[..., None] * t + bulge * (y1 - y0)[..., None]
    py = y0[..., None] + (y1 - y0)[..., None] * t - bulge * (x1 - x0)[..., None]
    h = height[tile, 0, 0, None, None]
    x = (column[:, None, None] + 0.15 + 0.6 * px) * side / columns[tile]
    y = row[:, None, None] * side / rows[tile] + (0.15 + 0.7 * py) * h
    radius = (h * dice.each_log(n, 0.03, 0.1)[tile]).clamp_min(0.45).expand(-1, many, 1)
    flat = tile.repeat_interleave(many)
    return edge(strokes(n, side, flat, x.flatten(0, 1), y.flatten(0, 1), radius.flatten(0, 1)))


def leaf_distance(
    dx: Tensor, dy: Tensor, length: Tensor, width: Tensor, angle: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Signed distance to a pointed leaf, positive inside; and texels along and across it.

    A leaf is where two discs overlap: `length` and `width` are half of its own, in texels.
    """
    along = dx * angle.cos() + dy * angle.sin()
    across = dy * angle.cos() - dx * angle.sin()
    radius = (length**2 + width**2) / (2 * width)
    return radius - torch.hypot(along, across.abs() + radius - width), along, across


def foliage(dice: Dice, n: int, side: int) -> Tensor:
    """Leaves on top of each other, each with its own tone, shade and rib."""
    most = 240
    length = dice.log_uniform(4, side / 5, n, 1) * dice.uniform(0.6, 1.2, n, most)
    slim = dice.uniform(0.12, 0.6, n, 1) * dice.uniform(0.8, 1.2, n, most)
    spread = dice.log_uniform(0.2, 4, n, 1)
    angle = dice.uniform(0, 6.3, n, 1) + spread * dice.normal(n, most)
    centre = dice.uniform(0, side, 2, n, most)
    tone = dice.uniform(0, 1, n, most)
    width = length * slim
    tile = torch.arange(n, device=dice.device).repeat_interleave(most)
    flat = [t.flatten() for t in (length, width, angle)]

    def order(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        own = [t[which, None, None] for t in flat]
        inside = leaf_distance(dx, dy, *own)[0] > 0
        return torch.where(inside, (which % most + 1)[:, None, None].float(), 0.0)

    x, y = centre[0].flatten(), centre[1].flatten()
    top = stamp(n, side, tile, x, y, flat[0] + 1, order, 0.0).long()
    covered, top = top > 0, (top - 1).clamp_min(0)
    gx, gy = grid(dice, side)
    dx = wrapped(gx - lookup(centre[0], top), side)
    dy = wrapped(gy - lookup(centre[1], top), side)
    long = lookup(length, top)
    _, along, across = leaf_distance(dx, dy, long, lookup(width, top), lookup(angle, top))
    shade = 0.5 + 0.4 * dice.each(n, 0, 1) * along / long
    rib = edge(across.abs() - 0.4)
    bright = 0.25 + shade * (0.3 + lookup(tone, top)) * (1 - dice.each(n, 0, 0.5) * (1 - rib))
    return torch.where(covered, bright, 0.0)


def panels(dice: Dice, n: int, side: int) -> Tensor:
    """Flat rectangles on top of each other, in any direction or along the axes."""
    x, y = grid(dice, side)
    out = torch.zeros(n, side, side, device=dice.device)
    turned = dice.each_chance(n, 0.4)
    for _ in range(24):
        angle = torch.where(turned, dice.each(n, 0, math.pi), 0.0)
        dx = wrapped(x - dice.each(n, 0, side), side)
        dy = wrapped(y - dice.each(n, 0, side), side)
        u, v = dx * angle.cos() + dy * angle.sin(), dy * angle.cos() - dx * angle.sin()
        width = dice.each_log(n, side / 60, side / 3.2)
        height = dice.each_log(n, side / 60, side / 3.2)
        distance = torch.minimum(width - u.abs(), height - v.abs())
        out = torch.lerp(out, dice.each(n, 0, 1).expand_as(out), edge(distance))
    return out


def crosses(dice: Dice, n: int, side: int) -> Tensor:
    """Held out. Scattered crosses and stars with thin arms."""
    most = 150
    size = dice.log_uniform(3, side / 8, n, 1) * dice.uniform(0.6, 1.2, n, most)
    turned = dice.uniform(0, 6.3, n, most) * dice.integers(0, 1, n, 1)
    arm = dice.log_uniform(0.08, 0.3, n, 1) * size
    tile = torch.arange(n, device=dice.device).repeat_interleave(most)
    centre = dice.uniform(0, side, 2, n * most)
    flat = [t.flatten() for t in (size, turned, arm.clamp_min(0.6), dice.uniform(0.2, 1, n, most))]

    def cross(dx: Tensor, dy: Tensor, which: Tensor) -> Tensor:
        reach, angle, half, tone = (t[which, None, None] for t in flat)
        u = (dx * angle.cos() + dy * angle.sin()).abs()
        v = (dy * angle.cos() - dx * angle.sin()).abs()
        return tone * edge(torch.minimum(half - torch.minimum(u, v), reach - torch.maximum(u, v)))

    reach = flat[0] * math.sqrt(2) + 1
    return stamp(n, side, tile, centre[0], centre[1], reach, cross, 0.0)
