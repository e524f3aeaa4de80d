"""A camera array's intrinsics, and disparity <-> metric depth.

Disparity is relative to the focus plane (0 there, positive nearer), so depth is not f * B / d:

    beta = baseline * focal_length * max(width, height)
    Z    = beta * F / (d * F * sensor + beta)

with every length in mm and F the focus distance (the 4D Light Field Benchmark's model). That is

    1/Z = 1/F + d / (baseline * focal_px),    focal_px = focal_length * max(width, height) / sensor.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """One view's intrinsics and the spacing of the views; lengths in mm, as in parameters.cfg."""

    focal_length_mm: float
    sensor_size_mm: float
    """Length of the sensor's longer side."""
    baseline_mm: float
    """Distance between adjacent views."""
    focus_distance_mm: float
    """Distance at which the disparity is 0: inf for parallel cameras, negative where disparity 0
    is farther than anything."""
    width_px: int
    height_px: int
    disparity_min_px: float | None = None
    """Bounds stated by the data set, where it does."""
    disparity_max_px: float | None = None

    @property
    def disparity_range_px(self) -> tuple[float, float] | None:
        """The stated bounds; None where one is missing or they bound nothing."""
        low, high = self.disparity_min_px, self.disparity_max_px
        return None if low is None or high is None or low >= high else (low, high)

    def at_every(self, step: int) -> Camera:
        """The same of every `step`-th view: baseline and stated bounds grow."""
        low, high = self.disparity_min_px, self.disparity_max_px
        return replace(
            self,
            baseline_mm=self.baseline_mm * step,
            disparity_min_px=None if low is None else low * step,
            disparity_max_px=None if high is None else high * step,
        )

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.focal_length_mm * max(self.width_px, self.height_px) / self.sensor_size_mm

    @property
    def baseline_focal_mm_px(self) -> float:
        """Baseline times focal length in pixels: with it, a disparity counted from infinity gives
        the depth."""
        return self.baseline_mm * self.focal_px

    def disparity_from_infinity_px(self, disparity_px: NDArray[Any]) -> NDArray[np.float64]:
        """Each disparity counted from that of infinitely far things, in px: 0 there, then up."""
        d = np.asarray(disparity_px, dtype=np.float64)
        return d + self.baseline_focal_mm_px / self.focus_distance_mm

    def depth_mm(self, disparity_px: NDArray[Any]) -> NDArray[np.float32]:
        """Depth along the optical axis of each disparity; inf at and beyond infinity, NaN of NaN.

        Args:
            disparity_px: any shape, pixels per adjacent view.

        Example:
            >>> camera = Camera(100, 35, 11, 2300, 512, 512)
            >>> float(camera.depth_mm(np.array(0.0)))
            2300.0
        """
        parallax = self.disparity_from_infinity_px(disparity_px)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            depth = self.baseline_focal_mm_px / parallax
            return np.where(parallax <= 0, np.inf, depth).astype(np.float32)

    def disparity_px(self, depth_mm: NDArray[Any]) -> NDArray[np.float32]:
        """Disparity of each depth, the inverse of `depth_mm`; takes inf."""
        z = np.asarray(depth_mm, dtype=np.float64)
        nearness = 1.0 / z - 1.0 / self.focus_distance_mm
        return (self.baseline_focal_mm_px * nearness).astype(np.float32)

    def as_dict(self) -> dict[str, Any]:
        """Fit for JSON, which knows no infinite number: the text Infinity takes its place."""
        return {k: "Infinity" if v == math.inf else v for k, v in asdict(self).items()}
