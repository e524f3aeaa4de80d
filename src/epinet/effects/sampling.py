"""Pictures looked up at places between their pixels; beyond their border the last pixel repeats."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional as F


def sampled(
    image: NDArray[Any],
    x: NDArray[Any],
    y: NDArray[Any],
    interpolation: Literal["bilinear", "bicubic"] = "bicubic",
) -> NDArray[Any]:
    """The values of an image (H, W, C) at the places (x, y), each (h, w), in pixels from the middle
    of the first one; bicubic is Keys' convolution (1981) with a = -.75.

    Returns:
        (h, w, C), of the image's type, float32 or float64.

    Example:
        >>> line = np.array([[[0.0], [1.0], [3.0]]])
        >>> sampled(line, np.array([[0.5, 1.5, 9]]), np.zeros((1, 3)), "bilinear").ravel().round(3)
        array([0.5, 2. , 3. ])
    """
    height, width = image.shape[:2]
    places = np.stack([(2 * x + 1) / width - 1, (2 * y + 1) / height - 1], axis=-1)
    seen = F.grid_sample(
        torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None],
        torch.from_numpy(places.astype(image.dtype))[None],
        mode=interpolation,
        padding_mode="border",
        align_corners=False,
    )
    found: NDArray[Any] = np.ascontiguousarray(seen[0].numpy().transpose(1, 2, 0))
    return found
