"""Focus set afterwards: views shifted onto a focal surface and added up, as a large lens would.

A focal surface is a disparity for each pixel. A constant one is the focus plane of an ordinary
lens; one that changes linearly over the picture is a tilted plane in space, as 1/Z is linear
there; the disparity map itself brings everything into focus. What lies off the surface is blurred
by as many pixels as its disparity differs, times the aperture in views.

A lens has no gaps between views. Where neighbouring views are more than a pixel apart, each one
stands for all viewpoints up to half-way to the next: it is averaged over the square that a point
of its disparity would cross on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from epinet.effects.sampling import sampled
from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.srgb import to_light, to_samples

_HIDDEN_PX = 0.3
"""A point is hidden in a view if one nearer by more disparity is seen at its place."""


def refocus(
    lf: LightField,
    focus_px: float | NDArray[Any],
    disparity: NDArray[np.float32],
    aperture: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> NDArray[np.uint8]:
    """The picture (H, W, 3) that a lens as wide as the grid would take.

    Args:
        lf: the views; those that are not there are left out.
        focus_px: disparity of what is sharp, one or (H, W).
        disparity: (H, W) of the centre view.
        aperture: radius of the lens in steps from view to view: 0 is the centre view alone; None
            is as wide as the grid.
        progress: called with each share of the work.

    Raises:
        InputError: a negative aperture, or a focus that is not finite or of another size.
    """
    radius = _reach(lf) if aperture is None else float(aperture)
    if not 0 <= radius < np.inf:
        raise InputError(f"the aperture is a number of views, 0 or more, not {aperture}")
    focus = np.asarray(focus_px, dtype=np.float32)
    if focus.shape not in ((), lf.size) or not np.isfinite(focus).all():
        raise InputError(
            f"the focus must be finite, one disparity or one for each of the "
            f"{lf.size[1]}x{lf.size[0]} px of the views"
        )
    focus = np.broadcast_to(focus, lf.size)

    def shown(light: NDArray[np.float32], step: tuple[float, float]) -> _Shown:
        place = _place(focus, step)
        sharp = sampled(light, place.x, place.y)
        if step == (0, 0) and radius == 0:
            return sharp, place.inside
        width = np.abs(_nearest(_warped(disparity, step), place) - focus)
        wide = (width > 1)[..., None]
        return np.where(wide, _averaged(light, place, width), sharp), place.inside

    return _added_up(lf, radius, shown, progress)


def all_in_focus(
    lf: LightField,
    disparity: NDArray[np.float32],
    progress: Callable[[float], None] = lambda share: None,
) -> NDArray[np.uint8]:
    """The centre view with the noise of all views averaged out: each pixel from all that see it."""

    def shown(light: NDArray[np.float32], step: tuple[float, float]) -> _Shown:
        place = _place(disparity, step)
        return sampled(light, place.x, place.y), place.inside & _visible(disparity, step)

    return _added_up(lf, _reach(lf), shown, progress)


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


_Shown = tuple[NDArray[np.float32], NDArray[np.bool_]]
"""A view's light (H, W, 3) at each point of the focal surface, and where it counts."""


@dataclass(frozen=True)
class _Place:
    """Where a view sees each point of the focal surface; all (H, W)."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    inside: NDArray[np.bool_]


def _added_up(
    lf: LightField,
    radius: float,
    shown: Callable[[NDArray[np.float32], tuple[float, float]], _Shown],
    progress: Callable[[float], None],
) -> NDArray[np.uint8]:
    """The mean light of the views inside a round lens; its edge is soft, one step wide."""
    rows, cols = np.mgrid[: lf.grid[0], : lf.grid[1]]
    distance = np.hypot(lf.row_spacing * (rows - lf.centre[0]), cols - lf.centre[1])
    shares = np.clip(radius + 0.5 - distance, 0, 1) * lf.present
    opened = np.argwhere(shares > 0)
    total = np.zeros((*lf.size, 3), np.float32)
    weight = np.zeros((*lf.size, 1), np.float32)
    for row, col in opened:
        step = (lf.row_spacing * (int(row) - lf.centre[0]), float(int(col) - lf.centre[1]))
        light, counts = shown(to_light(lf.rgb(row, col)), step)
        share = np.float32(shares[row, col]) * counts[..., None]
        total += share * light
        weight += share
        progress(1 / len(opened))
    return to_samples(total / weight)


def _reach(lf: LightField) -> float:
    return float(min(lf.grid) // 2)


def _place(focus: NDArray[np.float32], step: tuple[float, float]) -> _Place:
    height, width = focus.shape
    rows, cols = np.mgrid[:height, :width].astype(np.float32)
    x, y = cols - focus * step[1], rows - focus * step[0]
    return _Place(x, y, (x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5))


def _nearest(values: NDArray[np.float32], place: _Place) -> NDArray[np.float32]:
    """The values (H, W) of the pixels that the places lie in."""
    height, width = values.shape
    x = np.clip(np.rint(place.x).astype(np.int64), 0, width - 1)
    y = np.clip(np.rint(place.y).astype(np.int64), 0, height - 1)
    return values[y, x]


def _averaged(
    light: NDArray[np.float32], place: _Place, width: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The mean of a view over a square of a width of its own for each place, from sums over all
    that lies above and to the left."""
    sums = np.pad(light.astype(np.float64), ((1, 0), (1, 0), (0, 0))).cumsum(0).cumsum(1)
    height_px, width_px = light.shape[:2]

    def ends(middle: NDArray[np.float32], size: int) -> tuple[NDArray[Any], NDArray[Any]]:
        low, high = (middle.astype(np.float64) + 0.5 + s * width / 2 for s in (-1, 1))
        return np.clip(low, 0, size), np.clip(high, 0, size)

    (left, right), (top, bottom) = ends(place.x, width_px), ends(place.y, height_px)

    def above_left(x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
        return sampled(sums, x, y, "bilinear")

    total = above_left(right, bottom) - above_left(left, bottom)
    total += above_left(left, top) - above_left(right, top)
    area = np.maximum((right - left) * (bottom - top), 1e-6)[..., None]
    return np.asarray(total / area, dtype=np.float32)


def _landing(
    disparity: NDArray[np.float32], step: tuple[float, float]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
    """Pixel (y, x) of a view at which each point of the centre view lands, and the view's own
    disparity: the largest that lands on a pixel, -inf where nothing does."""
    height, width = disparity.shape
    rows, cols = np.mgrid[:height, :width]
    x = np.clip(np.round(cols - disparity * step[1]).astype(np.int64), 0, width - 1)
    y = np.clip(np.round(rows - disparity * step[0]).astype(np.int64), 0, height - 1)
    nearest = np.full((height, width), -np.inf, np.float32)
    np.maximum.at(nearest, (y, x), disparity)
    return y, x, nearest


def _warped(disparity: NDArray[np.float32], step: tuple[float, float]) -> NDArray[np.float32]:
    """The disparity as the view sees it; where only the view sees something, the centre view's."""
    nearest = _landing(disparity, step)[2]
    return np.where(np.isfinite(nearest), nearest, disparity)


def _visible(disparity: NDArray[np.float32], step: tuple[float, float]) -> NDArray[np.bool_]:
    """Which points of the centre view a view shows: the nearest ones of those at one place."""
    if step == (0, 0):
        return np.ones(disparity.shape, dtype=bool)
    y, x, nearest = _landing(disparity, step)
    # Next to a nearer point the view's pixels hold some of it.
    visible: NDArray[np.bool_] = disparity >= maximum_filter(nearest, 3)[y, x] - _HIDDEN_PX
    return visible
