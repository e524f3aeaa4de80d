"""The array of cameras: parallel image planes, shifted so that the focus plane has disparity 0.

In the frame of a camera X points right, Y down and Z forward. View (row, col) of a 9x9 grid
stands at baseline * (col - 4, row - 4, 0), and its image is shifted by f_px * baseline / focus
per view, so that pixel (x, y) of the centre view is seen at (x - d * (col - 4), y - d * (row - 4))
with d = f_px * baseline * (1 / Z - 1 / focus), which is what `epinet.camera.Camera` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.camera import Camera
from epinet.synth.pathtraced.elements import Scene

Array = NDArray[np.float64]

VIEWS = 9
SENSOR_MM = 35.0
_REACH = VIEWS // 2
_NEAR_MM, _FAR_MM = 10.0, 1e5


@dataclass(frozen=True)
class Rig:
    """Where the cameras stand and what they are."""

    eye: Array
    """(3,) position of the centre view in the scene."""
    axes: Array
    """(3, 3): right, down and forward as rows."""
    camera: Camera

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        side = max(self.camera.width_px, self.camera.height_px)
        return self.camera.focal_length_mm * side / self.camera.sensor_size_mm

    def position(self, row: int, col: int) -> Array:
        """(3,) position of a view in the scene."""
        offset = np.array([col - _REACH, row - _REACH, 0.0]) * self.camera.baseline_mm
        position: Array = self.eye + offset @ self.axes
        return position

    def shift_px(self, row: int, col: int) -> tuple[float, float]:
        """(x, y) by which the image of a view is shifted."""
        step = self.focal_px * self.camera.baseline_mm / self.camera.focus_distance_mm
        return step * (col - _REACH), step * (row - _REACH)

    def rays(self, row: int, col: int, x: Array, y: Array) -> Array:
        """Directions (..., 3) through image positions in pixels, of length 1 along Z.

        (0, 0) is the centre of the top-left pixel.
        """
        shift_x, shift_y = self.shift_px(row, col)
        across = (x + 0.5 - self.camera.width_px / 2 - shift_x) / self.focal_px
        down = (y + 0.5 - self.camera.height_px / 2 - shift_y) / self.focal_px
        directions: Array = np.stack([across, down, np.ones_like(across)], axis=-1) @ self.axes
        return directions

    def sensor(self, mi: Any, row: int, col: int) -> dict[str, Any]:
        """The view as Mitsuba's description of a sensor; pixels average over their own square."""
        camera, eye = self.camera, self.position(row, col)
        shift_x, shift_y = self.shift_px(row, col)
        to_world = np.eye(4)
        to_world[:3, :3] = (self.axes * [[-1], [-1], [1]]).T  # Mitsuba's axes: left, up, forward
        to_world[:3, 3] = eye
        return {
            "type": "perspective",
            "fov": degrees(2 * atan(camera.sensor_size_mm / 2 / camera.focal_length_mm)),
            "fov_axis": "larger",
            "principal_point_offset_x": -shift_x / camera.width_px,
            "principal_point_offset_y": -shift_y / camera.height_px,
            "near_clip": _NEAR_MM,
            "far_clip": _FAR_MM,
            "to_world": mi.ScalarTransform4f(to_world),
            "sampler": {"type": "independent"},
            "film": {
                "type": "hdrfilm",
                "width": camera.width_px,
                "height": camera.height_px,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        }


def centre_rig(scene: Scene, size: int) -> Rig:
    """The centre view alone, `size` x `size`: focus and baseline are not chosen yet."""
    eye, target = np.array(scene.eye, dtype=float), np.array(scene.target, dtype=float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    camera = Camera(scene.focal_length_mm, SENSOR_MM, 1.0, 1000.0, size, size)
    return Rig(eye, axes, camera)


def fitted_rig(rig: Rig, depth_mm: Array, disparity_px: tuple[float, float]) -> Rig:
    """The rig whose nearest and farthest depths have the given disparities.

    Args:
        rig: any rig at that place.
        depth_mm: depths of the centre view, inf where there is nothing.
        disparity_px: (farthest, nearest).
    """
    near, far = 1 / float(depth_mm.min()), 1 / float(depth_mm.max())
    low, high = disparity_px
    scale = (high - low) / (near - far)
    old = rig.camera
    camera = Camera(
        focal_length_mm=old.focal_length_mm,
        sensor_size_mm=old.sensor_size_mm,
        baseline_mm=scale / rig.focal_px,
        focus_distance_mm=1 / (near - high / scale),
        width_px=old.width_px,
        height_px=old.height_px,
        disparity_min_px=low,
        disparity_max_px=high,
    )
    return Rig(rig.eye, rig.axes, camera)
