"""Layout `hci_hdf5`: the older HCI light field archive (Wanner, Meister, Goldluecke 2013).

`/LF` (v, h, y, x, c); `/GT_DEPTH` (y, x) or (v, h, y, x), where present; and the root attributes dH
and dV (distance of the views), focalLength (in pixels) and shift, by which

    disparity = dH * focalLength / depth - shift

in pixels per adjacent view, larger when nearer. Most readers of the archive's files reverse h (its
cameras are stored right to left), some do not, and the file does not say: the images decide. A
file that we write from a camera's views has the attribute captured. Axes in reversed order, as
MATLAB's h5write leaves them, are put right where the sizes tell; GT_DEPTH's are, then, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.inspect.order import Arrangement, check_order
from epinet.io.array import has_reversed_axes, light_field_of
from epinet.io.hdf5 import array_of, member, open_hdf5
from epinet.io.layout import Layout
from epinet.io.truth import checked_truth
from epinet.lightfield import LightField

_SUFFIXES = (".h5", ".hdf5")
REVERSED_COLUMNS = Arrangement(flip_cols=True)
_REVERSED_NOTE = "the views' columns were stored right to left (measured) and have been reversed"


_REVERSED_AXES_NOTE = (
    "the axes of LF were in reversed order, (channels, width, height, columns, rows), as MATLAB's "
    "h5write leaves them, and have been put right"
)


def recognises(path: Path) -> bool:
    """Whether it is named like an HDF5 file."""
    return path.suffix.lower() in _SUFFIXES


def holds_views(path: Path) -> bool:
    """Whether it is HDF5 with something named LF."""
    import h5py

    if not h5py.is_hdf5(path):
        return False
    with open_hdf5(path) as file:
        return "LF" in file


def read(path: Path) -> LightField:
    """Read the views, left to right, and the truth where depth and attributes allow.

    Raises:
        InputError: a damaged file, no usable /LF, or a depth of another size.
    """
    with open_hdf5(path) as file:
        array = array_of(file, "LF", path)
        has_depth = member(file, "GT_DEPTH", path) is not None
        depth = array_of(file, "GT_DEPTH", path) if has_depth else None
        captured = bool(file.attrs.get("captured", False))
        attributes = {name: _number(file.attrs[name], name, path) for name in _stated(file.attrs)}
    is_reversed = has_reversed_axes(array.shape)
    if is_reversed:
        array, depth = array.T, None if depth is None else depth.T
    lf = replace(_left_to_right(light_field_of(array, path)), captured=captured)
    columns_reversed = bool(lf.notes)
    if is_reversed:
        lf = replace(lf, notes=(*lf.notes, _REVERSED_AXES_NOTE))
    if depth is None:
        return lf
    if len(attributes) < 3:
        note = "GT_DEPTH is left out: the attributes dH, focalLength and shift are needed with it"
        return replace(lf, notes=(*lf.notes, note))
    if depth.ndim == 4 and depth.shape[:2] == lf.grid:
        if columns_reversed:
            depth = depth[:, ::-1]
        depth = depth[lf.centre]
    truth = checked_truth(_disparity_px(depth, attributes), lf.size, f"{path}, GT_DEPTH")
    return replace(lf, truth=truth)


def _left_to_right(lf: LightField) -> LightField:
    """Reverse the columns if only that makes the views consistent."""
    if min(lf.grid) < 3:
        return lf
    try:
        check = check_order(lf)
    except InputError:  # the views that tell are black; whoever needs them says so
        return lf
    needed = (
        {check.correction} if check.decided_sign else {check.correction, check.correction.reversed}
    )
    if not check.decided_grid or REVERSED_COLUMNS not in needed:
        return lf
    # The layout's own doing, which every reading repeats; `order` tells what a user asked for.
    reversed_ = REVERSED_COLUMNS.apply(lf)
    return replace(reversed_, order=lf.order, notes=(*lf.notes, _REVERSED_NOTE))


def write(path: Path, lf: LightField) -> None:
    """Write the views in their order, and the truth (as depth in mm) if the camera is known."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("LF", data=lf.views, track_times=False)
        if lf.captured:
            file.attrs["captured"] = True
        if lf.camera is None:
            return
        c = lf.camera
        focal_length_px = c.focal_length_mm * max(c.width_px, c.height_px) / c.sensor_size_mm
        file.attrs["dH"] = file.attrs["dV"] = c.baseline_mm
        file.attrs["focalLength"] = focal_length_px
        file.attrs["shift"] = c.baseline_mm * focal_length_px / c.focus_distance_mm
        if lf.truth is not None:
            depth_mm = c.depth_mm(lf.truth)
            file.create_dataset("GT_DEPTH", data=depth_mm, track_times=False)


def _number(value: Any, name: str, path: Path) -> float:
    first = np.ravel(value)[:1]
    if first.size == 0 or first.dtype.kind not in "uif" or not np.isfinite(first[0]):
        raise InputError(f"{path}: the attribute {name} is no finite number")
    return float(first[0])


def _stated(attributes: Mapping[str, Any]) -> list[str]:
    return [name for name in ("dH", "focalLength", "shift") if name in attributes]


def _disparity_px(depth: NDArray[Any], attributes: Mapping[str, float]) -> NDArray[np.float32]:
    """NaN where the depth is not positive; infinitely far is -shift."""
    with np.errstate(over="ignore", invalid="ignore"):  # `checked_truth` refuses what is infinite
        depth = np.where(depth > 0, depth, np.nan).astype(np.float64)
        disparity = attributes["dH"] * attributes["focalLength"] / depth - attributes["shift"]
        return disparity.astype(np.float32)


LAYOUT = Layout(
    name="hci_hdf5",
    description="HDF5 of the older HCI archive: /LF, optionally /GT_DEPTH",
    recognises=recognises,
    read=read,
    write=write,
    suffixes=_SUFFIXES,
    holds_views=holds_views,
    rendered=True,
)
