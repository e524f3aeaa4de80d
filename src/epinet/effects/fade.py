"""A picture that fades with distance, like things in mist."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.srgb import to_light, to_samples

WHITE = (255, 255, 255)


def fade(
    picture: NDArray[np.uint8],
    disparity: NDArray[np.float32],
    colour: tuple[int, int, int] = WHITE,
    *,
    near_px: float | None = None,
    far_px: float | None = None,
) -> NDArray[np.uint8]:
    """The picture (H, W, 3), unchanged where near and of one colour where far.

    In between the share of the colour rises linearly with falling disparity, in light.

    Args:
        picture: the centre view.
        disparity: (H, W) its disparity.
        colour: 8-bit RGB.
        near_px: disparity down to which nothing fades; None: the 99th percentile.
        far_px: disparity from which only the colour is left; None: the 1st percentile.
    """
    low, high = np.nanpercentile(disparity, [1, 99])
    near = float(high) if near_px is None else near_px
    far = float(low) if far_px is None else far_px
    gone: NDArray[Any] = np.clip((near - disparity) / max(near - far, 1e-6), 0, 1)[..., None]
    mist = to_light(np.array(colour) / 255)
    return to_samples((1 - gone) * to_light(picture / np.float32(255)) + gone * mist)
