"""What a ground truth must be to be used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError


def checked_truth(
    truth: NDArray[Any], size: tuple[int, int] | None, path: Path | str
) -> NDArray[np.float32]:
    """The disparity map as (H, W) float32, NaN where unknown.

    Args:
        truth: what was read from `path`.
        size: (height, width) of the views in pixels; None if they could not be read.

    Raises:
        InputError: another shape or size, infinite values, or no known value at all.
    """
    if truth.ndim != 2 or truth.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: truth must be one (H, W) map of disparities, not {truth.shape} {truth.dtype}"
        )
    if size is not None and truth.shape != size:
        raise InputError(
            f"{path}: truth is {truth.shape[1]}x{truth.shape[0]} px, "
            f"the views are {size[1]}x{size[0]} px"
        )
    if np.isinf(truth).any():
        raise InputError(f"{path}: truth holds infinite values; mark unknown pixels by NaN")
    if np.isnan(truth).all():
        raise InputError(f"{path}: truth is NaN at every pixel; leave it out if it is unknown")
    return np.ascontiguousarray(truth, dtype=np.float32)
