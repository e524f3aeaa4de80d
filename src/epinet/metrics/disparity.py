"""Scores of a disparity map, as the 4D Light Field Benchmark defines them.

The functions from `badpix` to `missing` hold the definitions. They take the errors
|estimate - truth| at the pixels to be scored, in px, not finite where there is no estimate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BORDER_PX = 15
"""The benchmark leaves out a border of this width."""

BADPIX_THRESHOLDS_PX = (0.07, 0.03, 0.01)


def percent(bad: NDArray[np.bool_]) -> float:
    """Share of the true ones; NaN of none at all."""
    return 100 * float(np.mean(bad)) if bad.size else float("nan")


def badpix(error: NDArray[Any], threshold_px: float) -> float:
    """Percent of errors above the threshold; a missing estimate counts as one.

    Example:
        >>> badpix(np.array([0, 0.07, 0.08, np.nan]), 0.07)
        50.0
    """
    return percent(~(error <= threshold_px))


def mse_x100(error: NDArray[Any]) -> float:
    """Mean of the squares, in px^2, times 100; where there is an estimate."""
    finite = _finite(error)
    return 100 * float(np.mean(finite**2)) if finite.size else float("nan")


def rmse_px(error: NDArray[Any]) -> float:
    """Root of the mean square, where there is an estimate."""
    return float(np.sqrt(mse_x100(error) / 100))


def mae_px(error: NDArray[Any]) -> float:
    """Mean, where there is an estimate."""
    finite = _finite(error)
    return float(np.mean(finite)) if finite.size else float("nan")


def q25_x100(error: NDArray[Any]) -> float:
    """25th percentile, in px, times 100; where there is an estimate."""
    finite = _finite(error)
    return 100 * float(np.percentile(finite, 25)) if finite.size else float("nan")


def missing(error: NDArray[Any]) -> float:
    """Percent of pixels without an estimate."""
    return percent(~np.isfinite(error))


def score(
    estimate: NDArray[Any], truth: NDArray[Any], border_px: int = BORDER_PX
) -> dict[str, float]:
    """Scores of an estimate, on the pixels that have truth.

    Args:
        estimate: (..., H, W) in px per adjacent view.
        truth: the same shape; NaN where unknown.
        border_px: left out on each side.

    Returns:
        "badpix_0.07", "badpix_0.03", "badpix_0.01": percent of pixels whose error exceeds the
        threshold, a missing estimate counting as bad; on the pixels with an estimate, "mse_x100"
        (px^2), "mae_px" and "q25_x100" (25th percentile of the error, px); "missing": percent of
        pixels without an estimate.

    Raises:
        ValueError: the shapes differ or no pixel has truth.
    """
    if estimate.shape != truth.shape:
        raise ValueError(f"estimate {estimate.shape} and truth {truth.shape} differ in shape")
    if border_px:
        inner = slice(border_px, -border_px)
        estimate, truth = estimate[..., inner, inner], truth[..., inner, inner]
    known = np.isfinite(truth)
    if not known.any():
        raise ValueError("no pixel inside the border has truth")
    error = np.abs(estimate[known].astype(np.float64) - truth[known])
    scores = {f"badpix_{t}": badpix(error, t) for t in BADPIX_THRESHOLDS_PX}
    return scores | {
        "mse_x100": mse_x100(error),
        "mae_px": mae_px(error),
        "q25_x100": q25_x100(error),
        "missing": missing(error),
    }


def _finite(error: NDArray[Any]) -> NDArray[Any]:
    finite: NDArray[Any] = error[np.isfinite(error)]
    return finite
