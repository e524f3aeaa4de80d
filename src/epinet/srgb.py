"""sRGB's numbers <-> linear light (IEC 61966-2-1): what adds up in a lens is light."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floating = TypeVar("Floating", bound=np.floating[Any])


def to_light(samples: NDArray[Any]) -> NDArray[np.float32]:
    """sRGB samples in 0..1 to light in 0..1."""
    s = np.asarray(samples, dtype=np.float32)
    curve = np.power((s + np.float32(0.055)) / np.float32(1.055), np.float32(2.4))
    return np.where(s <= 0.04045, s / np.float32(12.92), curve).astype(np.float32)


def encoded(light: NDArray[Floating]) -> NDArray[Floating]:
    """Light, clipped to 0..1, as sRGB samples in 0..1; the inverse of `to_light`."""
    clipped = np.clip(light, 0, 1)
    curve = 1.055 * clipped ** (1 / 2.4) - 0.055
    samples: NDArray[Floating] = np.where(clipped <= 0.0031308, 12.92 * clipped, curve)
    return samples


def to_samples(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Light in 0..1 to 8-bit sRGB samples. Clips.

    Example:
        >>> levels = np.arange(256, dtype=np.uint8)
        >>> bool((to_samples(to_light(levels / 255)) == levels).all())
        True
    """
    return np.round(255 * encoded(np.asarray(light, dtype=np.float32))).astype(np.uint8)
