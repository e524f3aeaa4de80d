"""A camera made up for a disparity map whose camera nobody knows: for shapes, not for sizes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.io.camera_file import CameraFacts

FOV_DEG = 40.0
NEAREST_MM, FARTHEST_MM = 1000.0, 2000.0
_LEAST_SPAN_PX = 0.1

ASSUMPTION = (
    f"not metric: made up are a view of {FOV_DEG:g} degrees and depths from {NEAREST_MM:g} to "
    f"{FARTHEST_MM:g} (1st to 99th percentile); lengths mean nothing"
)


def assumed_camera(disparity: NDArray[Any]) -> CameraFacts:
    """Facts by which the farthest surface stands twice as far as the nearest."""
    far, near = np.nanpercentile(disparity, [1, 99])
    span = max(float(near - far), _LEAST_SPAN_PX)
    scale = span / (1 / NEAREST_MM - 1 / FARTHEST_MM)
    nearness_of_zero = 1 / NEAREST_MM - float(near) / scale
    return CameraFacts(
        fov_deg=FOV_DEG,
        baseline_focal_mm_px=scale,
        focus_distance_mm=1 / nearness_of_zero if nearness_of_zero else np.inf,
    )
