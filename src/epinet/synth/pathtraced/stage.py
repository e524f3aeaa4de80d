"""From a description to a scene that Mitsuba can trace and render."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.synth.pathtraced.assets import Library
from epinet.synth.pathtraced.elements import (
    UNRELIABLE,
    Ball,
    Box,
    Element,
    Finish,
    Kind,
    Lamp,
    Model,
    Panel,
    Rod,
    Scene,
    Vector,
)
from epinet.synth.pathtraced.obj import Material, Part, read_mtl, read_obj, write_ply

Array = NDArray[np.float64]
Shapes = list[tuple[dict[str, Any], bool]]
"""Mitsuba's description of each shape, and whether it shows something else than itself."""

_GLOSSY_FROM = 0.3
_OPAQUE_FROM = 0.95
_BRIGHTEST = 0.85
"""No reflectance is above this: a white that returns all light makes endless paths."""


@dataclass(frozen=True)
class Stage:
    """A loaded scene."""

    mi: Any
    scene: Any
    """Mitsuba's."""
    objects: dict[str, int]
    """Number of the element (from 1) that each shape belongs to, by the shape's name."""
    unreliable: frozenset[str]
    """Names of the shapes of mirror or glass."""


def build(mi: Any, scene: Scene, library: Library, work: Path) -> Stage:
    """Load a scene.

    Args:
        mi: Mitsuba.
        scene: what to build.
        library: where models and textures come from.
        work: a folder for the models' parts.

    Raises:
        InputError: an asset that there is not.
    """
    builder = _Builder(mi, library, work)
    description: dict[str, Any] = {
        "type": "scene",
        "ambient": {"type": "constant", "radiance": {"type": "rgb", "value": list(scene.ambient)}},
    }
    objects: dict[str, int] = {}
    unreliable: set[str] = set()
    for number, element in enumerate(scene.elements, start=1):
        for part, (shape, deceptive) in enumerate(builder.shapes(number, element)):
            name = f"element{number}part{part}"
            description[name] = shape
            objects[name] = number
            if deceptive:
                unreliable.add(name)
    loaded = mi.load_dict(description, optimize=False)  # as it merges shapes, names and all
    return Stage(mi, loaded, objects, frozenset(unreliable))


def resting_parts(model: Model, parts: dict[str, Part]) -> dict[str, Part]:
    """A model's parts at its place: turned, scaled, and its lowest point at height y."""
    turned = _about_y(model.turn) @ _about_z(model.tip[1]) @ _about_x(model.tip[0])
    original = np.concatenate([part.positions for part in parts.values()])
    scale = model.size / float(np.ptp(original, axis=0).max())
    corners = original @ turned.T * scale
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    offset = np.array([model.x, model.y, model.z]) - middle
    return {
        name: Part(part.positions @ turned.T * scale + offset, part.normals @ turned.T, part.uv)
        for name, part in parts.items()
    }


class _Builder:
    def __init__(self, mi: Any, library: Library, work: Path) -> None:
        self.mi, self.library, self.work = mi, library, work
        self.transform = mi.ScalarTransform4f

    def shapes(self, number: int, element: Element) -> Shapes:
        match element:
            case Model():
                return self._model(number, element)
            case Lamp():
                return [(self._lamp(element), False)]
            case Ball():
                centre = [element.x, element.y + element.radius, element.z]
                shape = {"type": "sphere", "center": centre, "radius": element.radius}
            case Rod():
                ends = {"p0": list(element.start), "p1": list(element.end)}
                shape = {"type": "cylinder", **ends, "radius": element.radius}
            case Box():
                shape = {"type": "cube", "to_world": self._box(element)}
            case Panel():
                shape = {"type": "rectangle", "to_world": self._panel(element)}
        bsdf = self._bsdf(element.finish)
        return [({**shape, "bsdf": bsdf}, element.finish.kind in UNRELIABLE)]

    def _box(self, box: Box) -> Any:
        half = [side / 2 for side in box.size]
        place = self.transform().translate([box.x, box.y + half[1], box.z])
        return place.rotate([0, 1, 0], box.turn).scale(half)

    def _panel(self, panel: Panel) -> Any:
        return self._facing(panel.centre, panel.faces).scale([panel.width / 2, panel.height / 2, 1])

    def _facing(self, centre: Vector, direction: Vector) -> Any:
        """Turns +z to a direction, keeping +y as far up as that allows."""
        forward = np.array(direction) / np.linalg.norm(direction)
        up = (0.0, 0.0, -1.0) if abs(forward[1]) > 0.99 else (0.0, 1.0, 0.0)
        right = np.cross(up, forward)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
        matrix[:3, 3] = centre
        return self.transform(matrix)

    def _lamp(self, lamp: Lamp) -> dict[str, Any]:
        direction = np.array(lamp.towards) - np.array(lamp.centre)
        place = self._facing(lamp.centre, (direction[0], direction[1], direction[2]))
        return {
            "type": "rectangle",
            "to_world": place.scale([lamp.width / 2, lamp.height / 2, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(lamp.light)}},
        }

    def _model(self, number: int, model: Model) -> Shapes:
        folder = f"{model.name}/{model.name}"
        path = self.library.file("models", f"{folder}.obj")
        materials = read_mtl(self.library.file("models", f"{folder}.mtl"))
        shapes: Shapes = []
        for index, (name, part) in enumerate(resting_parts(model, read_obj(path)).items()):
            finish = model.finishes.get(name, model.finishes.get("*"))
            own = materials.get(name, Material())
            kind: Kind = finish.kind if finish else _own_kind(own)
            bsdf = self._bsdf(finish) if finish else self._own_bsdf(model.name, own)
            file = self.work / f"element{number}part{index}.ply"
            write_ply(file, part)
            shape = {"type": "ply", "filename": str(file), "bsdf": bsdf}
            shapes.append((shape, kind in UNRELIABLE))
        return shapes

    def _own_bsdf(self, model: str, material: Material) -> dict[str, Any]:
        colour: dict[str, Any] = _rgb(material.colour)
        if material.texture:
            file = self.library.file("models", f"{model}/{material.texture}")
            colour = {"type": "bitmap", "filename": str(file)}
        return _bsdf_of(_own_kind(material), colour, roughness=0.2)

    def _bsdf(self, finish: Finish) -> dict[str, Any]:
        if finish.texture is None:
            return _bsdf_of(finish.kind, _rgb(finish.colour), finish.roughness)
        kind, _, name = finish.texture.partition("/")
        if kind not in ("textures", "photos"):
            raise InputError(f"{finish.texture}: textures are named textures/... or photos/...")
        colour = {
            "type": "bitmap",
            "filename": str(self.library.file(kind, name)),
            "to_uv": self.transform().scale([finish.tiles[0], -finish.tiles[1], 1]),  # v is upwards
        }
        return _bsdf_of(finish.kind, colour, finish.roughness)


def _own_kind(material: Material) -> Kind:
    if material.opacity < _OPAQUE_FROM:
        return "thin glass"
    return "plastic" if material.specular >= _GLOSSY_FROM else "diffuse"


def _bsdf_of(kind: Kind, colour: dict[str, Any], roughness: float) -> dict[str, Any]:
    if kind == "glass":
        return {"type": "dielectric", "int_ior": 1.5, "specular_transmittance": colour}
    if kind == "thin glass":
        return {"type": "thindielectric", "int_ior": 1.5}
    inner: dict[str, Any] = {"type": "diffuse", "reflectance": colour}
    if kind == "plastic":
        inner = {"type": "roughplastic", "diffuse_reflectance": colour, "alpha": roughness}
    elif kind == "mirror":
        inner = {"type": "conductor", "material": "none", "specular_reflectance": colour}
    elif kind == "metal":
        inner = {"type": "roughconductor", "material": "none", "specular_reflectance": colour}
        inner["alpha"] = roughness
    return {"type": "twosided", "inner": inner}


def _rgb(colour: Vector) -> dict[str, Any]:
    return {"type": "rgb", "value": [min(value, _BRIGHTEST) for value in colour]}


def _about_x(degrees: float) -> Array:
    return _rotation(degrees, (1, 2))


def _about_y(degrees: float) -> Array:
    return _rotation(degrees, (2, 0))


def _about_z(degrees: float) -> Array:
    return _rotation(degrees, (0, 1))


def _rotation(degrees: float, plane: tuple[int, int]) -> Array:
    """(3, 3): turns the first axis of the plane towards the second."""
    first, second = plane
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(np.radians(degrees))
    matrix[second, first] = np.sin(np.radians(degrees))
    matrix[first, second] = -matrix[second, first]
    return matrix
