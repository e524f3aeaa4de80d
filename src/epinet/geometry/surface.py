"""A surface in space from a disparity map, cut where one thing ends and another begins.

Neighbouring pixels belong to one surface unless their disparities differ by more than

    NOISE_PX + tan(STEEPEST_DEG) * d' / focal_px,

d' being the disparity counted from infinity. A plane whose normal makes the angle s with the line
of sight changes by tan(s) * d' / focal_px per pixel (d' / focal_px is baseline / depth), so the
limit holds together every surface up to that slant, whatever its distance, and no jump beyond it
is bridged. NOISE_PX is what the estimate itself may change by from pixel to pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.geometry.points import project, unproject

NOISE_PX = 0.03
FAR_PX = 0.1
"""Disparity from infinity below which noise moves a point by a third of its depth, or more."""
STEEPEST_DEG = 80.0
SMALLEST_PIECE = 5e-4
"""Pieces of fewer points than this share of the picture's pixels are left out."""


@dataclass(frozen=True)
class Surface:
    """Triangles, or only points where there are no faces, with the colours of the centre view."""

    points_mm: NDArray[np.float64]
    """(N, 3), axes as in `epinet.geometry.points`."""
    faces: NDArray[np.int64]
    """(M, 3) rows of points, counter-clockwise as the camera sees them."""
    pixels: NDArray[np.float64]
    """(N, 2) where in the picture each point is seen: x, y."""
    picture: NDArray[np.uint8]
    """(H, W, 3) the centre view."""

    @property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) the picture's colour at each point."""
        x, y = self.pixels.T
        channels = [map_coordinates(c, [y, x], order=1, mode="nearest") for c in self._channels()]
        return np.stack(channels, axis=1).round().astype(np.uint8)

    @property
    def uv(self) -> NDArray[np.float64]:
        """(N, 2) texture coordinates in 0..1, from the bottom left."""
        height, width = self.picture.shape[:2]
        x, y = self.pixels.T
        return np.stack([(x + 0.5) / width, 1 - (y + 0.5) / height], axis=1)

    def simplified(self, faces: int, camera: Camera) -> Surface:
        """The surface with at most about so many faces; as it is where it has no more.

        Colours and texture follow: each new point is looked up where the camera sees it.
        """
        if faces >= len(self.faces):
            return self
        from fast_simplification import simplify

        size_mm = np.ptp(self.points_mm, axis=0).max()  # its thresholds are made for sizes about 1
        points, kept = simplify(self.points_mm / size_mm, self.faces, target_count=faces)
        points = points * size_mm
        height, width = self.picture.shape[:2]
        pixels = np.clip(project(points, camera), 0, [width - 1, height - 1])
        return replace(self, points_mm=points, faces=kept.astype(np.int64), pixels=pixels)

    def describe(self) -> str:
        """Counts and extent, for people."""
        what = f"{len(self.points_mm)} points"
        if len(self.faces):
            what += f", {len(self.faces)} faces"
        size = " x ".join(f"{mm:.4g}" for mm in np.ptp(self.points_mm, axis=0))
        near, far = -self.points_mm[:, 2].max(), -self.points_mm[:, 2].min()
        return f"{what}; {size} mm (width, height, depth), {near:.4g} to {far:.4g} mm away"

    def as_points(self) -> Surface:
        """The points alone."""
        return replace(self, faces=np.empty((0, 3), np.int64))

    def _channels(self) -> NDArray[np.float32]:
        return np.moveaxis(self.picture.astype(np.float32), 2, 0)


def farthest_mm(camera: Camera) -> float:
    """Depth up to which a disparity map says where things are."""
    return camera.baseline_focal_mm_px / FAR_PX


def largest_step_px(disparity: NDArray[Any], camera: Camera) -> NDArray[np.float64]:
    """(H, W) by how much the disparity may change to the next pixel on one surface."""
    from_infinity = np.maximum(camera.disparity_from_infinity_px(disparity), 0)
    return NOISE_PX + math.tan(math.radians(STEEPEST_DEG)) * from_infinity / camera.focal_px


def surface(
    disparity: NDArray[np.float32],
    picture: NDArray[np.uint8],
    camera: Camera,
    *,
    keep: NDArray[np.bool_] | None = None,
    cut_px: float | None = None,
) -> Surface:
    """The surface that a disparity map shows, a point for each pixel, cut at depth edges.

    Args:
        disparity: (H, W); where it is not finite, or the depth infinite, there is no surface.
        picture: (H, W, 3) the centre view.
        camera: of these views.
        keep: (H, W) pixels to take; None takes all.
        cut_px: cut where neighbours differ by more, instead of by the rule above; inf cuts
            nowhere.

    Raises:
        InputError: nothing is left.
    """
    depth = camera.depth_mm(disparity)
    valid = np.isfinite(depth) if keep is None else np.isfinite(depth) & keep
    if not valid.any():
        raise InputError(
            "no pixel is left to make a mesh of: all are without disparity, infinitely far, or "
            "left out by the limits that were asked for"
        )
    limit = largest_step_px(disparity, camera) if cut_px is None else np.full(depth.shape, cut_px)
    faces = _without_crumbs(grid_faces(disparity, valid, limit), depth.size)
    if not len(faces):
        raise InputError(
            "no surface is left after cutting at depth edges: all neighbouring pixels differ "
            "too much, or the pieces are tiny; cut less (--cut-px)"
        )
    used, rows = np.unique(faces, return_inverse=True)
    points = unproject(depth, camera).reshape(-1, 3)[used]
    y, x = np.divmod(used, depth.shape[1])
    pixels = np.stack([x, y], axis=1).astype(np.float64)
    return Surface(points, rows.reshape(-1, 3), pixels, picture)


def grid_faces(
    values: NDArray[Any], valid: NDArray[np.bool_], limit: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Triangles (M, 3) of pixel numbers, two of them per square of four pixels of one surface.

    Neighbours are joined where both are valid and their values differ by no more than the limit
    of one of them. A triangle stands if its two sides along row and column do; its diagonal then
    changes by no more than both. Of a square's two diagonals the one with more triangles is
    taken, and of equals the one along which the values change less.
    """
    across = _joined(values, valid, limit, axis=1)
    down = _joined(values, valid, limit, axis=0)
    top, bottom, left, right = across[:-1], across[1:], down[:, :-1], down[:, 1:]
    numbers = np.arange(values.size).reshape(values.shape)
    a, b, c, d = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]
    falling = ((left & bottom, (a, c, d)), (top & right, (a, d, b)))
    rising = ((left & top, (a, c, b)), (bottom & right, (c, d, b)))
    counts = [sum(there.astype(np.int8) for there, _ in pair) for pair in (falling, rising)]
    with np.errstate(invalid="ignore"):
        step_falling = np.abs(values[:-1, :-1] - values[1:, 1:])
        step_rising = np.abs(values[:-1, 1:] - values[1:, :-1])
        falls = (counts[0] > counts[1]) | ((counts[0] == counts[1]) & (step_falling <= step_rising))
    triangles = [
        np.stack([corner[there & chosen] for corner in corners], axis=1)
        for pair, chosen in ((falling, falls), (rising, ~falls))
        for there, corners in pair
    ]
    return np.concatenate(triangles).astype(np.int64)


def _joined(
    values: NDArray[Any],
    valid: NDArray[np.bool_],
    limit: NDArray[np.float64],
    axis: int,
) -> NDArray[np.bool_]:
    """Which pixels lie on one surface with the next one along the axis."""
    one, other = [slice(None)] * 2, [slice(None)] * 2
    one[axis], other[axis] = slice(None, -1), slice(1, None)
    a, b = tuple(one), tuple(other)
    with np.errstate(invalid="ignore"):
        step = np.abs(values[a] - values[b])
        near = step <= np.maximum(limit[a], limit[b])
    return np.asarray(valid[a] & valid[b] & near)


def _without_crumbs(faces: NDArray[np.int64], pixels: int) -> NDArray[np.int64]:
    """Faces without those of tiny pieces, which edges of the estimate leave in the air."""
    ends = faces[:, [0, 1, 0, 2]].reshape(-1, 2).T
    graph = coo_array((np.ones(ends.shape[1], np.int8), tuple(ends)), shape=(pixels, pixels))
    piece = connected_components(graph, directed=False)[1]
    points = np.bincount(piece)
    kept: NDArray[np.int64] = faces[points[piece[faces[:, 0]]] >= max(3, SMALLEST_PIECE * pixels)]
    return kept
