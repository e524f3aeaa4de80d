"""Layout `lftoolbox`: a .mat file of Dansereau's Light Field Toolbox for Matlab.

Variable `LF` (t, s, v, u, c): t and s are row and column of the view, v and u of the pixel; a 4th
channel is a weight and is dropped. Matlab's v5 files, and v7.3 ones, which are HDF5 with the axes
reversed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from epinet.io.array import light_field_of
from epinet.io.layout import Layout
from epinet.io.mat import has_variable, read_variable
from epinet.lightfield import LightField

_USER_BLOCK_BYTES = 512
_TEXT_BYTES = 116
"""Of the description that a .mat file begins with."""
_V5_LIMIT_BYTES = 2**31 - 1


def recognises(path: Path) -> bool:
    """Whether it is named like a .mat file."""
    return path.suffix.lower() == ".mat"


def holds_views(path: Path) -> bool:
    """Whether it has a variable LF."""
    return has_variable(path, "LF")


def read(path: Path) -> LightField:
    """Read the views of either version.

    Raises:
        InputError: a damaged file, or no usable variable LF.
    """
    return light_field_of(read_variable(path, "LF"), path)


def write(path: Path, lf: LightField) -> None:
    """Write `LF`: v5, or v7.3 where it is too large for v5 (2 GiB)."""
    if lf.views.nbytes > _V5_LIMIT_BYTES:
        write_v73(path, lf)
    else:
        write_v5(path, lf)


def write_v5(path: Path, lf: LightField) -> None:
    """Write `LF` as Matlab v5."""
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {"LF": lf.views})
        file.seek(0)  # scipy writes the time, so that no file would be like another
        file.write(b"MATLAB 5.0 MAT-file, written by epinet".ljust(_TEXT_BYTES))


def write_v73(path: Path, lf: LightField) -> None:
    """Write `LF` as Matlab v7.3."""
    import h5py

    matlab_class = "single" if lf.views.dtype == np.float32 else lf.views.dtype.name
    with h5py.File(path, "w", userblock_size=_USER_BLOCK_BYTES) as file:
        file.create_dataset("LF", data=lf.views.T, track_times=False)
        file["LF"].attrs["MATLAB_class"] = np.bytes_(matlab_class)
    text = b"MATLAB 7.3 MAT-file, written by epinet".ljust(_TEXT_BYTES)
    version_and_byte_order = b"\0" * 8 + b"\x00\x02" + b"IM"
    with path.open("r+b") as raw:
        raw.write(text + version_and_byte_order)


LAYOUT = Layout(
    name="lftoolbox",
    description=".mat of the Light Field Toolbox: variable LF (t, s, v, u, c)",
    recognises=recognises,
    read=read,
    write=write,
    suffixes=(".mat",),
    holds_views=holds_views,
)
