"""Focus set afterwards: views shifted onto a focal surface and added up, as a large lens would.

A focal surface is a disparity for each pixel. A constant one is the focus plane of an ordinary
lens; one that changes linearly over the picture is a tilted plane in space, as 1/Z is linear
there; the disparity map itself brings everything into focus. What lies off the surface is blurred
by as many pixels as its disparity differs, times the aperture in views. Where neighbouring views
are more than about a pixel apart, the blur shows as ghosts: only as many views are there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from epinet.effects.light import to_light, to_samples
from epinet.errors import InputError
from epinet.lightfield import LightField

_HIDDEN_PX = 0.3
"""A point is hidden in a view if one nearer by more disparity is seen at its place."""


def refocus(
    lf: LightField,
    focus_px: float | NDArray[Any],
    aperture: float | None = None,
    *,
    disparity: NDArray[np.float32] | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) that a lens as wide as the grid would take.

    Args:
        lf: the views; those that are not there are left out.
        focus_px: disparity of what is sharp, one or (H, W).
        aperture: radius of the lens in steps from view to view: 0 is the centre view alone; None
            is as wide as the grid.
        disparity: (H, W) of the centre view: views in which a point is hidden behind a nearer one
            then do not count for it. For focus on the scene itself.
        progress: called with each share of the work.

    Raises:
        InputError: a negative aperture, or a focus that is not finite or of another size.
    """
    reach = min(lf.grid) // 2
    radius = float(reach if aperture is None else aperture)
    if not 0 <= radius < np.inf:
        raise InputError(f"the aperture is a number of views, 0 or more, not {aperture}")
    focus = np.asarray(focus_px, dtype=np.float32)
    if focus.shape not in ((), lf.size) or not np.isfinite(focus).all():
        raise InputError(
            f"the focus must be finite, one disparity or one for each of the "
            f"{lf.size[1]}x{lf.size[0]} px of the views"
        )
    focus = np.broadcast_to(focus, lf.size)
    opened = _opened(lf, radius)
    total = np.zeros((*lf.size, 3), np.float32)
    weight = np.zeros((*lf.size, 1), np.float32)
    for (row, col), share in opened.items():
        step = (row - lf.centre[0], col - lf.centre[1])
        light, inside = _seen(to_light(lf.rgb(row, col)), focus, step)
        counts = (
            inside if disparity is None or step == (0, 0) else inside & _visible(disparity, step)
        )
        total += np.where(counts[..., None], share * light, 0)
        weight += share * counts[..., None]
        progress(1 / len(opened))
    return to_samples(total / weight)


def all_in_focus(
    lf: LightField,
    disparity: NDArray[np.float32],
    progress: Callable[[float], None] = lambda share: None,
) -> NDArray[np.uint8]:
    """The centre view with the noise of all views averaged out: each pixel from all that see it."""
    return refocus(lf, disparity, disparity=disparity, progress=progress)


def plane_through(
    points: Sequence[tuple[int, int, float]], size: tuple[int, int]
) -> NDArray[np.float32]:
    """The focal surface (H, W) through one to three points (x, y, disparity).

    One gives a constant; two tilt along the line between them and not across; three give any
    plane.

    Raises:
        InputError: another number of points, or points that are one or on one line.

    Example:
        >>> plane_through([(0, 0, 1.0), (2, 0, 2.0)], (1, 3)).tolist()
        [[1.0, 1.5, 2.0]]
    """
    if not 1 <= len(points) <= 3:
        raise InputError(f"a focal plane goes through one to three points, not {len(points)}")
    x0, y0, d0 = points[0]
    steps = np.array([(x - x0, y - y0) for x, y, _ in points[1:]], np.float64).reshape(-1, 2)
    if np.linalg.matrix_rank(steps, tol=1.0) < len(steps):
        raise InputError("the points of a focal plane must differ, and not lie on one line")
    slope = np.linalg.pinv(steps) @ np.array([d - d0 for *_, d in points[1:]])
    rows, cols = np.mgrid[: size[0], : size[1]]
    return np.asarray(d0 + slope[0] * (cols - x0) + slope[1] * (rows - y0), dtype=np.float32)


def _opened(lf: LightField, radius: float) -> dict[tuple[int, int], float]:
    """The views inside a round lens and how much each counts; its edge is soft, one step wide."""
    rows, cols = np.mgrid[: lf.grid[0], : lf.grid[1]]
    distance = np.hypot(rows - lf.centre[0], cols - lf.centre[1])
    shares = np.clip(radius + 0.5 - distance, 0, 1) * lf.present
    return {(int(r), int(c)): float(shares[r, c]) for r, c in np.argwhere(shares > 0)}


def _seen(
    image: NDArray[np.float32], focus: NDArray[np.float32], step: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """What a view (H, W, 3), `step` views off the centre, shows of each point of the surface, and
    whether the point is inside its picture."""
    height, width = focus.shape
    rows, cols = np.mgrid[:height, :width].astype(np.float32)
    x, y = cols - focus * step[1], rows - focus * step[0]
    inside = (x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5)
    seen = cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen, dtype=np.float32), inside


def _visible(disparity: NDArray[np.float32], step: tuple[int, int]) -> NDArray[np.bool_]:
    """Which points of the centre view a view shows: the nearest ones of those at one place."""
    height, width = disparity.shape
    rows, cols = np.mgrid[:height, :width]
    x = np.clip(np.round(cols - disparity * step[1]).astype(np.int64), 0, width - 1)
    y = np.clip(np.round(rows - disparity * step[0]).astype(np.int64), 0, height - 1)
    nearest = np.full((height, width), -np.inf, np.float32)
    np.maximum.at(nearest, (y, x), disparity)
    # Next to a nearer point the view's pixels hold some of it.
    visible: NDArray[np.bool_] = disparity >= maximum_filter(nearest, 3)[y, x] - _HIDDEN_PX
    return visible
