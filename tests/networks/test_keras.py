"""Weights of the reference, from files written here as Keras writes them."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch

from epinet.errors import InputError
from epinet.io import read_pfm, write_light_field
from epinet.lightfield import LightField
from epinet.networks.epinet import EpinetConfig
from epinet.networks.epinet.keras import read_keras
from epinet.networks.inputs import GRAY
from epinet.networks.weights import load_weights
from epinet.predict.estimator import Estimator

VIEWS, WIDTH = 5, 3


def conv(rng, name, c_in, c_out):
    kernel = rng.normal(0, (2 / (4 * c_in)) ** 0.5, (2, 2, c_in, c_out))
    return {f"{name}/kernel:0": kernel, f"{name}/bias:0": rng.normal(0, 0.1, c_out)}


def norm(rng, name, c):
    return {
        f"{name}/gamma:0": rng.uniform(0.5, 1.5, c),
        f"{name}/beta:0": rng.normal(0, 0.1, c),
        f"{name}/moving_mean:0": rng.normal(0, 0.1, c),
        f"{name}/moving_variance:0": rng.uniform(0.5, 1.5, c),
    }


def blocks(rng, part, count, c_in, c, suffix):
    """S1_c10, S1_c20, S1_BN0, S1_c11 and so on; Keras numbers repeated names."""
    weights = {}
    for i in range(count):
        weights |= conv(rng, f"{part}_c1{i}{suffix}", c_in if i == 0 else c, c)
        weights |= conv(rng, f"{part}_c2{i}{suffix}", c, c)
        weights |= norm(rng, f"{part}_BN{i}{suffix}", c)
    return weights


def reference_model() -> dict[str, dict[str, np.ndarray]]:
    """Weights of each nested Sequential, with the channels of `define_epinet`."""
    rng = np.random.default_rng(1)
    model = {}
    for k in range(4):
        suffix = "" if k == 0 else f"_{k}"
        model[f"sequential_{k + 1}"] = blocks(rng, "S1", 3, VIEWS, WIDTH, suffix)
    model["sequential_5"] = blocks(rng, "S2", 7, 4 * WIDTH, 4 * WIDTH, "")
    model["sequential_6"] = conv(rng, "S3_c10", 4 * WIDTH, 4 * WIDTH) | conv(
        rng, "S3_last", 4 * WIDTH, 1
    )
    return model


def write(path: Path, model, *, whole: bool = False, nested: bool = True) -> Path:
    """As `save_weights` does, or, where `whole`, as `save`."""
    inputs = ["input_stack_LtoRb", "input_stack_UtoDb", "input_stack_5cb", "input_stack_7cb"]
    with h5py.File(path, "w") as file:
        root = file.create_group("model_weights") if whole else file
        names = [*inputs, *list(model)[:4], "mid_LRUDa", *list(model)[4:]]
        root.attrs["layer_names"] = [name.encode() for name in names]
        for name in names:
            group = root.create_group(name)
            weights = model.get(name, {})
            group.attrs["weight_names"] = [key.encode() for key in weights]
            for key, value in weights.items():
                group[f"{name}/{key}" if nested else key] = value.astype(np.float32)
    return path


def convolved(x, kernel, bias):
    """Valid 2x2 convolution of (H, W, C) as Keras computes it."""
    h, w = x.shape[0] - 1, x.shape[1] - 1
    out = np.zeros((h, w, kernel.shape[-1]))
    for i in range(2):
        for j in range(2):
            out += x[i : i + h, j : j + w] @ kernel[i, j]
    return out + bias


def through(x, weights, part, count, suffix):
    for i in range(count):
        c1, c2, bn = (f"{part}_{layer}{i}{suffix}" for layer in ("c1", "c2", "BN"))
        x = np.maximum(convolved(x, weights[f"{c1}/kernel:0"], weights[f"{c1}/bias:0"]), 0)
        x = convolved(x, weights[f"{c2}/kernel:0"], weights[f"{c2}/bias:0"])
        mean, variance = weights[f"{bn}/moving_mean:0"], weights[f"{bn}/moving_variance:0"]
        x = (x - mean) / np.sqrt(variance + 1e-3)
        x = np.maximum(x * weights[f"{bn}/gamma:0"] + weights[f"{bn}/beta:0"], 0)
    return x


def reference_forward(model, stacks):
    """(H - 22, W - 22) from four (H, W, N) stacks, layer by layer in numpy."""
    parts = list(model.values())
    features = [
        through(stack, parts[k], "S1", 3, "" if k == 0 else f"_{k}")
        for k, stack in enumerate(stacks)
    ]
    x = through(np.concatenate(features, axis=-1), parts[4], "S2", 7, "")
    x = np.maximum(convolved(x, parts[5]["S3_c10/kernel:0"], parts[5]["S3_c10/bias:0"]), 0)
    return convolved(x, parts[5]["S3_last/kernel:0"], parts[5]["S3_last/bias:0"])[..., 0]


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("nested", [False, True])
def test_an_imported_network_gives_what_the_reference_gives(tmp_path, whole, nested):
    model = reference_model()
    weights = read_keras(write(tmp_path / "iter.hdf5", model, whole=whole, nested=nested))
    assert weights.net.config == EpinetConfig(views=VIEWS, stream_width=WIDTH)
    assert weights.input is GRAY
    stacks = np.random.default_rng(2).random((4, 27, 26, VIEWS))
    expected = reference_forward(model, stacks)
    with torch.no_grad():
        seen = torch.from_numpy(stacks).permute(0, 3, 1, 2)[None].float()
        found = weights.net(seen)[0, 0].numpy()
    assert np.std(expected) > 1e-3
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_imported_by_command_they_predict(tmp_path):
    """Bit for bit what the file holds, and used by `epinet predict --weights`."""

    def epinet(*arguments: object) -> str:
        command = [sys.executable, "-m", "epinet", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    file = write(tmp_path / "iter.hdf5", reference_model())
    imported = tmp_path / "theirs.safetensors"
    assert "4 streams of 5 views" in epinet("weights", "import", file, "-o", imported)
    kept, held = load_weights(imported).net.state_dict(), read_keras(file).net.state_dict()
    assert kept.keys() == held.keys()
    assert all(torch.equal(kept[name], held[name]) for name in held)
    views = np.random.default_rng(3).integers(0, 256, (5, 5, 30, 34, 3), dtype=np.uint8)
    lf = LightField(views=views)
    write_light_field(tmp_path / "scene", lf, "hci")
    epinet("predict", tmp_path / "scene", "--weights", imported, "-o", tmp_path / "out")
    disparity = read_pfm(tmp_path / "out" / "scene" / "disparity.pfm")
    expected = Estimator(load_weights(imported), device="cpu").predict(lf).disparity
    np.testing.assert_allclose(disparity, expected, atol=1e-4 * np.abs(expected).max())


def test_what_does_not_fit_is_named(tmp_path):
    model = reference_model()
    del model["sequential_5"]["S2_BN3/gamma:0"]
    model["sequential_6"]["S3_last/kernel:0"] = np.zeros((3, 3, 4 * WIDTH, 1))
    with pytest.raises(InputError) as caught:
        read_keras(write(tmp_path / "iter.hdf5", model))
    text = str(caught.value)
    assert "'merge.3.3.weight' is missing" in text
    assert "'head.2.weight' is (1, 12, 3, 3), the published network has (1, 12, 2, 2)" in text


def test_files_of_something_else(tmp_path):
    path = tmp_path / "other.hdf5"
    with h5py.File(path, "w") as file:
        file["dense/kernel:0"] = np.zeros((3, 3))
    with pytest.raises(InputError, match="not weights of the reference"):
        read_keras(path)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"other\.hdf5: cannot be read"):
        read_keras(path)
