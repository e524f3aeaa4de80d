"""Exact truth: one ray through the centre of each pixel of the centre view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.synth.pathtraced.rig import VIEWS, Rig
from epinet.synth.pathtraced.stage import Stage

Array = NDArray[np.float64]

STEP_PX = 0.1
"""A change of disparity between neighbours beyond what the surfaces' slopes explain."""
EDGE_REACH_PX = 2
_NOTHING = ""


@dataclass(frozen=True)
class Truth:
    """What the pixels' centres of the centre view meet; each (H, W)."""

    depth_mm: Array
    """Along the optical axis; inf where there is nothing. Of mirrors and glass: their surface."""
    objects: NDArray[np.uint8]
    """Number of the scene's element, from 1; 0 where there is nothing."""
    unreliable: NDArray[np.bool_]
    """Mirror or glass, within a pixel."""


def trace(stage: Stage, rig: Rig) -> Truth:
    """The truth of a rig's centre view."""
    height, width = rig.camera.height_px, rig.camera.width_px
    y, x = np.mgrid[:height, :width].astype(np.float64)
    centre = VIEWS // 2
    rays = rig.rays(centre, centre, x, y).reshape(-1, 3)
    depth, names = cast_rays(stage, rig.position(centre, centre), rays)
    known = {name: index for index, name in enumerate(stage.objects)} | {_NOTHING: -1}
    index = np.array([known[name] for name in names]).reshape(height, width)
    numbers = np.array([*stage.objects.values(), 0], dtype=np.uint8)
    deceptive = np.array([*(name in stage.unreliable for name in stage.objects), False])
    return Truth(depth.reshape(height, width), numbers[index], _grown(deceptive[index], 1))


def cast_rays(stage: Stage, origin: Array, rays: Array) -> tuple[Array, list[str]]:
    """What rays (N, 3) from a point meet first.

    Returns:
        (N,) how often the ray's own length it is away (inf: nothing), and the shapes' names.
    """
    mi = stage.mi
    if mi.variant().startswith("scalar"):
        return _cast_one_by_one(stage, origin, rays)
    length = np.linalg.norm(rays, axis=1)
    unit = (rays / length[:, None]).T.astype(np.float32)
    directions = mi.Vector3f(*(mi.Float(axis) for axis in unit))
    hit = stage.scene.ray_intersect(mi.Ray3f(mi.Point3f(*origin.tolist()), directions))
    names = {int(number): name for number, name in _registered(stage).items()}
    pointers = np.array(_as_numbers(hit.shape))
    return np.array(hit.t, dtype=np.float64) / length, [names.get(int(p), "") for p in pointers]


def discontinuities(disparity_px: Array) -> NDArray[np.bool_]:
    """(H, W): near a step of the truth that no slope explains.

    A pixel is at a step where its disparity's second difference along x or y exceeds STEP_PX;
    all within EDGE_REACH_PX of such a pixel are marked.
    """
    step = np.zeros(disparity_px.shape, dtype=bool)
    for axis in (0, 1):
        bent = np.abs(np.diff(disparity_px, n=2, axis=axis)) > STEP_PX
        step |= np.pad(bent, [(1, 1) if a == axis else (0, 0) for a in (0, 1)])
    return _grown(step, EDGE_REACH_PX)


def _cast_one_by_one(stage: Stage, origin: Array, rays: Array) -> tuple[Array, list[str]]:
    mi = stage.mi
    distances, names = np.full(len(rays), np.inf), []
    for index, ray in enumerate(rays):
        length = float(np.linalg.norm(ray))
        hit = stage.scene.ray_intersect(mi.Ray3f(origin.tolist(), (ray / length).tolist()))
        found = hit.is_valid()
        distances[index] = hit.t / length if found else np.inf
        names.append(hit.shape.id() if found else _NOTHING)
    return distances, names


def _registered(stage: Stage) -> dict[int, str]:
    """Names of the scene's shapes by what a vectorised hit refers to them with."""
    numbers = np.array(_as_numbers(stage.scene.shapes_dr()))
    shapes = stage.scene.shapes()
    return {int(n): shape.id() for n, shape in zip(numbers, shapes, strict=True)}


def _as_numbers(shapes: Any) -> Any:
    import drjit as dr  # type: ignore[import-not-found,unused-ignore]

    return dr.reinterpret_array(dr.uint32_array_t(shapes), shapes)


def _grown(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """All pixels within `reach` of the mask, along both axes."""
    from scipy.ndimage import maximum_filter

    grown: NDArray[np.bool_] = maximum_filter(mask, size=2 * reach + 1)
    return grown
