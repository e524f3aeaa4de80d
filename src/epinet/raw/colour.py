"""Colours: from the sensor's to sRGB, by the camera's own metadata."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from epinet.raw.bayer import Image
from epinet.raw.metadata import Frame
from epinet.srgb import encoded


def balance(image: Image, frame: Frame, pattern: NDArray[np.intp]) -> None:
    """Apply the white balance to a mosaic (H, W), in place."""
    for y in (0, 1):
        for x in (0, 1):
            image[y::2, x::2] *= np.float32(frame.gains[pattern[y, x]])


def to_srgb(rgb: Image, frame: Frame) -> NDArray[np.uint16]:
    """16-bit sRGB from balanced linear colours (..., 3) of the camera.

    What is brighter than white is cut off before the matrix, so that blown highlights stay white.
    """
    exposed = np.clip(rgb, 0, 1) * np.float32(2.0**frame.exposure_bias)
    matrix = np.array(frame.matrix, np.float32).reshape(3, 3)
    linear = exposed @ matrix.T
    return np.round(encoded(linear) * 65535).astype(np.uint16)
