"""Surfaces as GLB, PLY and OBJ, solids as STL.

GLB is in metres, as glTF rules; the others are in mm. Axes are those of `epinet.geometry.points`.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from epinet.errors import InputError
from epinet.geometry.surface import Surface
from epinet.io.atomic import atomic_path
from epinet.srgb import to_light

if TYPE_CHECKING:
    import trimesh

SURFACE_SUFFIXES = (".glb", ".ply", ".obj")
SOLID_SUFFIX = ".stl"
SUFFIXES = (*SURFACE_SUFFIXES, SOLID_SUFFIX)

_MM_PER_M = 1000.0


def is_solid(path: Path) -> bool:
    """Whether a file of this name holds a solid to print, not a surface."""
    return path.suffix.lower() == SOLID_SUFFIX


def check_suffix(path: Path, points_only: bool) -> None:
    """Refuse, before any work, what cannot be written.

    Raises:
        InputError: another ending, or points as STL.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: a mesh is written as {', '.join(SUFFIXES)}, by the name's end")
    if points_only and is_solid(path):
        raise InputError(
            f"{path}: STL holds no points; take {', '.join(SURFACE_SUFFIXES)}, or leave --points"
        )


def write_surface(path: str | Path, surface: Surface) -> list[Path]:
    """Write a surface by the ending of its name, points alone where it has no faces.

    - GLB: metres, normals, the centre view as texture (points: their colours).
    - PLY: mm, binary, normals, a colour for each point.
    - OBJ: mm, normals, and beside it NAME_texture.png and NAME.mtl (points: x y z r g b).

    Returns:
        The files written.

    Raises:
        InputError: another ending, or an unwritable path.
    """
    path = Path(path)
    check_suffix(path, points_only=not len(surface.faces))
    if path.suffix.lower() == ".obj" and len(surface.faces):
        return _write_obj(path, surface)
    data = _glb(surface) if path.suffix.lower() == ".glb" else _in_mm(path.suffix.lower(), surface)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)
    return [path]


def write_solid(path: str | Path, solid: trimesh.Trimesh) -> None:
    """Write a solid as binary STL, in the units it has.

    Raises:
        InputError: the path cannot be written.
    """
    from trimesh.exchange.stl import export_stl

    with atomic_path(path) as temporary:
        temporary.write_bytes(export_stl(solid))


def _glb(surface: Surface) -> bytes:
    from trimesh import Scene
    from trimesh.exchange.gltf import export_glb
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    shown = _shown(surface)
    if not len(surface.faces):  # glTF's colours of vertices are linear light
        colours = surface.colours.copy()
        colours[:, :3] = np.round(255 * to_light(colours[:, :3] / 255)).astype(np.uint8)
        shown.colors = colours
    else:
        material = PBRMaterial(
            name="centre_view",
            baseColorTexture=Image.fromarray(surface.picture),
            metallicFactor=0.0,
            roughnessFactor=1.0,
            doubleSided=True,
        )
        shown.visual = TextureVisuals(uv=surface.uv, material=material)
    shown.apply_scale(1 / _MM_PER_M)
    glb: bytes = export_glb(Scene({"surface": shown}), include_normals=bool(len(surface.faces)))
    return glb


def _in_mm(suffix: str, surface: Surface) -> bytes:
    """PLY, and the points of OBJ."""
    more = {"vertex_normal": True} if len(surface.faces) else {}
    exported = _shown(surface).export(file_type=suffix[1:], **more)
    return exported if isinstance(exported, bytes) else exported.encode()


def _shown(surface: Surface) -> trimesh.Trimesh | trimesh.PointCloud:
    """The surface as trimesh holds it, with a colour for each point."""
    import trimesh

    if not len(surface.faces):
        return trimesh.PointCloud(surface.points_mm, colors=surface.colours)
    return trimesh.Trimesh(
        surface.points_mm,
        surface.faces,
        vertex_colors=surface.colours,
        process=False,
    )


def _write_obj(path: Path, surface: Surface) -> list[Path]:
    """Three files, the one that names the others last."""
    from trimesh.exchange.obj import export_obj
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import SimpleMaterial

    shown = _shown(surface)
    name = "_".join(path.stem.split())  # readers disagree about blanks in the names inside
    white, black = [255, 255, 255, 255], [0, 0, 0, 255]
    material = SimpleMaterial(
        name=f"{name}_texture",
        image=Image.fromarray(surface.picture),
        ambient=white,
        diffuse=white,
        specular=black,
    )
    shown.visual = TextureVisuals(uv=surface.uv, material=material)
    text, beside = export_obj(
        shown, include_normals=True, return_texture=True, mtl_name=f"{name}.mtl", header="epinet"
    )
    files = {path.with_name(other): data for other, data in beside.items()} | {path: text.encode()}
    with ExitStack() as stack:
        for file, data in reversed(files.items()):
            stack.enter_context(atomic_path(file)).write_bytes(data)
    return list(files)
