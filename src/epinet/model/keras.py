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
from epinet.io.problems import parsing
from epinet.model.checkpoint import Weights
from epinet.model.epinet import Epinet, EpinetConfig

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
    with parsing(path, "weights of Keras in HDF5"), h5py.File(path) as file:
        groups = list(_groups(file.get("model_weights", file)))
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
    net = Epinet(config)
    _load(net, tensors, path)
    return Weights(net.eval(), {"input": "gray", "imported_from": path.name}, str(path))


def _groups(root: Any) -> Iterator[dict[str, NDArray[np.float32]]]:
    """Arrays of each part of the model by "layer/kind"; parts in the model's order."""
    for name in root.attrs.get("layer_names", sorted(root)):
        part = root[name.decode() if isinstance(name, bytes) else name]
        keys: list[str] = []
        part.visit(keys.append)
        arrays = {}
        for key in keys:
            match = _WEIGHT.search(key)
            if match is not None and isinstance(part[key], h5py.Dataset):
                array = part[key][()]
                kernel = np.ndim(array) == 4  # (height, width, in, out)
                values = np.transpose(array, (3, 2, 0, 1)) if kernel else array
                arrays[f"{match['layer']}/{match['kind']}"] = np.array(values, np.float32)
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


def _load(net: Epinet, arrays: dict[str, NDArray[np.float32]], path: Path) -> None:
    wanted = {n: t for n, t in net.state_dict().items() if not n.endswith("num_batches_tracked")}
    problems = []
    for name in sorted(wanted.keys() | arrays.keys()):
        if name not in arrays:
            problems.append(f"{path}: {name} is missing")
        elif name not in wanted:
            problems.append(f"{path}: {name} is of no layer of the published network")
    tensors = {}
    for name in wanted.keys() & arrays.keys():
        tensors[name] = torch.from_numpy(np.ascontiguousarray(arrays[name]))
        there, here = tuple(tensors[name].shape), tuple(wanted[name].shape)
        if there != here:
            problems.append(f"{path}: {name} is {there}, the published network has {here}")
    if problems:
        raise InputError(problems)
    net.load_state_dict(tensors, strict=False)
