"""A camera made up for a disparity map whose camera nobody knows: for shapes, not for sizes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.io.camera_file import CameraFacts

FOV_DEG = 40.0
NEAREST_MM, FARTHEST_MM = 1000.0, 2000.0
_LEAST_SPAN_PX = 0.1


def assumed_camera(disparity: NDArray[Any], known: CameraFacts) -> tuple[CameraFacts, str]:
    """Facts by which the farthest surface stands twice as far as the nearest.

    Args:
        disparity: (H, W) px per adjacent view.
        known: its field of view, or focal length and sensor, is kept.

    Returns:
        the facts, and what of them is made up.
    """
    far, near = np.nanpercentile(disparity, [1, 99])
    span = max(float(near - far), _LEAST_SPAN_PX)
    scale = span / (1 / NEAREST_MM - 1 / FARTHEST_MM)
    nearness_of_zero = 1 / NEAREST_MM - float(near) / scale
    depths = f"depths from {NEAREST_MM:g} to {FARTHEST_MM:g} (1st to 99th percentile)"
    view = CameraFacts(fov_deg=known.fov_deg)
    if known.focal_length_mm is not None and known.sensor_size_mm is not None:
        view = CameraFacts(
            focal_length_mm=known.focal_length_mm, sensor_size_mm=known.sensor_size_mm
        )
    elif known.fov_deg is None:
        view = CameraFacts(fov_deg=FOV_DEG)
        depths = f"a view of {FOV_DEG:g} degrees and {depths}"
    made_up = CameraFacts(
        baseline_focal_mm_px=scale,
        focus_distance_mm=1 / nearness_of_zero if nearness_of_zero else np.inf,
    )
    return view.completed_by(made_up), f"not metric: made up are {depths}; lengths mean nothing"
