"""Weights of the reference implementation: HDF5 files of Keras' `save_weights` or `save`.

The model of its `define_epinet` holds six nested Sequential models, in this order: the streams for
90, 0, 45 and -45 degrees, the merge part and the end. Their layers are called S1_c10, S1_c20 and
S1_BN0 and so on (of stream blocks), S2_... (of merge blocks), S3_c10 and S3_last; Keras may append
_1, _2, ... where a name is taken.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.hdf5 import array_of, member, open_hdf5
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.weights import Weights, check_tensors
from epinet.reading import check_decoded

_WEIGHT = re.compile(
    r"(?P<layer>S[12]_(?:c1|c2|BN)\d|S3_c10|S3_last)(?:_\d+)?/(?P<kind>\w+?)(?::0)?$"
)
_KINDS = {
    "kernel": "weight",
    "bias": "bias",
    "gamma": "weight",
    "beta": "bias",
    "moving_mean": "running_mean",
    "moving_variance": "running_var",
}
_PLACE_IN_BLOCK = {"c1": 0, "c2": 2, "BN": 3}


def read_keras(path: Path) -> Weights:
    """Read such a file as weights that see plain gray views.

    Raises:
        InputError: no HDF5 file, or not of that model: names what is missing or does not fit.
    """
    with open_hdf5(path, "weights of Keras in HDF5") as file:
        groups = list(_groups(member(file, "model_weights", path) or file, path))
    streams = 0
    tensors: dict[str, NDArray[np.float32]] = {}
    for arrays in groups:
        tensors |= {_ours(name, streams): array for name, array in arrays.items()}
        streams += "S1_c10/kernel" in arrays
    first = tensors.get("streams.0.0.0.weight")
    if first is None or first.ndim != 4:
        raise InputError(
            f"{path}: no layer S1_c10 in it, so these are not weights of the reference EPINET"
        )
    try:
        config = EpinetConfig(streams, views=first.shape[1], stream_width=first.shape[0])
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    found = {name: torch.from_numpy(array) for name, array in tensors.items()}
    check_tensors(found, lambda: Epinet(config), "the published network", path)
    net = Epinet(config)
    net.load_state_dict(found, strict=False)
    return Weights(net.eval(), {"input": "gray", "imported_from": path.name}, str(path))


def _groups(root: Any, path: Path) -> Iterator[dict[str, NDArray[np.float32]]]:
    """Arrays of each part of the model by "layer/kind"; parts in the model's order."""
    needed = 0
    for name in root.attrs.get("layer_names", sorted(root)):
        name = name.decode() if isinstance(name, bytes) else str(name)
        part = member(root, name, path)
        if not isinstance(part, h5py.Group):
            raise InputError(f"{path}: {name} is no group of a layer's weights")
        keys: list[str] = []
        part.visit(keys.append)  # it follows no links
        arrays = {}
        for key in keys:
            match = _WEIGHT.search(key)
            if match is not None and isinstance(part[key], h5py.Dataset):
                needed += part[key].nbytes
                check_decoded(path, needed, "its arrays")
                array = array_of(part, key, path)
                kernel = np.ndim(array) == 4  # (height, width, in, out)
                values = np.transpose(array, (3, 2, 0, 1)) if kernel else array
                values = np.ascontiguousarray(values, np.float32)
                arrays[f"{match['layer']}/{match['kind']}"] = values
        if arrays:
            yield arrays


def _ours(name: str, stream: int) -> str:
    """Name in our network of "layer/kind" of the reference's."""
    layer, kind = name.split("/")
    ours = _KINDS.get(kind, kind)
    if layer == "S3_c10":
        return f"head.0.{ours}"
    if layer == "S3_last":
        return f"head.2.{ours}"
    part, place, block = layer[:2], layer[3:-1], layer[-1]
    where = f"streams.{stream}" if part == "S1" else "merge"
    return f"{where}.{block}.{_PLACE_IN_BLOCK[place]}.{ours}"
