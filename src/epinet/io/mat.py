"""Arrays of numbers in .mat files of Matlab: v5, and v7.3, which is HDF5 with the axes reversed."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.hdf5 import array_of, member, open_hdf5
from epinet.io.problems import listed, parsing
from epinet.reading import check_decoded, check_regular, open_regular

_KIND = "a .mat file"
_BYTES = {"double": 8, "single": 4} | {
    f"{sign}int{8 * n}": n for sign in ("u", "") for n in (1, 2, 4, 8)
}
"""Of a value, by Matlab's class."""
_COMPRESSED = 15
_STORED = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
"""Types in which a v5 file may store numbers."""
_COMPLEX = 0x800
_HEAD_BYTES = 4096
"""Of a variable; more than its flags, shape and name take."""


def read_variable(path: Path, name: str) -> NDArray[Any]:
    """An array of numbers by its name, with the axes in Matlab's order.

    Raises:
        InputError: a damaged file, or no such array of numbers.
    """
    with parsing(path, _KIND):
        if _is_v73(path):
            with open_hdf5(path, _KIND) as file:
                return array_of(file, name, path).T
        return _read_v5(path, name)


def has_variable(path: Path, name: str) -> bool:
    """Whether there is a variable of any kind by that name; no file of Matlab has none.

    Raises:
        InputError and others: the file is damaged.
    """
    from scipy.io import whosmat

    if _is_v73(path):
        with open_hdf5(path, _KIND) as file:
            return name in file
    with open_regular(path) as file:
        start = file.read(128)
    if start[126:] not in (b"IM", b"MI") and 0 not in start[:4]:  # the order of bytes; v4
        return False
    return any(each == name for each, _, _ in whosmat(path))


def read_only_map(path: Path) -> NDArray[np.float32]:
    """(H, W) the only array of the file that is an image of one value a pixel, whatever its name.

    Raises:
        InputError: a damaged file, or none or several such arrays.
    """
    with parsing(path, _KIND):
        shapes = _shapes_v73(path) if _is_v73(path) else _shapes_v5(path)
        maps = [name for name, shape in shapes.items() if len(shape) == 2 and min(shape) > 1]
        if len(maps) != 1:
            arrays = [f"{name} {shape}" for name, shape in shapes.items()]
            raise InputError(
                f"{path}: a map must be the only (H, W) array of numbers in its file, which holds "
                f"{listed(arrays) or 'no arrays of numbers'}"
            )
        array = read_variable(path, maps[0])
        if array.dtype.kind not in "fiu":
            raise InputError(f"{path}: {maps[0]} holds {array.dtype}, not real numbers")
        return array.astype(np.float32)


def _is_v73(path: Path) -> bool:
    import h5py

    check_regular(path)
    return bool(h5py.is_hdf5(path))


def _shapes_v5(path: Path) -> dict[str, tuple[int, ...]]:
    """Of its arrays of numbers."""
    from scipy.io import whosmat

    return {name: shape for name, shape, kind in whosmat(path) if kind in _BYTES}


def _shapes_v73(path: Path) -> dict[str, tuple[int, ...]]:
    import h5py

    shapes = {}
    with open_hdf5(path, _KIND) as file:
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                continue
            found = member(file, name, path)
            if not isinstance(found, h5py.Dataset) or found.shape is None:
                continue
            kind = found.attrs.get("MATLAB_class", b"double")
            if found.dtype.kind in "uif" and np.bytes_(kind).decode("ascii") in _BYTES:
                shapes[name] = tuple(reversed(found.shape))
    return shapes


def _read_v5(path: Path, name: str) -> NDArray[Any]:
    from scipy.io import loadmat, whosmat

    variables = {each: (shape, kind) for each, shape, kind in whosmat(path)}
    if name not in variables:
        raise InputError(
            f"{path}: no variable {name}; it holds {listed(list(variables)) or 'nothing'}"
        )
    shape, kind = variables[name]
    if kind not in _BYTES:
        raise InputError(f"{path}: {name} is a {kind} array of Matlab, not one of numbers")
    check_decoded(path, math.prod(shape) * _BYTES[kind], name)
    _check_stored_v5(path, name)
    return np.asarray(loadmat(path, variable_names=[name])[name])


def _check_stored_v5(path: Path, name: str) -> None:
    """Refuse a variable stored in a type that there is not, at which scipy would crash.

    Raises:
        InputError: it is so stored, or complex.
    """
    with open_regular(path) as file:
        start = file.read(128)
        if 0 in start[:4]:  # v4, which has no such types
            return
        found = False
        order = "<" if start[126:128] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}2I", tag)
            after = file.tell() + size
            if kind == _COMPRESSED:
                head = zlib.decompressobj().decompress(file.read(size), _HEAD_BYTES)[8:]
            else:
                head = file.read(min(size, _HEAD_BYTES))
            file.seek(after)
            parts = _elements(head, order)
            if len(parts) < 4 or parts[2][1] != name.encode("latin1"):
                continue
            found = True
            if struct.unpack(f"{order}I", parts[0][1][:4])[0] & _COMPLEX:
                raise InputError(f"{path}: {name} is complex; store real numbers")
            if parts[3][0] not in _STORED:
                raise ValueError(f"{name} is stored in the unknown type {parts[3][0]}")
        if not found:
            raise ValueError(f"{name} is not where it must be")


def _elements(head: bytes, order: str) -> list[tuple[int, bytes]]:
    """Type and bytes of flags, shape, name and values (as far as `head` goes) of a variable."""
    parts: list[tuple[int, bytes]] = []
    at = 0
    while len(parts) < 4 and at + 8 <= len(head):
        kind, count = struct.unpack_from(f"{order}2I", head, at)
        if kind >> 16:  # of up to 4 bytes, which stand in the place of the count
            parts.append((kind & 0xFFFF, head[at + 4 : at + 4 + (kind >> 16)]))
            at += 8
        else:
            parts.append((kind, head[at + 8 : at + 8 + count]))
            at += 8 + -(-count // 8) * 8
    return parts
