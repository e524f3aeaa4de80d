"""Metrics of smooth surfaces: how bumpy they come out, and which way they face."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from epinet.camera import Camera
from epinet.metrics.metric import Comparison, Metric

BUMPINESS_CLIP = 0.05
WORST_ANGLE_DEG = 180.0


def bumpiness_x100(comparison: Comparison, *masks: str) -> float:
    """Mean over the masks of the norm of the Hessian of estimate - truth, clipped, times 100.

    Pixels whose Hessian needs a missing estimate count as the clip, the worst there is.
    """
    known = comparison.region(*masks) & np.isfinite(hessian_norm(comparison.truth))
    bumps = hessian_norm(comparison.difference)[known]
    bumps = np.where(np.isfinite(bumps), np.minimum(bumps, BUMPINESS_CLIP), BUMPINESS_CLIP)
    return 100 * float(np.mean(bumps)) if bumps.size else float("nan")


def hessian_norm(values: NDArray[Any]) -> NDArray[np.float64]:
    """(H, W) Frobenius norm of the second derivatives, four times those per px^2."""
    down, right = scharr(values)
    return np.sqrt(sum(np.square(second) for first in (down, right) for second in scharr(first)))


def scharr(values: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Twice the slope down and right: the benchmark's [3, 10, 3] / 16 x [1, 0, -1]."""
    values = values.astype(np.float64)
    down, right = (
        ndimage.correlate1d(
            ndimage.correlate1d(values, [-1, 0, 1], axis, mode="nearest"),
            np.array([3, 10, 3]) / 16,
            1 - axis,
            mode="nearest",
        )
        for axis in (0, 1)
    )
    return down, right


def median_angle_deg(comparison: Comparison, mask: str, *, benchmark_rays: bool) -> float:
    """Median angle between the normals of estimate and truth.

    Pixels whose normal needs a missing estimate, or one beyond infinity, count as 180 degrees.
    """
    assert comparison.camera is not None
    given = normals(comparison.estimate, comparison.camera, benchmark_rays=benchmark_rays)
    true = normals(comparison.truth, comparison.camera, benchmark_rays=benchmark_rays)
    known = comparison.region(mask) & np.isfinite(true).all(axis=2)
    a, b = given[known], true[known]
    # The arc cosine of the product alone would lose small angles.
    angle = np.degrees(
        np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    )
    angle = np.where(np.isfinite(angle), angle, WORST_ANGLE_DEG)
    return float(np.median(angle)) if angle.size else float("nan")


def normals(
    disparity_px: NDArray[Any], camera: Camera, *, benchmark_rays: bool
) -> NDArray[np.float64]:
    """(H, W, 3) unit normals of the surface in metric space; NaN where it is not known.

    Args:
        disparity_px: (H, W).
        camera: gives the depth.
        benchmark_rays: the rays through the pixels as the benchmark's toolkit has them, which
            begin at the first pixel and are half as far apart as they are; otherwise the true ones.
    """
    height, width = disparity_px.shape
    with np.errstate(invalid="ignore"):
        depth = camera.depth_mm(disparity_px).astype(np.float64)
    depth[~np.isfinite(depth)] = np.nan
    longer = max(height, width)
    rows, cols = np.mgrid[:height, :width].astype(np.float64)
    if benchmark_rays:
        pitch_mm = 0.5 * camera.sensor_size_mm / (longer - 1)
    else:
        pitch_mm = camera.sensor_size_mm / longer
        rows -= (height - 1) / 2
        cols -= (width - 1) / 2
    per_mm = pitch_mm / camera.focal_length_mm
    slopes = [scharr(axis) for axis in (cols * per_mm * depth, rows * per_mm * depth, depth)]
    down, right = (np.stack([s[k] for s in slopes], axis=2) for k in (0, 1))
    normal = np.cross(right, down)
    with np.errstate(invalid="ignore"):
        unit: NDArray[np.float64] = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    return unit


def _bumpiness(mask: str, name: str, where: str) -> Metric:
    return Metric(
        id=f"bumpiness_{mask}",
        name=f"Bumpiness {name}",
        unit="x100",
        definition="Frobenius norm of the Hessian (Scharr's kernel twice) of estimate - truth, "
        f"at most {BUMPINESS_CLIP:g}, mean on {where}, times 100.",
        compute=lambda comparison: bumpiness_x100(comparison, mask),
        masks=(mask,),
    )


def _angle(mask: str, name: str, where: str) -> Metric:
    return Metric(
        id=f"mae_{mask}",
        name=f"MAE {name}",
        unit="deg",
        definition=f"Median angle between the normals of estimate and truth on {where}, from "
        "metric depth, along the rays of the benchmark's toolkit: half as far apart as the true "
        "ones, beginning at the first pixel.",
        compute=lambda comparison: median_angle_deg(comparison, mask, benchmark_rays=True),
        masks=(mask,),
        needs_camera=True,
    )


def _true_angle(mask: str, name: str, where: str) -> Metric:
    return Metric(
        id=f"normal_angle_{mask}",
        name=f"Normals {name}",
        unit="deg",
        definition=f"Median angle between the normals of estimate and truth on {where}, from "
        "metric depth along the camera's true rays.",
        compute=lambda comparison: median_angle_deg(comparison, mask, benchmark_rays=False),
        masks=(mask,),
        needs_camera=True,
        source="epinet",
    )


_SURFACES = (
    ("planes", "Planes", "planes"),
    ("smooth_surfaces", "Surfaces", "smooth surfaces that are no planes"),
)
BUMPINESS = tuple(_bumpiness(*surface) for surface in _SURFACES)
NORMALS = tuple(make(*surface) for make in (_angle, _true_angle) for surface in _SURFACES)
