"""Models: reading OBJ with its materials, writing PLY for Mitsuba."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SMOOTH_LIMIT = 0.3
"""A vertex normal whose cosine with the triangle's own is below this is not believed."""


@dataclass(frozen=True)
class Part:
    """The triangles of one material; corners are not shared."""

    positions: Array
    """(3 * triangles, 3)."""
    normals: Array
    """(3 * triangles, 3), of unit length."""
    uv: Array
    """(3 * triangles, 2) as in OBJ: v upwards; zeros where the model has none."""


@dataclass(frozen=True)
class Material:
    """What epinet takes from a material of an MTL file."""

    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    specular: float = 0.0
    opacity: float = 1.0
    texture: str | None = None
    """File name beside the model."""


def read_obj(path: Path) -> dict[str, Part]:
    """The parts of a model by material; polygons are cut into fans of triangles."""
    points: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: dict[str, list[tuple[int, int, int]]] = defaultdict(list)
    material = ""
    for line in path.read_text(encoding="latin-1").splitlines():
        kind, *words = line.split() or [""]
        if kind in points:
            points[kind].append([float(word) for word in words[:3]])
        elif kind == "usemtl":
            material = words[0] if words else ""
        elif kind == "f":
            polygon = [_corner(word, points) for word in words]
            for second, third in pairwise(polygon[1:]):
                corners[material] += [polygon[0], second, third]
    vertices = np.array(points["v"], dtype=np.float64)
    textures = np.array([uv[:2] for uv in [*points["vt"], [0.0, 0.0]]])
    normals = np.array([*points["vn"], [0.0, 0.0, 0.0]])
    return {
        name: _part(np.array(index), vertices, textures, normals) for name, index in corners.items()
    }


def read_mtl(path: Path) -> dict[str, Material]:
    """The materials of an MTL file by name; empty where there is no such file."""
    if not path.exists():
        return {}
    entries: dict[str, dict[str, list[str]]] = {}
    current: dict[str, list[str]] = {}
    for line in path.read_text(encoding="latin-1").splitlines():
        key, *words = line.split() or [""]
        if key == "newmtl":
            current = entries.setdefault(words[0] if words else "", {})
        else:
            current[key] = words
    return {name: _material(entry) for name, entry in entries.items()}


def write_ply(path: Path, part: Part) -> None:
    """Write triangles as binary PLY with v downwards, as Mitsuba's bitmaps take it."""
    count = len(part.positions)
    uv = part.uv * (1, -1) + (0, 1)
    table = np.hstack([part.positions, part.normals, uv]).astype("<f4")
    faces = np.empty(count // 3, dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, np.arange(count).reshape(-1, 3)
    names = "".join(
        f"property float {name}\n" for name in ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
    )
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}"
        f"element face {count // 3}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode("ascii") + table.tobytes() + faces.tobytes())


def _corner(word: str, points: dict[str, list[list[float]]]) -> tuple[int, int, int]:
    """Indexes (v, vt, vn) from 0; -1 where there is none; negative ones count from the end."""
    parts = [*word.split("/"), "", ""][:3]
    counts = (len(points["v"]), len(points["vt"]), len(points["vn"]))
    v, vt, vn = (
        -1 if not text else int(text) - 1 if int(text) > 0 else count + int(text)
        for text, count in zip(parts, counts, strict=True)
    )
    return v, vt, vn


def _part(index: NDArray[np.int_], vertices: Array, textures: Array, normals: Array) -> Part:
    positions = vertices[index[:, 0]].reshape(-1, 3, 3)
    facing = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    area = np.linalg.norm(facing, axis=1)
    keep = area > 1e-12 * max(float(area.max()), 1e-30)
    flat = np.repeat(facing[keep] / area[keep, None], 3, axis=0)
    corners = index.reshape(-1, 3, 3)[keep].reshape(-1, 3)
    smooth = normals[corners[:, 2]]
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    smooth = smooth / np.maximum(length, 1e-9)
    believed = (smooth * flat).sum(axis=1) > _SMOOTH_LIMIT
    return Part(
        positions[keep].reshape(-1, 3),
        np.where(believed[:, None], smooth, flat),
        textures[corners[:, 1]],
    )


def _material(entry: dict[str, list[str]]) -> Material:
    red, green, blue = (float(word) for word in entry.get("Kd", ["0.7"] * 3)[:3])
    texture = " ".join(entry["map_Kd"]) if entry.get("map_Kd") else None
    return Material(
        colour=(red, green, blue),
        specular=max((float(word) for word in entry.get("Ks", [])[:3]), default=0.0),
        opacity=float(entry.get("d", ["1"])[0]),
        texture=texture,
    )
