"""Stored samples <-> linear light: what adds up in a lens is light, not sRGB's numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_light(samples: NDArray[Any]) -> NDArray[np.float32]:
    """sRGB samples in 0..1 to light in 0..1 (IEC 61966-2-1)."""
    s = np.asarray(samples, dtype=np.float32)
    curve = np.power((s + np.float32(0.055)) / np.float32(1.055), np.float32(2.4))
    return np.where(s <= 0.04045, s / np.float32(12.92), curve).astype(np.float32)


def to_samples(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Light in 0..1 to 8-bit sRGB samples; the inverse of `to_light`. Clips.

    Example:
        >>> levels = np.arange(256, dtype=np.uint8)
        >>> bool((to_samples(to_light(levels / 255)) == levels).all())
        True
    """
    clipped = np.clip(np.asarray(light, dtype=np.float32), 0, 1)
    curve = 1.055 * np.power(clipped, np.float32(1 / 2.4)) - 0.055
    samples = np.where(clipped <= 0.0031308, 12.92 * clipped, curve)
    return np.round(255 * samples).astype(np.uint8)
