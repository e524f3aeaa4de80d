"""Arrays of HDF5 files, without ever leaving the file.

A dataset may keep its values in another file or a device (external storage), in datasets of other
files (virtual datasets), or lie behind a link to another file. A crafted archive would so put any
file of the user's into a picture: they are refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.problems import listed, parsing
from epinet.reading import check_decoded, check_regular

_NAMED = 10


@contextmanager
def open_hdf5(path: Path, kind: str = "HDF5") -> Iterator[Any]:
    """The file as h5py has it.

    Args:
        path: of the file.
        kind: for messages about damage.

    Raises:
        InputError: no regular file, or whatever h5py raises inside the block.
    """
    import h5py

    with parsing(path, kind):
        check_regular(path)
        with h5py.File(path, "r") as file:
            yield file


def member(group: Any, name: str, path: Path) -> Any:
    """An object of a group by its own name; None where there is none.

    Raises:
        InputError: it is a link, which could lead out of the file.
    """
    import h5py

    link = group.get(name, getlink=True)
    if link is None:
        return None
    if not isinstance(link, h5py.HardLink):
        raise InputError(f"{path}: {name} is a link, which is not followed; store the data itself")
    return group[name]


def array_of(group: Any, name: str, path: Path) -> NDArray[Any]:
    """Values of a dataset of numbers that lie in this file.

    Raises:
        InputError: there is no such dataset, or its values are elsewhere, no numbers or too many.
    """
    import h5py

    found = member(group, name, path)
    if found is None:
        held = [str(key) for _, key in zip(range(_NAMED + 1), group, strict=False)]
        raise InputError(f"{path}: no dataset {name}; it holds {listed(held, _NAMED) or 'nothing'}")
    if not isinstance(found, h5py.Dataset):
        inside = [
            f"{key} {getattr(found.get(key), 'shape', '')}".rstrip()
            for _, key in zip(range(_NAMED), found, strict=False)
            if isinstance(found.get(key, getlink=True), h5py.HardLink)
        ]
        raise InputError(
            f"{path}: {name} is a group, such as a struct of MATLAB's, of "
            f"{listed(inside) or 'nothing'}; store the array itself as {name}"
        )
    if found.external or found.is_virtual:
        raise InputError(
            f"{path}: {name} keeps its values in other files, which are not followed; store them "
            "in the file itself"
        )
    if found.dtype.kind not in "uif" or found.shape is None:
        raise InputError(f"{path}: {name} holds {found.dtype}, not numbers")
    check_decoded(path, found.size * found.dtype.itemsize, name)
    return np.asarray(found[()])
