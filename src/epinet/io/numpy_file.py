"""Arrays of .npy and .npz files: plain numbers, and no more memory than the file can fill."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from epinet.documents import short
from epinet.errors import InputError
from epinet.io.names import is_shown
from epinet.reading import check_decoded, open_regular

_MOST_ARRAYS = 1000
_CHUNK_BYTES = 2**24


def read_npy(path: Path) -> NDArray[Any]:
    """The array of a .npy file.

    Raises:
        InputError: an array of objects or texts, or of more values than the file holds.
        OSError, ValueError and others of numpy: the file is damaged.
    """
    with open_regular(path) as file:
        size = file.seek(0, 2)
        file.seek(0)
        return _array(file, size, path, str(path))


def npy_shape(path: Path) -> tuple[int, ...]:
    """Of the array of a .npy file, by its header.

    Raises:
        InputError, ValueError and others: the header is damaged.
    """
    with open_regular(path) as file:
        return _header(file, str(path))[0]


def read_npz(path: Path, wanted: Callable[[str, int], bool]) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz by name.

    Args:
        path: of the file.
        wanted: whether to read an array of this name and number of axes; of others only the shape
            is true.

    Raises:
        InputError: as `read_npy`, or arrays too large for what the file takes on disk.
        OSError, ValueError, zipfile.BadZipFile and others: the file is damaged.
    """
    found: dict[str, NDArray[Any]] = {}
    needed = 0
    with open_regular(path) as file, zipfile.ZipFile(file) as archive:
        files = [e for e in archive.infolist() if is_shown(Path(e.filename))]
        entries = [e for e in files if e.filename.endswith(".npy")]
        if len(entries) > _MOST_ARRAYS:
            raise InputError(f"{path}: {len(entries)} arrays; at most {_MOST_ARRAYS} are read")
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            where = f"{path}, {short(name)}"
            if name in found:
                raise InputError(f"{where}: there twice")
            with archive.open(entry) as member:
                shape, _, _ = _header(member, where)
            found[name] = np.broadcast_to(np.uint8(0), shape)
            if wanted(name, len(shape)):
                needed += entry.file_size
                check_decoded(path, needed, "its arrays")
                with archive.open(entry) as member:
                    found[name] = _array(member, entry.file_size, path, where)
    return found


def _header(file: IO[bytes], where: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether the first axis is the fastest, and type."""
    if npy.read_magic(file) != (1, 0):  # later versions hold fields
        raise InputError(f"{where}: an array of fields, not of numbers")
    shape, by_columns, dtype = npy.read_array_header_1_0(file)
    if min(shape, default=0) < 0 or math.prod(shape) >= 2**62:
        raise InputError(f"{where}: its header says {short(shape)}, which no array can have")
    return shape, by_columns, dtype


def _array(file: IO[bytes], size: int, path: Path, where: str) -> NDArray[Any]:
    """Read an array whose file has `size` bytes."""
    shape, by_columns, dtype = _header(file, where)
    if dtype.kind not in "buifc":
        raise InputError(f"{where}: an array of {str(dtype)[:40]}, not of numbers")
    needed, there = math.prod(shape) * dtype.itemsize, size - file.tell()
    if needed > there:
        raise InputError(
            f"{where}: its header says {shape} {dtype}, {needed} bytes, but {there} follow it; the "
            "file may be incomplete, copy it again"
        )
    check_decoded(path, needed, "its array")
    values = np.empty(math.prod(shape), dtype)
    buffer = memoryview(values.data).cast("B") if needed else memoryview(b"")
    done = 0
    while done < needed:
        part = file.read(min(_CHUNK_BYTES, needed - done))
        if not part:
            raise InputError(f"{where}: ends after {done} of {needed} bytes; copy it again")
        buffer[done : done + len(part)] = part
        done += len(part)
    return values.reshape(shape, order="F" if by_columns else "C")
