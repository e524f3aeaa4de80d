"""Drawing scenes at random: every number comes from a CPU generator, whatever the device.

Lengths are px of the centre view; a surface is built in a frame (X, Y, D = depth_px d) that is as
deep as it is wide, turned there in any direction, and then expressed in disparity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Generator, Tensor

from epinet.synth.bank import SILHOUETTE_SIDE, SILHOUETTES, Bank, first_silhouette
from epinet.synth.dice import Dice
from epinet.synth.materials import draw_light, draw_materials
from epinet.synth.options import Options
from epinet.synth.scenes import Scenes
from epinet.synth.surfaces import Boxes, Planes, Quadrics, Reliefs

BACKGROUNDS = 3
"""Most planes without an end; the nearest of them counts, so that several make a corner."""

STEEPEST = 0.15
"""Largest |slope| of a plane in px per px: its front is seen from views up to 6 steps away."""

STEEPEST_RELIEF = 0.15
"""The same for the sum of all slopes of a relief and its plane."""

WAVES = 5

WORLD_PX = 512
"""Smaller views are windows into a picture of this width and height, in which things have the
sizes, slants and distances from each other that they have in larger views."""


@dataclass(frozen=True)
class Place:
    """What the surfaces of a scene have in common."""

    low: Tensor
    """(B, 1): the scene uses this part of the range, px."""
    high: Tensor
    depth_px: Tensor
    """(B, 1)"""
    world: tuple[int, int]
    """(height, width) in px of the picture that the views show, or show a part of."""
    size: tuple[int, int]
    """(height, width) of the views in px."""
    background: Tensor
    """(B, BACKGROUNDS, 3) planes without an end."""
    backgrounds: Tensor
    """(B, BACKGROUNDS) bool: which of them there are."""

    def behind(self, x: Tensor, y: Tensor) -> Tensor:
        """Disparity (B, O) of the background at (X, Y)."""
        a, b, c = (t[..., None, :] for t in self.background.unbind(-1))
        d = a + b * x[..., None] + c * y[..., None]
        return d.masked_fill(~self.backgrounds[:, None], -math.inf).amax(-1)


def draw_scenes(g: Generator, count: int, options: Options, bank: Bank) -> Scenes:
    """Draw `count` scenes; the same generator state and options give the same scenes."""
    dice = Dice(g)
    longest = max(*options.size, WORLD_PX)
    focal_px = dice.log_uniform(700, 2500, count) * (longest / WORLD_PX)
    low, high = options.disparity_px
    # The farthest disparity stays before infinity, which lies at -focal_px / depth_px.
    depth_px = focal_px / (max(0.0, -low) + 0.5) * dice.log_uniform(0.05, 0.7, count)
    depth_px = depth_px.clamp_max(40 * longest / (high - low))
    place = _draw_place(dice, count, options, depth_px[:, None])
    busy = dice.chance(options.clutter, count)
    fewest, most = (max(1, n) for n in options.surfaces)
    number = dice.log_uniform(fewest, most + 0.999, count).floor().long()
    if options.surfaces[0] == 0:
        number = torch.where(dice.chance(0.05, count), 0, number)
    kind = dice.uniform(0, 1, count, most)
    there = torch.arange(most) < number[:, None]
    clutter = busy[:, None] & (torch.arange(3 * most) < dice.integers(most, 3 * most, count, 1))
    cutouts = torch.cat([there & (kind < 0.45), clutter], 1)
    planes = _draw_planes(dice, options, place, cutouts, first_small=most)
    quadrics = _draw_quadrics(dice, place, there & (kind >= 0.45) & (kind < 0.78))
    boxes = _draw_boxes(dice, place, there & (kind >= 0.78))
    reliefs = _draw_reliefs(dice, place)
    light = draw_light(dice, options, longest, depth_px, focal_px, len(bank.shades))
    materials = draw_materials(dice, options, light, planes, quadrics, reliefs, boxes)
    scenes = Scenes(options.size, planes, quadrics, boxes, reliefs, materials, light, bank)
    return scenes.to(bank.textures.device)


def _draw_place(dice: Dice, count: int, options: Options, depth_px: Tensor) -> Place:
    least, most = options.disparity_px
    height, width = world = max(options.size[0], WORLD_PX), max(options.size[1], WORLD_PX)
    share = torch.where(dice.chance(0.6, count, 1), 1.0, dice.log_uniform(0.1, 1, count, 1))
    span = (most - least) * share
    low = least + (most - least - span) * dice.uniform(0, 1, count, 1)
    # A plane is set by its disparity at the image's centre and its gain from edge to edge: floors
    # and walls cross most of a scene's range, few stand frontal.
    angle = dice.uniform(0, 2 * math.pi, count, BACKGROUNDS)
    upright = dice.chance(0.5, count, BACKGROUNDS)
    angle = torch.where(upright, (angle / (math.pi / 2)).round() * math.pi / 2, angle)
    # The first is seen at every place if need be. The others, floors that end at a wall, are
    # steeper: they go out of sight below it.
    gains = torch.tensor([0.9, 4.0, 4.0]) * span
    gains = gains * dice.uniform(0, 1, count, BACKGROUNDS) ** 0.7
    gains = torch.where(dice.chance(0.12, count, BACKGROUNDS), 0.0, gains)
    gains = gains / (angle.cos().abs() + angle.sin().abs())
    b, c = gains * angle.cos() / width, gains * angle.sin() / height
    steepness = torch.hypot(b, c).clamp_min(1e-9)
    b, c = (t * (STEEPEST / steepness).clamp_max(1) for t in (b, c))
    reach = 0.5 * (b.abs() * width + c.abs() * height)
    lowest = low + 2 * reach[:, :1]
    top = lowest + (low + 0.95 * span - lowest).clamp_min(0) * dice.uniform(0, 1, count, 1) ** 2
    tops = low + span * dice.uniform(0.5, 1, count, BACKGROUNDS - 1)
    a = torch.cat([top, tops], 1) - reach
    # The window is anywhere in the world, for all planes the same.
    for slope, whole, part in ((b, width, options.size[1]), (c, height, options.size[0])):
        a = a + slope * (whole - part) * dice.uniform(-0.5, 0.5, count, 1)
    number = dice.integers(1, BACKGROUNDS + 1, count, 1)
    exists = torch.arange(BACKGROUNDS) < number
    planes = torch.stack([a, b, c], -1)
    if options.floors:
        chosen = dice.chance(options.floors, count)
        floors = _floors(dice, planes[:, 0], angle[:, 1], low[:, 0] + span[:, 0], options.size)
        planes[:, 1] = torch.where(chosen[:, None], floors, planes[:, 1])
        exists[:, 1] |= chosen
    return Place(low, low + span, depth_px, world, options.size, planes, exists)


def _floors(
    dice: Dice, walls: Tensor, angle: Tensor, high: Tensor, size: tuple[int, int]
) -> Tensor:
    """Planes (B, 3) that meet the walls (B, 3) within the picture and come nearer from there on."""
    reach = 0.5 * (size[1] * angle.cos().abs() + size[0] * angle.sin().abs())
    begin = reach * dice.uniform(-0.9, 0.6, len(walls))
    nearest = walls[:, 0] + 0.5 * (size[1] * walls[:, 1].abs() + size[0] * walls[:, 2].abs())
    slope = dice.log_uniform(0.012, 0.12, len(walls))
    slope = torch.minimum(slope, (high - nearest).clamp_min(0) / (reach - begin))
    return walls + slope[:, None] * torch.stack([-begin, angle.cos(), angle.sin()], -1)


def _positions(dice: Dice, place: Place, reach: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """X, Y, d and whether it is there, each (B, O): somewhere before the background.

    Args:
        reach: (B, O) px that the surface extends to each side of its middle; things that are
            anywhere in the world are there if they can show in the window.
    """
    count, number = reach.shape
    middle, share = [], torch.ones(count, number)
    for part, whole in zip(place.size[::-1], place.world[::-1], strict=True):
        spread = 1.1 * part + (1 - part / whole) * 2 * reach
        middle.append(spread * dice.uniform(-0.5, 0.5, count, number))
        share = share * spread / (1.1 * whole)
    x, y = middle
    there = dice.uniform(0, 1, count, number) < share
    inside = (
        t.clamp(-0.5 * part, 0.5 * part) for t, part in zip((x, y), place.size[::-1], strict=True)
    )
    behind = place.behind(*inside)
    span = (place.high - place.low).expand(count, number)
    small = dice.log_uniform(0.01, 1, count, number) * span
    anywhere = dice.uniform(0, 1, count, number) * (place.high - behind).clamp_min(0)
    fits = behind + small < place.high
    step = torch.where(dice.chance(0.25, count, number) & fits, small, anywhere)
    return x, y, torch.minimum(behind + step, place.high), there


def _draw_planes(
    dice: Dice, options: Options, place: Place, exists: Tensor, first_small: int
) -> Planes:
    count, number = exists.shape
    longest = max(place.world)
    thin = dice.chance(options.thin, count, number)
    repeats = dice.chance(0.1, count, number)
    tile = torch.zeros(count, number, dtype=torch.long)
    for (is_thin, is_repeating), kinds in SILHOUETTES.items():
        first = first_silhouette(is_thin, is_repeating)
        drawn = dice.integers(first, first + kinds - 1, count, number)
        tile = torch.where((thin == is_thin) & (repeats == is_repeating), drawn, tile)
    # The side of the square that the silhouette's tile covers.
    solid = dice.log_uniform(8, 1.5 * longest, count, number)
    slender = dice.log_uniform(48, max(256.0, 1.5 * longest), count, number)
    # Most holes of a pattern are as large as a pixel at least.
    pattern = dice.log_uniform(160, 1200, count, number)
    side = torch.where(repeats, pattern, torch.where(thin, slender, solid))
    small = dice.log_uniform(5, 48, count, number)
    is_small = (torch.arange(number) >= first_small) & ~(thin | repeats)
    side = torch.where(is_small, small, side)
    stretch = dice.log_uniform(0.6, 1.6, count, number)
    x, y, d, there = _positions(dice, place, torch.where(repeats, longest, 0.5 * side))
    exists = exists & there
    d, slopes, side = _leaning(dice, place, d, side, repeats)
    angle = dice.uniform(0, 2 * math.pi, count, number)
    upright = dice.chance(0.4, count, number)  # many things in the world are
    angle = torch.where(upright, (angle / (math.pi / 2)).round() * math.pi / 2, angle)
    along = torch.stack([angle.cos(), angle.sin()], -1) / (side * stretch)[..., None]
    across = torch.stack([-angle.sin(), angle.cos()], -1) / (side / stretch)[..., None]
    linear = torch.stack([along, across], -2) * SILHOUETTE_SIDE
    at_0 = SILHOUETTE_SIDE / 2 - (linear @ torch.stack([x, y], -1)[..., None])[..., 0]
    a = d - slopes[..., 0] * x - slopes[..., 1] * y
    half = 0.5 * side * math.sqrt(2) * 1.6
    half = torch.where(repeats, math.inf, half)
    farthest = d.abs() + slopes.abs().sum(-1) * half.nan_to_num(posinf=0)
    bounds = torch.stack([x - half, x + half, y - half, y + half, farthest], -1)
    endless = torch.tensor([-math.inf, math.inf, -math.inf, math.inf, 0.0])
    backs = (count, BACKGROUNDS)
    opaque = torch.zeros(*backs, 2, 3)
    return Planes(
        exists=torch.cat([place.backgrounds, exists], 1),
        bounds=torch.cat([endless.expand(*backs, 5), bounds], 1),
        cut=torch.cat([torch.zeros(backs, dtype=torch.bool), exists], 1),
        coefficients=torch.cat([place.background, torch.cat([a[..., None], slopes], -1)], 1),
        tile=torch.cat([torch.zeros(backs, dtype=torch.long), tile], 1),
        repeats=torch.cat([torch.zeros(backs, dtype=torch.bool), repeats], 1),
        texels=torch.cat([opaque, torch.cat([at_0[..., None], linear], -1)], 1),
    )


def _leaning(
    dice: Dice, place: Place, d: Tensor, side: Tensor, endless: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Middles (B, O), slopes (B, O, 2) and sides (B, O): some frontal, others turned up to 80 deg.

    What leans forward beyond the range's end is set back, so that it rises out of what is behind
    it, or made smaller. Patterns without an end lean less.
    """
    count, number = side.shape
    longest = max(place.world)
    turn = math.radians(80) * dice.uniform(0, 1, count, number) ** 0.6
    steepness = torch.where(dice.chance(0.15, count, number), 0.0, turn.tan() / place.depth_px)
    steepness = steepness.clamp_max(STEEPEST)
    # 0.86 sides is half the diagonal of the most stretched tile, 1.5 pictures the way to the
    # farthest corner.
    set_back = (place.high - 0.86 * side * steepness).maximum(place.low)
    moved = dice.chance(0.6, count, number) & ~endless
    d = torch.where(moved, torch.minimum(d, set_back), d)
    room = (place.high - d).clamp_min(0) + 0.02
    fitting = (room / (0.86 * steepness).clamp_min(1e-9)).clamp_min(12)
    side = torch.where(endless, side, torch.minimum(side, fitting))
    extent = torch.where(endless, 1.5 * longest, 0.86 * side)
    steepness = torch.minimum(steepness, room / extent)
    angle = dice.uniform(0, 2 * math.pi, count, number)
    return d, steepness[..., None] * torch.stack([angle.cos(), angle.sin()], -1), side


QUADRICS = {
    (1.0, 0.0, -1.0): 0.4,
    (1.0, 0.0, 0.0): 0.35,
    (0.25, -0.5, 0.25): 0.12,
    (0.3, 0.0, 0.7): 0.06,
    (0.5, -0.5, 0.0): 0.07,
}
"""(e0, e1, e2) and how often: ellipsoids, cylinders, cones, waisted vases, bowls."""


def _draw_quadrics(dice: Dice, place: Place, exists: Tensor) -> Quadrics:
    count, number = exists.shape
    longest = max(place.world)
    shapes = torch.tensor(list(QUADRICS))
    weights = torch.tensor(list(QUADRICS.values()))
    chosen = torch.multinomial(weights, count * number, replacement=True, generator=dice.g)
    chosen = chosen.view(count, number)
    radius = dice.log_uniform(4, 0.45 * longest, count, number)
    rod = (chosen == 1) & dice.chance(0.4, count, number)
    radius = torch.where(rod, dice.log_uniform(0.5, 5, count, number), radius)
    flatness = dice.log_uniform(0.6, 1, count, number)
    length = radius * dice.log_uniform(0.6, 2, count, number)
    length = torch.where(rod, dice.log_uniform(10, longest, count, number), length)
    round_ = (chosen == 0) & dice.chance(0.6, count, number)
    flatness = torch.where(round_, 1.0, flatness)
    length = torch.where(round_, radius, length)
    radii = torch.stack([radius, radius * flatness, length], -1)
    centre, matrix, bounds, there = _solids(dice, place, radii)
    return Quadrics(exists & there, bounds, centre, matrix, shapes[chosen])


def _draw_boxes(dice: Dice, place: Place, exists: Tensor) -> Boxes:
    count, number = exists.shape
    radius = dice.log_uniform(4, 0.4 * max(place.world), count, number, 1)
    radii = radius * dice.log_uniform(0.3, 1, count, number, 3)
    centre, matrix, bounds, there = _solids(dice, place, radii)
    return Boxes(exists & there, bounds, centre, matrix)


def _solids(dice: Dice, place: Place, radii: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Centres (B, O, 3), matrices (B, O, 3, 3), bounds (B, O, 5) and presence of some bodies."""
    count, number = radii.shape[:2]
    turned = dice.rotations(count, number) / radii[..., None]
    reach = _extent(turned)
    x, y, d, there = _positions(dice, place, reach[..., :2].amax(-1))
    # Bodies stay inside the range as far as they can: large ones are pressed flat.
    deep = reach[..., 2] / place.depth_px
    room = 0.5 * (place.high - place.low) + 0.02
    depth_px = place.depth_px * (deep / room).clamp_min(1)
    deep = torch.minimum(deep, room)
    scale = torch.stack([torch.ones_like(depth_px), torch.ones_like(depth_px), depth_px], -1)
    matrix = turned * scale[..., None, :]
    d = torch.minimum(d - deep * dice.uniform(0.2, 1, count, number), place.high - deep)
    bounds = torch.stack(
        [
            x - reach[..., 0],
            x + reach[..., 0],
            y - reach[..., 1],
            y + reach[..., 1],
            d.abs() + deep,
        ],
        -1,
    )
    return torch.stack([x, y, d], -1), matrix, bounds, there


def _extent(matrix: Tensor) -> Tensor:
    """Half the sides (..., 3) of the upright box around |q_i| <= 1, q = matrix p."""
    inverse: Tensor = torch.linalg.inv(matrix)
    return inverse.abs().sum(-1)


def _draw_reliefs(dice: Dice, place: Place) -> Reliefs:
    count = len(place.low)
    exists = dice.chance(0.5, count, 1)
    wavelength = dice.log_uniform(12, 1.5 * max(place.world), count, 1, WAVES)
    base = place.background[:, :1]
    steepest = dice.log_uniform(0.3, 6, count, 1) / place.depth_px
    # Plane and waves together, so that rays of every view meet the relief once.
    steepest = torch.minimum(steepest, STEEPEST_RELIEF - base[..., 1:].norm(dim=-1)).clamp_min(0)
    share = dice.uniform(0.1, 1, count, 1, WAVES)
    share = share / share.sum(-1, keepdim=True)
    frequency = 2 * math.pi / wavelength
    amplitude = steepest[..., None] * share / frequency
    # Waves together keep inside the scene's range.
    span = (place.high - place.low)[..., None]
    amplitude = amplitude * (0.4 * span / amplitude.sum(-1, keepdim=True)).clamp_max(1)
    angle = dice.uniform(0, 2 * math.pi, count, 1, WAVES)
    phase = dice.uniform(0, 2 * math.pi, count, 1, WAVES)
    waves = torch.stack([amplitude, frequency * angle.cos(), frequency * angle.sin(), phase], -1)
    coefficients = base.clone()
    swing = amplitude.sum(-1)
    base_top = base[..., 0] + 0.5 * sum(
        base[..., 1 + axis].abs() * side for axis, side in enumerate(place.size[::-1])
    )
    sunk = torch.maximum(swing * dice.uniform(0, 0.4, count, 1), base_top + swing - place.high)
    coefficients[..., 0] -= sunk
    endless = torch.tensor([-math.inf, math.inf, -math.inf, math.inf, 0.0])
    return Reliefs(exists, endless.expand(count, 1, 5), coefficients, waves)
