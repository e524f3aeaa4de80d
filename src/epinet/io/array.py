"""Layout `array`: a numpy file, and what any array must be to serve as views.

`.npy` holds (V, U, H, W) or (V, U, H, W, C); `.npz` holds it as `views` (or as its only array of 4
or 5 axes), with an optional (H, W) `truth`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.layout import Layout
from epinet.io.numpy_file import npy_shape, read_npy, read_npz
from epinet.io.problems import parsing
from epinet.io.truth import checked_truth
from epinet.lightfield import LightField
from epinet.reading import open_regular

_SUFFIXES = (".npy", ".npz")
_NAMES = ("views", "truth")
_VIEW_AXES = (4, 5)
_NPY, _ZIP = b"\x93NUMPY", b"PK"
_AXES = (
    "(rows, columns, height, width) or (rows, columns, height, width, channels) with 1, 3 or 4 "
    "channels"
)


def recognises(path: Path) -> bool:
    """Whether it is named like a numpy file."""
    return path.suffix.lower() in _SUFFIXES


def holds_views(path: Path) -> bool:
    """Whether an array in it is named `views`, or has the axes of views."""
    if not _begins_as(path, _NPY, _ZIP):
        return False
    if _begins_as(path, _NPY):
        return len(npy_shape(path)) in _VIEW_AXES
    arrays = read_npz(path, lambda name, axes: False)
    return any(name == "views" or array.ndim in _VIEW_AXES for name, array in arrays.items())


def read(path: Path) -> LightField:
    """Read views and, from an .npz, the truth.

    Raises:
        InputError: a damaged file, arrays of another shape or type, or unusable truth.
    """
    with parsing(path, "a numpy file"):
        arrays = _load(path)
    lf = light_field_of(_views(path, arrays), path)
    if "truth" not in arrays:
        return lf
    return replace(lf, truth=checked_truth(arrays["truth"], lf.size, f"{path}, truth"))


def write(path: Path, lf: LightField) -> None:
    """Write the views; an .npz takes the truth as well."""
    with path.open("wb") as file:
        if path.suffix.lower() == ".npy":
            np.save(file, lf.views)
        elif lf.truth is None:
            np.savez(file, views=lf.views)
        else:
            np.savez(file, views=lf.views, truth=lf.truth)


def light_field_of(array: NDArray[Any], path: Path) -> LightField:
    """A light field from (V, U, H, W) gray or (V, U, H, W, C) views; a 4th channel is dropped.

    Takes uint8, uint16, and float32 or float64 in 0..1 (both become float32). A view that is 0
    throughout counts as not present.

    Raises:
        InputError: another shape, type or range.
    """
    if array.dtype.names or array.dtype.kind in "OSUV":
        raise InputError(f"{path}: views are {_kind_of(array)}; expected one array of numbers")
    if order := wrong_axes(array.shape):
        raise InputError(f"{path}: views of shape {array.shape}: {order}")
    if array.ndim == 4:
        array = array[..., None]
    if array.ndim != 5 or array.shape[4] not in (1, 3, 4) or array.size == 0:
        raise InputError(f"{path}: views of shape {array.shape}; expected {_AXES}")
    if array.shape[4] == 4:
        array = array[..., :3]
    if array.dtype.kind == "f" and array.dtype.itemsize in (4, 8):
        check_range(array, path)
        dtype = np.dtype(np.float32)
    elif array.dtype.kind == "u" and array.dtype.itemsize in (1, 2):
        dtype = array.dtype.newbyteorder("=")
    else:
        raise InputError(
            f"{path}: views are {array.dtype}; expected uint8, uint16, or float32/float64 in 0..1"
        )
    views = np.ascontiguousarray(array, dtype=dtype)
    return LightField(views, present_views(views))


def has_reversed_axes(shape: tuple[int, ...]) -> bool:
    """Whether it can only be (channels, width, height, columns, rows), as MATLAB writes HDF5."""
    return (
        len(shape) == 5
        and shape[0] in (1, 3, 4)
        and shape[4] == shape[3] < min(shape[1:3])
        and shape[3] > 0
    )


def wrong_axes(shape: tuple[int, ...]) -> str | None:
    """What order the axes of views seem to have, and how to put them right; None if as expected.

    Views are larger than grids: so two equal sides that are smaller than two others are the grid's.
    """
    gray, colour = len(shape) == 4, len(shape) == 5
    if not (gray or colour) or 0 in shape:
        return None
    if has_reversed_axes(shape):
        return (
            "the axes are in reversed order, (channels, width, height, columns, rows), as MATLAB's "
            f"h5write and Julia leave them; transpose(4, 3, 2, 1, 0) makes {_AXES}"
        )
    if gray and shape[3] in (3, 4) and shape[0] > shape[3] and min(shape[1:3]) > shape[3]:
        side = math.isqrt(shape[0])
        square = side**2 == shape[0]
        into = f"reshape to ({side}, {side}, ...)" if square else "a square grid has 9, 25, 49 ..."
        return f"a stack of {shape[0]} colour views on one axis; {into}: expected {_AXES}"
    views, pixels = shape[2:4], shape[:2]
    if views[0] == views[1] < min(pixels):
        order = "(2, 3, 0, 1, 4)" if colour else "(2, 3, 0, 1)"
        return (
            f"the axes seem to be in the order (height, width, rows, columns), pixels first; "
            f"transpose{order}, or (3, 2, 1, 0) if all are reversed, makes {_AXES}"
        )
    return None


def check_range(views: NDArray[Any], where: object) -> None:
    """Refuse float views that no camera gives.

    Raises:
        InputError: values that are not finite, or beyond 0..1, and what makes them fit.
    """
    low, high = float(views.min()), float(views.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        count = views.size - int(np.isfinite(views).sum())
        raise InputError(
            f"{where}: {count} values of the float views are not finite (NaN or infinite); fill "
            "them, or leave out the views"
        )
    if low >= 0 and high <= 1:
        return
    remedy = "bring them to that range, black at 0 and white at 1"
    if -1 <= low < 0 and high <= 1:
        remedy = "if they are in -1..1, (views + 1) / 2 is right"
    elif low >= 0:
        white = next((w for w in (255, 1023, 4095, 65535) if high <= w), None)
        remedy = f"if white is {white}, views / {white} is right" if white else remedy
    raise InputError(f"{where}: float views must lie in 0..1, these in {low:g}..{high:g}; {remedy}")


def _kind_of(array: NDArray[Any]) -> str:
    if array.dtype.names:
        return f"a struct of {', '.join(array.dtype.names)}"
    return {"O": "objects", "S": "text", "U": "text"}.get(array.dtype.kind, "no numbers")


def present_views(views: NDArray[Any]) -> NDArray[np.bool_]:
    """(V, U): which views of an array are there, that is, not 0 throughout."""
    return np.asarray(views.any(axis=(2, 3, 4)))


def _load(path: Path) -> dict[str, NDArray[Any]]:
    if _begins_as(path, _NPY):
        return {"views": read_npy(path)}
    if _begins_as(path, _ZIP):
        return read_npz(path, lambda name, axes: name in _NAMES or axes in _VIEW_AXES)
    raise InputError(f"{path}: not a numpy file, or its beginning is damaged")


def _begins_as(path: Path, *magic: bytes) -> bool:
    with open_regular(path) as file:
        return file.read(len(_NPY)).startswith(magic)


def _views(path: Path, arrays: dict[str, NDArray[Any]]) -> NDArray[Any]:
    if "views" in arrays:
        return arrays["views"]
    candidates = [name for name, array in arrays.items() if array.ndim in _VIEW_AXES]
    if len(candidates) != 1:
        found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
        raise InputError(f"{path}: needs an array named views; it holds {found}")
    return arrays[candidates[0]]


LAYOUT = Layout(
    name="array",
    description="numpy .npy, or .npz with `views` and optional `truth`: (rows, columns, H, W[, C])",
    recognises=recognises,
    read=read,
    write=write,
    suffixes=_SUFFIXES,
    holds_views=holds_views,
)
