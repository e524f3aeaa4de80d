"""A solid to print from a depth map: closed on all sides, on a base.

The solid is what lies behind the surface: each ray from the camera is filled from the surface to a
plane behind everything. Rays never cross, so neither do its walls, however the surface jumps; a
jump becomes a wall, not a hole. It stands on its back: z is up from the base, x to the right and
y up in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.geometry.points import unproject
from epinet.geometry.surface import grid_faces

if TYPE_CHECKING:
    import trimesh

NEAREST_PERCENTILE, FARTHEST_PERCENTILE = 0.5, 99.5
"""Depths beyond these are flattened, unless bounds are given: a few wrong pixels would otherwise
set the size of all."""
_BEHIND = 1.001
"""Where the rays end, in farthest depths: behind all, so that no wall has height 0."""


@dataclass(frozen=True)
class Print:
    """How large a solid becomes; all in mm as printed."""

    size_mm: float = 100.0
    """Longer side of the base."""
    base_mm: float = 3.0
    """Thickness below the farthest point."""
    relief_mm: float | None = None
    """Height from the farthest point to the nearest; None keeps the true proportions."""

    def __post_init__(self) -> None:
        lengths = {"size": self.size_mm, "base": self.base_mm, "relief": self.relief_mm}
        problems = [
            f"the {name} of the print must be more than 0 mm, not {mm}"
            for name, mm in lengths.items()
            if mm is not None and not 0 < mm < np.inf
        ]
        if problems:
            raise InputError(problems)


@dataclass(frozen=True)
class Solid:
    """A closed solid in mm as printed, and what it was made of."""

    mesh: trimesh.Trimesh
    nearest_mm: float
    """True depths between which the surface runs; what lay beyond was flattened."""
    farthest_mm: float
    scale: float
    """Printed over true size, across the picture."""

    def describe(self) -> str:
        """Size and scale, for people."""
        size = " x ".join(f"{mm:.4g}" for mm in self.mesh.extents)
        return (
            f"{len(self.mesh.faces)} faces, closed; {size} mm as printed, across the picture "
            f"1:{1 / self.scale:.4g}; depths outside {self.nearest_mm:.5g}.."
            f"{self.farthest_mm:.5g} mm are flattened"
        )


def solid(
    depth_mm: NDArray[Any],
    camera: Camera,
    how: Print | None = None,
    *,
    near_mm: float | None = None,
    far_mm: float | None = None,
    faces: int | None = None,
) -> Solid:
    """A watertight solid of a depth map (H, W).

    Pixels without depth take that of the nearest pixel that has one.

    Args:
        depth_mm: along the optical axis; inf and NaN are allowed.
        camera: of these views.
        how: its size.
        near_mm: nearer depths are flattened to this; None: NEAREST_PERCENTILE.
        far_mm: farther ones to this; None: FARTHEST_PERCENTILE of the finite ones.
        faces: at most about so many, from fewer pixels; None: two for each pixel.

    Raises:
        InputError: no pixel has a depth, or the bounds leave none.
    """
    import trimesh

    how = how or Print()
    depth, near, far = _bounded(np.asarray(depth_mm, np.float64), near_mm, far_mm)
    back = far * _BEHIND
    behind = unproject(np.full_like(depth, back), camera)
    scale = how.size_mm / np.ptp(behind[..., :2], axis=(0, 1)).max()
    upright = scale
    if how.relief_mm is not None and far - near > 1e-6 * far:
        upright = how.relief_mm / (far - near)
    by_axis = np.array([scale, scale, upright])
    to_base = np.array([0, 0, how.base_mm + upright * back])
    thinned = np.ix_(*_thinned(depth.shape, faces))
    top, foot = (
        points[thinned] * by_axis + to_base for points in (unproject(depth, camera), behind)
    )
    points, triangles = _closed(top, foot)
    mesh = trimesh.Trimesh(points, triangles, process=False)
    return Solid(mesh, near, far, float(scale))


def _thinned(shape: tuple[int, ...], faces: int | None) -> list[NDArray[np.int64]]:
    """Rows and columns of pixels to take for at most about so many faces, evenly spread.

    Collapsing edges would keep the shape better, but where thin walls meet it leaves edges with
    four faces, which are not closed; a grid always is.
    """
    share = 1.0 if faces is None else min(1.0, (faces / (2 * shape[0] * shape[1])) ** 0.5)
    return [np.linspace(0, n - 1, max(2, int(n * share))).round().astype(np.int64) for n in shape]


def _bounded(
    depth: NDArray[np.float64], near_mm: float | None, far_mm: float | None
) -> tuple[NDArray[np.float64], float, float]:
    """A depth at every pixel, between the two bounds, and the bounds."""
    finite = depth[np.isfinite(depth)]
    if not finite.size:
        raise InputError("no pixel has a finite depth: there is nothing to make a solid of")
    near = float(np.percentile(finite, NEAREST_PERCENTILE)) if near_mm is None else near_mm
    far = float(np.percentile(finite, FARTHEST_PERCENTILE)) if far_mm is None else far_mm
    if not 0 < near <= far or near > finite.max() or far < finite.min():
        raise InputError(
            f"nothing lies between {near:g} mm and {far:g} mm: the depths are "
            f"{finite.min():g}..{finite.max():g} mm; choose other bounds (--near-mm, --far-mm)"
        )
    unknown = np.isnan(depth)
    if unknown.any():
        rows, cols = distance_transform_edt(unknown, return_distances=False, return_indices=True)
        depth = depth[rows, cols]
    return np.clip(depth, near, far), near, far


def _closed(
    top: NDArray[np.float64], foot: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points and faces of the solid between the surface (H, W, 3), the plane behind it (H, W, 3)
    and the ground, z = 0."""
    height, width = top.shape[:2]
    numbers = np.arange(height * width).reshape(height, width)
    # Around the picture, counter-clockwise as seen from above.
    rim = np.concatenate([numbers[:-1, 0], numbers[-1, :-1], numbers[:0:-1, -1], numbers[0, :0:-1]])
    foot_rim = foot.reshape(-1, 3)[rim]
    points = [top.reshape(-1, 3), foot_rim, foot_rim * [1, 1, 0], np.zeros((1, 3))]
    everywhere = np.ones((height, width), dtype=bool)
    faces = [grid_faces(top[..., 2], everywhere, np.full((height, width), np.inf))]
    upper, next_number = rim, height * width
    for _ in range(2):  # along the rays to the foot, then upright to the ground
        lower = np.arange(next_number, next_number + len(rim))
        upper_next, lower_next = np.roll(upper, -1), np.roll(lower, -1)
        faces += [
            np.stack([upper, lower, lower_next], axis=1),
            np.stack([upper, lower_next, upper_next], axis=1),
        ]
        upper, next_number = lower, next_number + len(rim)
    middle = np.full(len(rim), next_number)
    faces.append(np.stack([middle, np.roll(upper, -1), upper], axis=1))
    return np.concatenate(points), np.concatenate(faces)
