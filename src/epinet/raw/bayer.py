"""The sensor's raw pixels: unpacking their bits, and which colour each sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]

RED, GREEN, BLUE = 0, 1, 2

_MOSAICS = {
    "r": ((RED, GREEN), (GREEN, BLUE)),
    "gr": ((GREEN, RED), (BLUE, GREEN)),
    "gb": ((GREEN, BLUE), (RED, GREEN)),
    "b": ((BLUE, GREEN), (GREEN, RED)),
}
UPPER_LEFT_PIXELS = tuple(_MOSAICS)
"""How a mosaic can begin; gr is a green pixel in a row with red ones."""

BITS = (10, 12)


def packed_bytes(height: int, width: int, bits: int) -> int:
    """How many bytes the pixels take."""
    return height * width * bits // 8


def unpack(data: bytes, size: tuple[int, int], bits: int) -> NDArray[np.uint16]:
    """(H, W) pixels of 10 bits (Illum) or 12 bits (F01), packed without gaps.

    10 bits: 5 bytes hold 4 pixels, the high 8 bits of each in turn, then a byte with their low
    bits, the first pixel's lowest. 12 bits: 3 bytes hold 2 pixels, big endian.

    Args:
        data: exactly `packed_bytes` of them.
        size: (height, width), height * width a multiple of 4.

    Example:
        >>> unpack(bytes([0x12, 0x34, 0x56] * 2), (1, 4), 12)
        array([[ 291, 1110,  291, 1110]], dtype=uint16)
    """
    source = np.frombuffer(data, np.uint8)
    pixels = np.empty(size[0] * size[1], np.uint16)
    if bits == 10:
        groups = source.reshape(-1, 5)
        for i in range(4):
            low = groups[:, 4] >> (2 * i) & 3
            pixels[i::4] = groups[:, i].astype(np.uint16) << 2 | low
    else:
        groups = source.reshape(-1, 3)
        middle = groups[:, 1].astype(np.uint16)
        pixels[0::2] = groups[:, 0].astype(np.uint16) << 4 | middle >> 4
        pixels[1::2] = (middle & 15) << 8 | groups[:, 2]
    return pixels.reshape(size)


def mosaic(upper_left: str) -> NDArray[np.intp]:
    """(2, 2) colours (RED, GREEN, BLUE) of the pixels with x and y even or odd: [y % 2, x % 2]."""
    return np.array(_MOSAICS[upper_left])


def planes(image: NDArray[Any]) -> list[list[NDArray[Any]]]:
    """The four images, as writable parts of a mosaic, of the pixels [y % 2][x % 2]."""
    return [[image[y::2, x::2] for x in (0, 1)] for y in (0, 1)]
