"""Silhouettes of single solid things: signed distances in texels, positive inside.

Every shape lies within `reach(side)` texels of the tile's centre.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from epinet.synth.dice import Dice
from epinet.synth.texture_scattered import leaf_distance
from epinet.synth.tiles import centred_grid, periodic_noise, wrapped

MARGIN = 3
"""Texels between a shape and the border of its tile."""


def reach(side: int) -> float:
    """Radius in texels of the circle that shapes fill."""
    return side / 2 - MARGIN


def radial(u: Tensor, v: Tensor, radii: Tensor, count: Tensor | None = None) -> Tensor:
    """(n, H, W) signed distance to closed curves around the origin.

    Args:
        u, v: (n, H, W) texels from the origin.
        radii: (n, K) texels of the corners, at equal angles.
        count: (n, 1) how many of the corners a tile has; all by default.
    """
    n, most = radii.shape
    corners = torch.full((n, 1), most, device=radii.device) if count is None else count
    index = torch.arange(most, device=radii.device).expand(n, -1)
    angle = 2 * math.pi * index / corners
    x, y = radii * angle.cos(), radii * angle.sin()
    following = (index + 1) % corners
    dx, dy = x.gather(1, following) - x, y.gather(1, following) - y
    length = torch.hypot(dx, dy).clamp_min(1e-6)
    normal_x, normal_y = dy / length, -dx / length
    offset = normal_x * x + normal_y * y
    turn = torch.remainder(torch.atan2(v, u) / (2 * math.pi), 1) * corners[..., None]
    sector = turn.long().remainder(corners[..., None])
    tile = torch.arange(n, device=radii.device)[:, None, None]
    distance: Tensor = (
        offset[tile, sector] - normal_x[tile, sector] * u - normal_y[tile, sector] * v
    )
    return distance


def box(
    u: Tensor, v: Tensor, width: Tensor, height: Tensor, round_: Tensor | float = 0.0
) -> Tensor:
    """Signed distance to a box of half a width and half a height, its corners rounded."""
    du, dv = u.abs() - width + round_, v.abs() - height + round_
    outside = torch.hypot(du.clamp_min(0), dv.clamp_min(0))
    return round_ - outside - torch.maximum(du, dv).clamp_max(0)


def segment(x: Tensor, y: Tensor, ax: Tensor, ay: Tensor, bx: Tensor, by: Tensor) -> Tensor:
    """Distance in texels to the line between two points."""
    along_x, along_y = bx - ax, by - ay
    squared = (along_x**2 + along_y**2).clamp_min(1e-6)
    t = (((x - ax) * along_x + (y - ay) * along_y) / squared).clamp(0, 1)
    return torch.hypot(x - ax - t * along_x, y - ay - t * along_y)


def wobbling_radii(dice: Dice, n: int, side: int) -> Tensor:
    """(n, 256) radii of smooth closed curves that just fit."""
    angle = torch.arange(256, device=dice.device) * (2 * math.pi / 256)
    slope, strength = dice.uniform(0.6, 2, n, 1), dice.log_uniform(0.1, 0.8, n, 1)
    wobble = torch.zeros(n, 256, device=dice.device)
    for k in range(1, 12):
        phase = dice.uniform(0, 2 * math.pi, n, 1)
        wobble = wobble + strength * dice.normal(n, 1) * k**-slope * torch.cos(k * angle + phase)
    radii = torch.exp(wobble.clamp(-1.5, 1.5))
    return radii * reach(side) / radii.amax(1, keepdim=True)


def ellipses(dice: Dice, n: int, side: int) -> Tensor:
    """Discs and ellipses."""
    u, v = centred_grid(dice, n, side)
    aspect = torch.where(dice.each_chance(n, 0.4), 1.0, dice.each(n, 0.25, 1))
    return (reach(side) - torch.hypot(u, v / aspect)) * aspect


def boxes(dice: Dice, n: int, side: int) -> Tensor:
    """Rectangles, their corners sharp or round."""
    u, v = centred_grid(dice, n, side)
    angle = dice.each(n, 0.2, math.pi / 4)
    width, height = reach(side) * angle.cos(), reach(side) * angle.sin()
    return box(u, v, width, height, dice.each(n, 0, 1) * dice.each_chance(n, 0.5) * height)


def blocks(dice: Dice, n: int, side: int) -> Tensor:
    """A few rectangles together: L, T, U, stairs, skylines."""
    u, v = centred_grid(dice, n, side)
    out = torch.full_like(u, -math.inf)
    half = reach(side) / math.sqrt(2)
    for _ in range(4):
        width, height = dice.each(n, 0.08, 0.4) * half, dice.each(n, 0.15, 0.9) * half
        x, y = dice.each(n, -1, 1) * (half - width), dice.each(n, -1, 1) * (half - height)
        out = torch.maximum(out, box(u - x, v - y, width, height))
    return out


def polygons(dice: Dice, n: int, side: int) -> Tensor:
    """Regular and irregular polygons of 3 to 9 corners."""
    u, v = centred_grid(dice, n, side)
    ragged = dice.uniform(0, 0.75, n, 1) * (dice.uniform(0, 1, n, 1) < 0.7)
    radii = reach(side) * (1 - ragged * dice.uniform(0, 1, n, 9))
    return radial(u, v, radii, dice.integers(3, 9, n, 1))


def stars(dice: Dice, n: int, side: int) -> Tensor:
    """Stars of 3 to 20 points, even and uneven."""
    u, v = centred_grid(dice, n, side)
    inner = torch.arange(40, device=dice.device) % 2 == 1
    depth = dice.uniform(0.15, 0.75, n, 1)
    uneven = 1 - dice.uniform(0, 0.5, n, 1) * dice.uniform(0, 1, n, 40)
    radii = reach(side) * torch.where(inner, 1 - depth, 1.0) * uneven
    return radial(u, v, radii, 2 * dice.each_count(n, 3, 20)[..., 0])


def blobs(dice: Dice, n: int, side: int) -> Tensor:
    """Free forms with a smooth outline."""
    u, v = centred_grid(dice, n, side)
    return radial(u, v, wobbling_radii(dice, n, side))


def islands(dice: Dice, n: int, side: int) -> Tensor:
    """Level sets of noise inside a disc, with bays, holes and smaller islands."""
    u, v = centred_grid(dice, n, side)
    noise = periodic_noise(dice, n, side, dice.each(n, 1.6, 2.8), cycles=side // 8)
    r = torch.hypot(u, v) / reach(side)
    # noise that is low in the middle would leave nothing
    middle = noise[:, side // 2, side // 2, None, None]
    noise = noise - middle * torch.exp(-8 * r**2)
    height = dice.each(n, 0.6, 1.3) + dice.each(n, 0.3, 0.8) * noise - 1.2 * r**2 - 2.5 * r**4
    return torch.minimum(height * side / 20, (1 - r) * reach(side))


def rings(dice: Dice, n: int, side: int) -> Tensor:
    """Broad rings, round or oval, whole or with a gap."""
    u, v = centred_grid(dice, n, side)
    aspect = torch.where(dice.each_chance(n, 0.5), 1.0, dice.each(n, 0.5, 1))
    r, half = torch.hypot(u, v / aspect), dice.each(n, 0.08, 0.25) * reach(side)
    ring = (half - (r - reach(side) + half).abs()) * aspect
    gap = (v.abs() - dice.each(n, 0.05, 0.5) * reach(side)) * (u > 0) + side * (u <= 0)
    return torch.where(dice.each_chance(n, 0.4), torch.minimum(ring, gap), ring)


def crescents(dice: Dice, n: int, side: int) -> Tensor:
    """A disc less another disc."""
    u, v = centred_grid(dice, n, side)
    shift, size = dice.each(n, 0.25, 0.9) * reach(side), dice.each(n, 0.6, 1.1) * reach(side)
    return torch.minimum(reach(side) - torch.hypot(u, v), torch.hypot(u - shift, v) - size)


def leaves(dice: Dice, n: int, side: int) -> Tensor:
    """A single leaf: smooth, saw-edged or lobed, on a stalk, bent."""
    u, v = centred_grid(dice, n, side)
    length = 0.85 * reach(side)
    v = v + dice.each(n, -0.4, 0.4) * (u**2 / length - 0.3 * length)
    width = dice.each(n, 0.2, 0.65) * length
    zero = torch.zeros_like(width)
    u = u - 0.12 * length
    blade, along, across = leaf_distance(u, v, zero + length, width, zero)
    teeth = torch.remainder(along / length * dice.each_log(n, 4, 25) + across.abs() / width, 1)
    depth = dice.each_log(n, 0.03, 0.4) * width * dice.each_chance(n, 0.5)
    stalk = box(along + length, across, zero + 0.2 * length, zero + 0.012 * side, 0.0)
    disc = reach(side) - torch.hypot(u + 0.12 * length, v)
    return torch.minimum(torch.maximum(blade - teeth * depth, stalk), disc)


def glyphs(dice: Dice, n: int, side: int) -> Tensor:
    """Signs of three to five broad strokes."""
    u, v = centred_grid(dice, n, side)
    thick = dice.each_log(n, 0.06, 0.2) * reach(side)
    scale = (reach(side) - thick) / math.sqrt(2)
    strokes = dice.integers(3, 5, n, 1, 1)
    out = torch.full_like(u, -math.inf)
    for k in range(5):
        a = [dice.integers(-1, 1, n, 1, 1) * scale for _ in range(2)]
        b = [dice.integers(-1, 1, n, 1, 1) * scale for _ in range(2)]
        stroke = thick - segment(u, v, a[0], a[1], b[0], b[1])
        out = torch.where(k < strokes, torch.maximum(out, stroke), out)
    return out


def plates(dice: Dice, n: int, side: int) -> Tensor:
    """Boxes and discs with one hole or many, round or square."""
    u, v = centred_grid(dice, n, side)
    half = reach(side) / math.sqrt(2)
    width, height = half, dice.each(n, 0.4, 1) * half
    plate = box(u, v, torch.full_like(height, width), height, dice.each(n, 0, 0.3) * height)
    plate = torch.where(dice.each_chance(n, 0.4), reach(side) - torch.hypot(u, v), plate)
    count = torch.where(dice.each_chance(n, 0.35), 1, dice.each_count(n, 2, 9))
    pitch = 2 * half / count
    offset = torch.where(count % 2 == 1, 0.0, 0.5) * pitch
    du, dv = wrapped(u - offset, pitch), wrapped(v - offset, pitch)
    size = dice.each(n, 0.15, 0.38) * torch.minimum(pitch, 2 * height)
    hole = torch.where(
        dice.each_chance(n, 0.5), torch.hypot(du, dv), torch.maximum(du.abs(), dv.abs())
    )
    rim = dice.each(n, 0.02, 0.12) * half
    hole = torch.where(plate > rim, hole - size, side)
    return torch.minimum(plate, hole)


def saws(dice: Dice, n: int, side: int) -> Tensor:
    """Strips with teeth along one edge or both: saws, combs, castle walls."""
    u, v = centred_grid(dice, n, side)
    width, height = 0.9 * reach(side), dice.each(n, 0.1, 0.4) * reach(side)
    t = torch.remainder(u / width * dice.each_log(n, 1.5, 20), 1)
    lean = dice.each(n, 0.05, 0.95)
    tooth = torch.minimum(t / lean, (1 - t) / (1 - lean))
    tooth = torch.where(dice.each_chance(n, 0.3), (t < lean).float(), tooth)
    cut = dice.each(n, 0.2, 1.5) * height * tooth
    both = torch.where(dice.each_chance(n, 0.4), v.abs(), v)
    return torch.minimum(box(u, v, torch.full_like(height, width), height), height - cut - both)
