"""PFM (portable float map), the benchmark's format of disparity maps.

Three header lines (`Pf` gray or `PF` colour, `width height`, `scale`), then float32 rows from the
bottom up. The scale's sign is the byte order: negative is little-endian. Values are multiplied by
its magnitude, as the benchmark's own toolkit does.
"""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.problems import parsing
from epinet.reading import open_regular, read_bytes

_GAP = rb"(?:\s|#[^\r\n]*[\r\n])+"
_HEADER = re.compile(rb"(P[Ff])" + _GAP + rb"(\S+)" + _GAP + rb"(\S+)" + _GAP + rb"(\S+)")
_LONGEST_HEADER = 2**16
"""Bytes; comments have some room."""
_LINE_END = re.compile(rb"[ \t]*(?:#[^\r\n]*)?(?:\r\n|\n|\r)")


def read_pfm(path: str | Path) -> NDArray[np.float32]:
    """Read a map, top row first: (H, W) of a gray file, (H, W, 3) of a colour one.

    Under a scale of 1 or -1 every value comes back bit for bit (NaN payloads too), under another
    multiplied by its magnitude. CRLF headers and `#` comments are accepted.

    Raises:
        InputError: no such file, not a PFM, or a header that does not fit the data's length.
    """
    path = Path(path)
    with parsing(path, "PFM"), open_regular(path) as file:
        _check_size(path, file.read(_LONGEST_HEADER), os.fstat(file.fileno()).st_size)
        return decode_pfm(read_bytes(path), path)[0]


def decode_pfm(data: bytes, path: Path | str) -> tuple[NDArray[np.float32], float]:
    """Values as `read_pfm` gives them, and the scale, from the content of a file.

    Args:
        data: the content.
        path: where it comes from, for messages.

    Raises:
        InputError: as `read_pfm`.
    """
    header = _HEADER.match(data)
    if header is None:
        raise InputError(
            f"{path}: not a PFM file: it must begin with Pf or PF, width, height and scale"
        )
    magic, width_text, height_text, scale_text = header.groups()
    width, height = (_size(path, text) for text in (width_text, height_text))
    scale = _scale(path, scale_text)
    byte_order = "<" if scale < 0 else ">"
    shape = (height, width, 3) if magic == b"PF" else (height, width)
    start = _data_start(path, data, header.end(), shape)
    rows = np.frombuffer(data, dtype=f"{byte_order}f4", offset=start).reshape(shape)
    values = np.ascontiguousarray(rows[::-1], dtype=np.float32)
    if abs(scale) != 1:
        with np.errstate(over="ignore", invalid="ignore"):  # too large a scale gives inf
            values = values * np.float32(abs(scale))
    return values, scale


def write_pfm(path: str | Path, array: NDArray[Any], *, big_endian: bool = False) -> None:
    """Write a map (H, W) or (H, W, 3), top row first; other types are converted to float32.

    A failure leaves no partial file.

    Raises:
        InputError: another shape, no pixels, or an unwritable path.
    """
    array = np.asarray(array)
    if not (array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)) or array.size == 0:
        raise InputError(f"{path}: a PFM holds (H, W) or (H, W, 3) values, not {array.shape}")
    height, width = array.shape[:2]
    magic = "Pf" if array.ndim == 2 else "PF"
    header = f"{magic}\n{width} {height}\n{1.0 if big_endian else -1.0}\n".encode()
    rows = array.astype(">f4" if big_endian else "<f4")[::-1]
    with atomic_path(path) as temporary:
        temporary.write_bytes(header + rows.tobytes())


def _check_size(path: Path, beginning: bytes, size: int) -> None:
    """Refuse a file that its header does not fit before all of it is read."""
    header = _HEADER.match(beginning)
    if header is None:
        decode_pfm(beginning, path)  # says what is wrong with it
        return
    magic, width, height, _ = header.groups()
    needed = 4 * _size(path, width) * _size(path, height) * (3 if magic == b"PF" else 1)
    if not needed < size <= needed + _LONGEST_HEADER:
        raise _misfit(
            path, (_size(path, height), _size(path, width)), needed, size - header.end() - 1
        )


def _size(path: Path | str, text: bytes) -> int:
    if not re.fullmatch(rb"\d{1,18}", text) or int(text) == 0:
        raise InputError(
            f"{path}: width and height must be positive whole numbers, not {text[:40]!r}"
        )
    return int(text)


def _scale(path: Path | str, text: bytes) -> float:
    try:
        scale = float(text)
    except ValueError:
        scale = math.nan
    if not math.isfinite(scale) or scale == 0:
        raise InputError(
            f"{path}: the scale must be a finite number other than 0, not {text[:40]!r}"
        )
    return scale


def _data_start(path: Path | str, data: bytes, header_end: int, shape: tuple[int, ...]) -> int:
    """Where the values begin: behind the one line end that follows the scale.

    Values may themselves look like line ends, so the place is found from the file's length.
    """
    expected = 4 * math.prod(shape)
    start = len(data) - expected
    if start <= header_end or not _LINE_END.fullmatch(data, header_end, start):
        raise _misfit(path, shape, expected, len(data) - header_end - 1)
    return start


def _misfit(path: Path | str, shape: tuple[int, ...], expected: int, found: int) -> InputError:
    return InputError(
        f"{path}: the header says {shape[1]}x{shape[0]} px, {expected} bytes of values, but "
        f"{max(0, found)} follow it; the file is incomplete or damaged"
    )
