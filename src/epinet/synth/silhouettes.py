"""Silhouettes: square tiles of alpha that cut the surfaces of rendered scenes to shape.

A thing stands alone inside its tile, or the tile repeats without a seam (fences, foliage); it is
solid or thin. Each of the four combinations has families for training scenes in `FAMILIES` and
others for validation scenes in `HELD_OUT`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import torch
from torch import Generator, Tensor

from epinet.errors import InputError
from epinet.synth import silhouette_held_out as unseen
from epinet.synth import silhouette_repeating as repeated
from epinet.synth import silhouette_solid as solid
from epinet.synth import silhouette_thin as slender
from epinet.synth.dice import Dice
from epinet.synth.tiles import Family, draw_mixed, edge

Kind = tuple[bool, bool]
"""(thin, repeating)"""

FAMILIES: Mapping[Kind, Mapping[str, Family]] = MappingProxyType(
    {
        (False, False): {
            "ellipses": Family(1.2, solid.ellipses, wraps=False),
            "boxes": Family(1.2, solid.boxes, wraps=False),
            "blocks": Family(1.0, solid.blocks, wraps=False),
            "polygons": Family(1.4, solid.polygons, wraps=False),
            "stars": Family(0.8, solid.stars, wraps=False),
            "blobs": Family(1.5, solid.blobs, wraps=False),
            "islands": Family(1.2, solid.islands, wraps=False),
            "rings": Family(0.7, solid.rings, wraps=False),
            "crescents": Family(0.6, solid.crescents, wraps=False),
            "leaves": Family(1.0, solid.leaves, wraps=False),
            "glyphs": Family(0.8, solid.glyphs, wraps=False),
            "plates": Family(1.0, solid.plates, wraps=False),
            "saws": Family(0.7, solid.saws, wraps=False),
        },
        (True, False): {
            "wires": Family(1.5, slender.wires, wraps=False),
            "twigs": Family(1.3, slender.twigs, wraps=False),
            "bars": Family(1.3, slender.bars, wraps=False),
            "hoops": Family(1.0, slender.hoops, wraps=False),
            "grass": Family(1.0, slender.grass, wraps=False),
            "lattices": Family(1.0, slender.lattices, wraps=False),
        },
        (False, True): {
            "leaf clutter": Family(2.0, repeated.leaf_clutter),
            "spots": Family(1.0, repeated.spots),
            "shards": Family(1.0, repeated.shards),
            "camouflage": Family(1.2, repeated.camouflage),
            "boards": Family(0.6, repeated.boards),
            "slats": Family(0.8, repeated.slats),
        },
        (True, True): {
            "fences": Family(1.5, repeated.fences),
            "grids": Family(1.2, repeated.grids),
            "nets": Family(1.0, repeated.nets),
            "cables": Family(1.0, repeated.cables),
            "perforated": Family(1.0, repeated.perforated),
            "brambles": Family(1.0, repeated.brambles),
        },
    }
)
"""Shapes of training scenes, by (thin, repeating)."""

HELD_OUT: Mapping[Kind, Mapping[str, Family]] = MappingProxyType(
    {
        (False, False): {
            "hearts": Family(1.0, unseen.hearts, wraps=False),
            "gears": Family(1.0, unseen.gears, wraps=False),
            "superellipses": Family(1.0, unseen.superellipses, wraps=False),
            "flowers": Family(1.0, unseen.flowers, wraps=False),
        },
        (True, False): {
            "spirals": Family(1.0, unseen.spirals, wraps=False),
            "zigzags": Family(1.0, unseen.zigzags, wraps=False),
            "springs": Family(1.0, unseen.springs, wraps=False),
            "wheels": Family(1.0, unseen.wheels, wraps=False),
        },
        (False, True): {
            "waves": Family(1.0, unseen.waves),
            "triangles": Family(1.0, unseen.triangles),
            "winding": Family(1.0, unseen.winding),
            "blossoms": Family(1.0, unseen.blossoms),
        },
        (True, True): {
            "honeycombs": Family(1.0, unseen.honeycombs),
            "zigzag wires": Family(1.0, unseen.zigzag_wires),
            "chains": Family(1.0, unseen.chains),
        },
    }
)
"""Shapes of validation scenes only, by (thin, repeating)."""

_CLEAR_BORDER = 2
_AT_ONCE = 1 << 22


def draw_silhouettes(
    g: Generator,
    n: int,
    side: int,
    *,
    thin: bool,
    repeating: bool,
    held_out: bool = False,
    device: str | torch.device = "cpu",
) -> Tensor:
    """(n, side, side) uint8 alpha: 255 on the surface, 0 beside it.

    Edges are hard or one texel wide, those of one tile in 25 a few texels.

    Args:
        g: a generator on the CPU; the same state gives the same tiles, on every device.
        side: texels, at least 64.
        thin: wires, bars and nets of 1 to 8 texels instead of solid shapes.
        repeating: tiles that continue seamlessly across their borders; otherwise a thing lies
            inside its tile, whose outermost 2 texels are 0.
        held_out: draw from `HELD_OUT` instead of `FAMILIES`.

    Raises:
        InputError: a side below 64.
    """
    if side < 64:
        raise InputError(f"a silhouette needs 64 texels at least, not {side}")
    dice = Dice(g, torch.device(device))
    families = (HELD_OUT if held_out else FAMILIES)[thin, repeating]
    out = torch.empty(n, side, side, dtype=torch.uint8, device=dice.device)
    step = max(1, _AT_ONCE // side**2)  # bounds the memory of the steps between
    for start in range(0, n, step):
        part = out[start : start + step]
        distance, _ = draw_mixed(families, dice, len(part), side)
        if not repeating:
            for border in (slice(None, _CLEAR_BORDER), slice(-_CLEAR_BORDER, None)):
                distance[:, border] = distance[:, :, border] = -1
        part.copy_((_alpha(dice, distance) * 255).round())
    return out


def _alpha(dice: Dice, distance: Tensor) -> Tensor:
    """(n, H, W) 0..1 of signed distances in texels; 0 wherever those are -1 or less."""
    n = len(distance)
    alpha = torch.where(dice.each_chance(n, 0.6), (distance > 0).float(), edge(distance))
    soft = torch.nonzero(torch.rand(n, generator=dice.g) < 0.04)[:, 0]
    if len(soft):
        own = soft.to(dice.device)
        depth = distance[own]
        width = dice.each(len(soft), 1, 5).minimum(depth.amax((-2, -1), keepdim=True))
        alpha[own] = (depth / width.clamp_min(1)).clamp(0, 1)
    return alpha
