"""A heap without floating or interlocking things, drawn from a seed."""

from __future__ import annotations

from math import hypot

import numpy as np

from epinet.synth.pathtraced.elements import Ball, Box, Element, Model, covered

_STONES = ("rock1", "rock2", "rock3")
_COVERS = (
    "textures/red-wood.png",
    "textures/steel-scratched.png",
    "textures/green-wood.png",
    "textures/wood-tiles.png",
    "photos/coffee.png",
    "photos/chelsea.png",
    "photos/camera.png",
    "textures/bread.png",
    "textures/blue-wood.png",
)
_GAP_MM = 15.0
_TRIES = 4000


def pile(seed: int, things: int = 46) -> tuple[Element, ...]:
    """At most so many things on the floor around the middle, small ones on top of boxes.

    Each stands inside a circle of its own, so that none touches another whatever its turn.
    """
    rng = np.random.default_rng(seed)
    placed: list[tuple[float, float, float]] = []
    elements: list[Element] = []
    for _ in range(_TRIES):
        if len(placed) == things:
            break
        radius = float(rng.uniform(70, 190))
        x, z = float(rng.uniform(-850, 850)), float(rng.uniform(-1000, 620))
        if all(hypot(x - px, z - pz) > radius + other + _GAP_MM for px, pz, other in placed):
            placed.append((x, z, radius))
            elements += _thing(rng, x, z, radius)
    return tuple(elements)


def _thing(rng: np.random.Generator, x: float, z: float, radius: float) -> list[Element]:
    """Something inside the circle, perhaps with something on it."""
    turn, kind = float(rng.uniform(0, 360)), rng.integers(5)
    cover = covered(str(rng.choice(_COVERS)))
    if kind == 0:
        return [Ball(radius * 0.8, x, z, cover)]
    if kind == 1:
        return [Model(str(rng.choice(_STONES)), radius * 1.5, x, z, turn)]
    if kind == 2:
        return [Model("barrel", radius * 1.7, x, z, turn)]
    width, depth = radius * float(rng.uniform(1.1, 1.5)), radius * float(rng.uniform(0.9, 1.2))
    height = radius * float(rng.uniform(0.6, 2.2))
    below = Box((width, height, depth), x, z, cover, turn)
    return [below, *_on_top(rng, x, z, height, min(width, depth))]


def _on_top(
    rng: np.random.Generator, x: float, z: float, height: float, side: float
) -> list[Element]:
    turn, cover = float(rng.uniform(0, 360)), covered(str(rng.choice(_COVERS)))
    match int(rng.integers(4)):
        case 0:
            return [Ball(side * 0.35, x, z, cover, y=height)]
        case 1:
            return [Model("crate", side * 0.65, x, z, turn, y=height)]
        case 2:
            return [Box((side * 0.65, side * 0.4, side * 0.5), x, z, cover, turn, y=height)]
    return []
