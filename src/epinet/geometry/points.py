"""Pixels and depth <-> points in space.

Points are in mm: x to the right, y up, z towards the viewer, the origin at the centre view. So a
point in front of the camera has z = -depth, as in OpenGL and glTF. The optical axis goes through
the middle of the picture.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.camera import Camera


def unproject(depth_mm: NDArray[Any], camera: Camera) -> NDArray[np.float64]:
    """Points (H, W, 3) of a depth map (H, W) along the optical axis, in mm.

    Where the depth is not finite, so is the point.

    Example:
        >>> camera = Camera(100, 35, 11, 2300, 3, 3)
        >>> unproject(np.full((3, 3), 1000.0), camera)[0, 2].round(1).tolist()
        [116.7, 116.7, -1000.0]
    """
    depth = np.asarray(depth_mm, dtype=np.float64)
    height, width = depth.shape
    rows, cols = np.mgrid[:height, :width]
    right = (cols - (width - 1) / 2) / camera.focal_px
    up = ((height - 1) / 2 - rows) / camera.focal_px
    return np.stack([right * depth, up * depth, -depth], axis=-1)


def project(points_mm: NDArray[Any], camera: Camera) -> NDArray[np.float64]:
    """Where points (..., 3) in front of the camera are seen: (..., 2) pixels x, y.

    The inverse of `unproject`: whole numbers are the middles of pixels.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    scaled = points[..., :2] / -points[..., 2:] * camera.focal_px
    middle = np.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2])
    return middle + scaled * [1.0, -1.0]
