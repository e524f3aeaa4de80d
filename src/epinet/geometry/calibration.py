"""A camera's depth scale from points of known distance.

Disparity is linear in nearness, d = k * (1/Z - 1/F) with k = baseline * focal_px, so two points at
different depths give k and the focus distance F, and more of them by least squares in d, which is
where the error is: the estimate's, not the tape's. How wide things are (the field of view) cannot
be known from distances alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.geometry.pick import Pick, pick
from epinet.io.camera_file import CameraFacts

LEAST_ERROR_PX = 0.03
"""Error of a point's disparity that is reckoned with even if few points happen to fit better."""
SMALLEST_SPREAD_PX = 0.1
"""Points whose disparities spread by less say nothing: it is a few errors of an estimate."""


@dataclass(frozen=True)
class Point:
    """A pixel whose depth is known."""

    x: int
    y: int
    depth_mm: float
    """Along the optical axis; inf for something very far."""

    @classmethod
    def parse(cls, text: str) -> Point:
        """A point from "x,y,mm".

        Raises:
            InputError: the text is no such thing.

        Example:
            >>> Point.parse("120,88,940")
            Point(x=120, y=88, depth_mm=940.0)
        """
        try:
            x, y, depth = text.split(",")
            point = cls(int(x), int(y), float(depth))
        except ValueError as error:
            raise InputError(
                f"--point {text}: give x,y,mm: a pixel of the centre view, counted from 0 at the "
                "top left, and its distance, as in 120,88,940 (inf for infinity)"
            ) from error
        if not point.depth_mm > 0:
            raise InputError(f"--point {text}: the distance must be more than 0 mm")
        return point

    def __str__(self) -> str:
        return f"{self.x},{self.y}"


@dataclass(frozen=True)
class Reading:
    """A point and what the map says there."""

    point: Point
    pick: Pick


@dataclass(frozen=True)
class Calibration:
    """What points say about a camera."""

    readings: tuple[Reading, ...]
    baseline_focal_mm_px: float
    inverse_focus_per_mm: float
    """1/F; 0 or less if disparity 0 is at infinity or farther than that."""
    error_px: float
    """Of one point's disparity: from the residuals, at least LEAST_ERROR_PX."""
    baseline_focal_error_mm_px: float
    """Standard errors."""
    inverse_focus_error_per_mm: float

    @property
    def focus_distance_mm(self) -> float:
        """Distance of disparity 0; negative if it is farther than anything."""
        return 1 / self.inverse_focus_per_mm if self.inverse_focus_per_mm else math.inf

    @property
    def residuals_px(self) -> NDArray[np.float64]:
        """Disparity read minus that expected, point by point."""
        nearness = np.array([1 / r.point.depth_mm for r in self.readings])
        expected = self.baseline_focal_mm_px * (nearness - self.inverse_focus_per_mm)
        return np.array([r.pick.disparity_px for r in self.readings]) - expected

    @property
    def depths_mm(self) -> NDArray[np.float64]:
        """Depth that the calibration gives to each point; inf at and beyond infinity."""
        read = np.array([r.pick.disparity_px for r in self.readings])
        nearness = read / self.baseline_focal_mm_px + self.inverse_focus_per_mm
        with np.errstate(divide="ignore"):
            return np.where(nearness > 0, 1 / nearness, np.inf)

    @property
    def facts(self) -> CameraFacts:
        """What is known now."""
        return CameraFacts(
            baseline_focal_mm_px=self.baseline_focal_mm_px,
            focus_distance_mm=self.focus_distance_mm,
        )


def calibrate(disparity: NDArray[np.float32], points: Sequence[Point]) -> Calibration:
    """Fit the depth scale to points of known distance.

    Args:
        disparity: (H, W) px per adjacent view.
        points: at least two, at different distances.

    Raises:
        InputError: points outside the map or without disparity, too few, all at one depth, or
            nearer ones that have the smaller disparity.
    """
    readings = _read_all(disparity, points)
    _check_spread(readings)
    nearness = np.array([1 / r.point.depth_mm for r in readings])
    read = np.array([r.pick.disparity_px for r in readings])
    slope, offset = np.polyfit(nearness, read, 1)
    if slope <= 0:
        raise InputError(
            "nearer points have the smaller disparity here: check the distances; if they are "
            "right, the views are in the wrong order (epinet info finds out)"
        )
    rest = len(readings) - 2
    squares = float(np.sum((read - slope * nearness - offset) ** 2))
    error = max(LEAST_ERROR_PX, math.sqrt(squares / rest) if rest else 0.0)
    around = nearness - nearness.mean()
    slope_error = error / math.sqrt(float(np.sum(around**2)))
    # 1/F is the nearness at which the line crosses 0, by the usual propagation of errors.
    crossing = -offset / slope
    crossing_error = math.hypot(
        error / math.sqrt(len(readings)) / slope, (crossing - nearness.mean()) * slope_error / slope
    )
    return Calibration(
        tuple(readings), float(slope), float(crossing), error, slope_error, crossing_error
    )


def _read_all(disparity: NDArray[np.float32], points: Sequence[Point]) -> list[Reading]:
    readings, problems = [], []
    if len(points) < 2:
        problems.append(f"at least two points of known distance are needed, not {len(points)}")
    for point in points:
        try:
            readings.append(Reading(point, pick(disparity, point.x, point.y)))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return readings


def _check_spread(readings: Sequence[Reading]) -> None:
    if len({r.point.depth_mm for r in readings}) < 2:
        raise InputError(
            f"all points are at one depth, {readings[0].point.depth_mm:g} mm: "
            "give points at different distances"
        )
    spread = float(np.ptp([r.pick.disparity_px for r in readings]))
    if spread < SMALLEST_SPREAD_PX:
        raise InputError(
            f"the disparities at the points differ by {spread:.3f} px only, which is within the "
            "error of the map: give points whose distances differ more"
        )
