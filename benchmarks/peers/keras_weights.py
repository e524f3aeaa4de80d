"""Our weights in the reference's HDF5 layout: the inverse of `networks.epinet.keras.read_keras`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from epinet.networks.epinet import Epinet

Arrays = Mapping[str, NDArray[np.float32]]


def write_keras(path: Path, net: Epinet) -> None:
    """Write the weights as Keras' `save_weights` does: a group for each nested model, in order.

    Within a group the trained weights come first and the batch-norm statistics last.
    """
    parts = [_blocks("S1", stream) for stream in net.streams]
    parts += [
        _blocks("S2", net.merge),
        _conv("S3_c10", net.head[0]) | _conv("S3_last", net.head[2]),
    ]
    names = ["sequential", *(f"sequential_{k}" for k in range(1, len(parts)))]
    with h5py.File(path, "w") as file:
        file.attrs["layer_names"] = [name.encode() for name in names]
        for name, arrays in zip(names, parts, strict=True):
            ordered = sorted(arrays, key=lambda key: "moving" in key)
            group = file.create_group(name)
            group.attrs["weight_names"] = [key.encode() for key in ordered]
            for key in ordered:
                group[key] = arrays[key]


def _blocks(part: str, sequence: Any) -> Arrays:
    arrays: dict[str, NDArray[np.float32]] = {}
    for i, (first, _, second, norm, _) in enumerate(sequence.children()):
        arrays |= _conv(f"{part}_c1{i}", first) | _conv(f"{part}_c2{i}", second)
        kinds = {
            "gamma": norm.weight,
            "beta": norm.bias,
            "moving_mean": norm.running_mean,
            "moving_variance": norm.running_var,
        }
        arrays |= {f"{part}_BN{i}/{k}:0": v.detach().numpy() for k, v in kinds.items()}
    return arrays


def _conv(name: str, conv: Any) -> dict[str, NDArray[np.float32]]:
    kernel = conv.weight.detach().numpy().transpose(2, 3, 1, 0)  # (height, width, in, out)
    return {f"{name}/kernel:0": kernel, f"{name}/bias:0": conv.bias.detach().numpy()}
