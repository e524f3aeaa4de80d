"""What a scene is described with. Lengths in mm; x to the right, y up, z towards the camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

Vector = tuple[float, float, float]
Kind = Literal["diffuse", "plastic", "metal", "mirror", "glass", "thin glass"]

UNRELIABLE: frozenset[Kind] = frozenset({"mirror", "glass", "thin glass"})
"""Finishes that show something else than themselves: their pixels are marked as invalid."""


@dataclass(frozen=True)
class Finish:
    """What a surface is made of."""

    kind: Kind = "diffuse"
    colour: Vector = (0.7, 0.7, 0.7)
    """Linear RGB reflectance; of metal and glass, a tint."""
    texture: str | None = None
    """Instead of the colour: an asset, "textures/..." or "photos/..."."""
    tiles: tuple[float, float] = (1.0, 1.0)
    """How often the texture repeats along a face."""
    roughness: float = 0.2


MIRROR = Finish("mirror", (0.95, 0.95, 0.95))
GLASS = Finish("glass", (1.0, 1.0, 1.0))
THIN_GLASS = Finish("thin glass")
STEEL = Finish("metal", (0.62, 0.62, 0.65), roughness=0.15)
BRASS = Finish("metal", (0.8, 0.6, 0.3), roughness=0.25)


def paint(red: float, green: float, blue: float) -> Finish:
    """A matt colour without texture."""
    return Finish(colour=(red, green, blue))


def covered(texture: str, across: float = 1.0, down: float | None = None) -> Finish:
    """A matt textured surface; `across` and `down` repetitions of an asset."""
    return Finish(texture=texture, tiles=(across, across if down is None else down))


@dataclass(frozen=True)
class Model:
    """A model of the package `models`, resting with its lowest point at height `y`."""

    name: str
    size: float
    """Longest side of its bounding box."""
    x: float
    z: float
    """Where the middle of its bounding box stands."""
    turn: float = 0.0
    """Degrees about the vertical, counter-clockwise seen from above."""
    y: float = 0.0
    tip: tuple[float, float] = (0.0, 0.0)
    """Degrees about x, then z, before the turn: to lay it down."""
    finishes: Mapping[str, Finish] = field(default_factory=lambda: MappingProxyType({}))
    """Instead of its own materials, by their names; "*" stands for all others."""


@dataclass(frozen=True)
class Box:
    """A block whose lowest face lies at height `y`."""

    size: Vector
    x: float
    z: float
    finish: Finish
    turn: float = 0.0
    y: float = 0.0


@dataclass(frozen=True)
class Ball:
    """A sphere resting at height `y`."""

    radius: float
    x: float
    z: float
    finish: Finish
    y: float = 0.0


@dataclass(frozen=True)
class Rod:
    """A thin cylinder between two points."""

    start: Vector
    end: Vector
    radius: float
    finish: Finish


@dataclass(frozen=True)
class Panel:
    """A flat rectangle, seen from the side that it faces and from the other."""

    width: float
    height: float
    centre: Vector
    finish: Finish
    faces: Vector = (0.0, 0.0, 1.0)
    """Direction of its normal; lying ones show their upper edge towards -z."""


@dataclass(frozen=True)
class Lamp:
    """A rectangle that gives light towards a point."""

    width: float
    height: float
    centre: Vector
    towards: Vector
    light: Vector
    """Linear RGB radiance."""


Element = Model | Box | Ball | Rod | Panel | Lamp


@dataclass(frozen=True)
class Scene:
    """A scene, its light and the camera of the centre view."""

    name: str
    about: str
    elements: tuple[Element, ...]
    eye: Vector
    target: Vector
    ambient: Vector = (0.2, 0.2, 0.2)
    """Linear RGB radiance from everywhere around."""
    exposure: float = 1.0
    """Factor of linear values before they are clipped to 0..1."""
    disparity_px: tuple[float, float] = (-2.0, 2.0)
    """Of the farthest and the nearest pixel, whatever the size of the views."""
    focal_length_mm: float = 50.0
