"""PGM and PPM images: text or binary, of any largest value up to 65535.

Samples are scaled so that the largest value that the header states is white: light fields of JPEG
Pleno hold 10 bits, and common readers leave them dark or cut them to 8.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.reading import check_decoded

_BYTES, _TEXT_BYTES = 9, 64
"""That a sample takes while it is decoded, at most."""

_COMMENT = rb"#[^\r\n]*"
_NUMBER = rb"(?:\s|" + _COMMENT + rb"[\r\n])+(\d{1,9})"
_HEADER = re.compile(rb"P([2356])" + 3 * _NUMBER + rb"(?:" + _COMMENT + rb")?\s")


def is_pnm(data: bytes) -> bool:
    """Whether it begins as a PGM or PPM does."""
    return data[:2] in (b"P2", b"P3", b"P5", b"P6") and data[2:3].isspace()


def decode_pnm(path: Path, data: bytes) -> NDArray[Any]:
    """(H, W, 1 or 3) uint8, or uint16 where the largest value is above 255.

    Raises:
        InputError: a header that cannot be, or too few or too large samples.
    """
    header = _HEADER.match(data)
    if header is None:
        raise InputError(f"{path}: the header of this PGM or PPM is damaged")
    kind, width, height, largest = map(int, header.groups())
    channels = 3 if kind in (3, 6) else 1
    count = width * height * channels
    if count == 0 or not 1 <= largest <= 65535:
        raise InputError(
            f"{path}: its header states {width}x{height} px and a largest value of {largest}"
        )
    body = data[header.end() :]
    is_text, wide = kind in (2, 3), largest > 255
    if (len(body) + 1) // 2 < count if is_text else len(body) < count * (1 + wide):
        raise _cut_off(path, width, height)
    check_decoded(path, count * (_TEXT_BYTES if is_text else _BYTES), "the image")
    if is_text:
        words = body.split(maxsplit=count)[:count]
        samples = np.array(words, dtype="S6").astype(np.int64)
    else:
        samples = np.frombuffer(body, ">u2" if wide else "u1", count)
    if len(samples) < count:
        raise _cut_off(path, width, height)
    if samples.max() > largest or samples.min() < 0:
        raise InputError(f"{path}: samples up to {samples.max()}, its header says {largest}")
    white = 65535 if wide else 255
    if largest != white:
        samples = (samples.astype(np.int64) * white + largest // 2) // largest
    pixels = samples.astype(np.uint16 if wide else np.uint8)
    return pixels.reshape(height, width, channels)


def _cut_off(path: Path, width: int, height: int) -> InputError:
    return InputError(
        f"{path}: fewer samples than the {width}x{height} px of its header take; it is cut off, "
        "copy or download it again"
    )
