"""Scores of a disparity map, as the 4D Light Field Benchmark defines them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BORDER_PX = 15
"""The benchmark leaves out a border of this width."""

BADPIX_THRESHOLDS_PX = (0.07, 0.03, 0.01)


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
    finite = error[np.isfinite(error)]
    scores = {f"badpix_{t}": 100 * float(np.mean(~(error <= t))) for t in BADPIX_THRESHOLDS_PX}
    scores["mse_x100"] = 100 * float(np.mean(finite**2)) if finite.size else float("nan")
    scores["mae_px"] = float(np.mean(finite)) if finite.size else float("nan")
    scores["q25_x100"] = 100 * float(np.percentile(finite, 25)) if finite.size else float("nan")
    scores["missing"] = 100 * (1 - finite.size / error.size)
    return scores
