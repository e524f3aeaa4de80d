"""Every reader: a valid file for it, and what reads it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import torch
from PIL import Image
from plenoptic_forward import (
    ILLUM,
    Optics,
    pack,
    white_image,
    write_capture,
    write_white,
)

from epinet.benchmark.maps import MapFile, find_maps, result_map
from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.benchmark.submission import check_submission, write_submission
from epinet.camera import Camera
from epinet.io import read_light_field, write_light_field
from epinet.io.camera_file import CameraFacts, read_camera, write_camera
from epinet.io.lftoolbox import write_v73
from epinet.io.pfm import read_pfm, write_pfm
from epinet.lightfield import LightField
from epinet.model.checkpoint import load_weights, save_weights
from epinet.model.epinet import Epinet, EpinetConfig
from epinet.model.keras import read_keras
from epinet.model.sweepnet import SweepNet
from epinet.predict.estimator import Estimator
from epinet.predict.result import Result
from epinet.predict.stored import read_result
from epinet.raw import decode
from epinet.raw.white import find_whites
from epinet.synth.dataset import read_record
from epinet.train.log import Log
from epinet.train.recipe_files import load_recipe, parse_changes

SIZE = (32, 40)


@dataclass(frozen=True)
class Reader:
    """One way in for files of strangers."""

    make: Callable[[Path], Path]
    """Writes a valid input into a folder; returns the file to be mutated."""
    read: Callable[[Path], object]
    """Reads it by the path of that file; raises AssertionError of a result that is not good."""


def light_field(side: int = 3, dtype: str = "uint8") -> LightField:
    dice = np.random.default_rng(3)
    views = dice.integers(1, 255, (side, side, *SIZE, 3)).astype(dtype)
    camera = Camera(50, 36, 5, 800, SIZE[1], SIZE[0], -2, 2)
    truth = dice.uniform(-1, 1, SIZE).astype(np.float32)
    return LightField(views, camera=camera, truth=truth)


def good_light_field(path: Path) -> None:
    lf = read_light_field(path)
    assert np.isfinite(lf.views).all()
    assert lf.truth is None or np.isfinite(lf.truth).any()
    assert lf.camera is None or not np.isnan(lf.camera.depth_mm(np.zeros(1))).any()


def written(name: str, layout: str, side: int = 3, dtype: str = "uint8") -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        write_light_field(folder / name, light_field(side, dtype), layout)
        return folder / name

    return make


def part_of_scene(name: str) -> Reader:
    """A file of a folder in the benchmark's layout."""
    make = written("scene", "hci")
    return Reader(lambda folder: make(folder) / name, lambda path: good_light_field(path.parent))


def image(name: str, mode: str = "RGB") -> Reader:
    """An ESLF image."""

    def make(folder: Path) -> Path:
        pixels = np.zeros((32 * 14, 32 * 14, 3), np.uint8)
        pixels.reshape(32, 14, 32, 14, 3)[:, 2:12, :, 2:12] = 90
        Image.fromarray(pixels).convert(mode).save(folder / name)
        return folder / name

    return Reader(make, good_light_field)


def v73(folder: Path) -> Path:
    write_v73(folder / "a.mat", light_field())
    return folder / "a.mat"


def pfm(folder: Path) -> Path:
    write_pfm(folder / "a.pfm", np.ones(SIZE, np.float32))
    return folder / "a.pfm"


def npy_map(folder: Path) -> Path:
    np.save(folder / "a.npy", np.ones(SIZE, np.float32))
    return folder / "a.npy"


def facts(path: Path) -> None:
    known = read_camera(path)
    complete = CameraFacts(fov_deg=40, baseline_mm=5, focus_distance_mm=800).completed_by(known)
    complete = complete.model_copy(update={"width_px": None, "height_px": None})
    depth = complete.camera(SIZE).depth_mm(np.linspace(-2, 2, 9))
    assert not np.isnan(depth).any()


def camera(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        known = CameraFacts(
            focal_length_mm=50, sensor_size_mm=36, baseline_mm=5, focus_distance_mm=800,
            width_px=SIZE[1], height_px=SIZE[0],
        )  # fmt: skip
        write_camera(folder / name, known)
        return folder / name

    return make


def recipe(folder: Path) -> Path:
    path = folder / "a.yaml"
    path.write_text(
        "base: sweepnet\nsteps: 20\nlearning_rate: 1.0e-4\nscale_weights: [1, 0, 2]\n"
        "data: [{generator: hci, options: {surfaces: [3, 9], faults: {blur: 0.5}}}]\n"
        "shape: {sweep_width: 8, half: {spread_px: 0.2, side: 3, apart_px: 2, dilations: [1], "
        "rounds: 1}}\n"
    )
    return path


def changes(folder: Path) -> Path:
    (folder / "a.txt").write_text("augmentations=[rotation, {a: 1.0e-3}, 2024-01-01]")
    return folder / "a.txt"


def small_weights(folder: Path) -> Path:
    torch.manual_seed(0)
    about = {"disparity_range_px": [-2, 2], "steps": 5, "recipe": {"name": "a"}, "data": {}}
    net = Epinet(EpinetConfig(views=3, stream_width=2)).eval()
    save_weights(folder / "a.safetensors", net, about)
    return folder / "a.safetensors"


def sweep_weights(folder: Path) -> Path:
    about = {"calibration": {"even_px": 0.07, "steepness": 2.0}}
    save_weights(folder / "a.safetensors", SweepNet().eval(), about)
    return folder / "a.safetensors"


def predicts(path: Path) -> None:
    weights = load_weights(path)
    assert weights.lines()
    result = Estimator(weights, device="cpu").predict(replace(light_field(), camera=None))
    assert np.isfinite(result.disparity).all()
    assert np.isfinite(result.confidence).all()


def keras(folder: Path) -> Path:
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("sequential")
        for name, shape in {"S1_c10": (2, 2, 3, 4), "S1_c20": (2, 2, 4, 4)}.items():
            group[f"{name}/kernel:0"] = np.ones(shape, np.float32)
            group[f"{name}/bias:0"] = np.ones(shape[3], np.float32)
        file.attrs["layer_names"] = [b"sequential"]
    return folder / "a.h5"


def result(folder: Path) -> Path:
    ones = np.ones(SIZE, np.float32)
    settings = {"step": 1, "refine": False, "stated_px": [-1, 1]}
    about = {"seconds": {"network": 1.0}, "weights": {"file": "a"}, "settings": settings}
    Result(ones, ones, replace(light_field(), source=folder / "views", layout="hci"), **about).save(
        folder / "result"
    )
    return folder / "result" / "run.json"


def reads_result(path: Path) -> None:
    stored = read_result(path.parent)
    stored.camera_facts.known()
    result_map(path.parent).read(SIZE)
    find_maps(path.parent.parent, {"result": SIZE})


def data_set(folder: Path) -> Path:
    record = {"kind": "rendered light fields", "seed": 1, "options": {}, "scenes": ["scene_00000"]}
    (folder / "dataset.json").write_text(json.dumps(record))
    return folder / "dataset.json"


def log(folder: Path) -> Path:
    lines = [json.dumps({"step": step, "loss": 0.5, "scores": {"a": 1.0}}) for step in range(9)]
    (folder / "log.jsonl").write_text("\n".join(lines) + "\n")
    return folder / "log.jsonl"


def goes_on(path: Path) -> None:
    log_ = Log.__new__(Log)
    log_.path = path
    log_._keep_until(5)
    assert all(json.loads(line)["step"] <= 5 for line in path.read_bytes().splitlines())


def zipped(folder: Path) -> Path:
    ones = folder / "ones.pfm"
    write_pfm(ones, np.ones((512, 512), np.float32))
    write_submission(folder / "a.zip", {name: MapFile(ones, 1.0) for name in BENCHMARK_SCENES})
    return folder / "a.zip"


OPTICS = Optics(size=(320, 320))


def raw(folder: Path) -> Path:
    body = replace(ILLUM)
    dark = np.random.default_rng(0).integers(100, 900, OPTICS.size, np.uint16)
    return write_capture(folder / "a.lfr", OPTICS, body, pack(dark, body.bits))


def raw_beside(folder: Path) -> Path:
    picture = white_image(OPTICS, ILLUM)
    return write_white(folder, OPTICS, ILLUM, picture, "a").with_suffix(".TXT")


def decodes(path: Path) -> None:
    lf = decode(path.with_suffix(".RAW"), views=3)
    assert lf.camera is None or not np.isnan(lf.camera.depth_mm(np.zeros(1))).any()


def whites(path: Path) -> None:
    for white in find_whites(path.parent):
        white.read()


READERS: dict[str, Reader] = {
    "png": image("a.png"),
    "palette": image("a.png", "P"),
    "jpeg": image("a.jpg"),
    "tiff": image("a.tif"),
    "bmp": image("a.bmp"),
    "webp": image("a.webp"),
    "view": part_of_scene("input_Cam004.png"),
    "parameters": part_of_scene("parameters.cfg"),
    "truth": part_of_scene("gt_disp_lowres.pfm"),
    "npy": Reader(written("a.npy", "array"), good_light_field),
    "npy_float": Reader(written("a.npy", "array", dtype="uint16"), good_light_field),
    "npz": Reader(written("a.npz", "array"), good_light_field),
    "hdf5": Reader(written("a.h5", "hci_hdf5"), good_light_field),
    "mat": Reader(written("a.mat", "lftoolbox"), good_light_field),
    "mat_v73": Reader(v73, good_light_field),
    "pfm": Reader(pfm, read_pfm),
    "map": Reader(npy_map, lambda path: MapFile(path).read(SIZE)),
    "camera_json": Reader(camera("a.json"), facts),
    "camera_yaml": Reader(camera("a.yaml"), facts),
    "recipe": Reader(recipe, lambda path: load_recipe(str(path))),
    "set": Reader(changes, lambda path: parse_changes([path.read_text(errors="replace")])),
    "weights": Reader(small_weights, predicts),
    "sweep_weights": Reader(sweep_weights, predicts),
    "keras": Reader(keras, read_keras),
    "run": Reader(result, reads_result),
    "data_set": Reader(data_set, lambda path: read_record(path.parent)),
    "log": Reader(log, goes_on),
    "submission": Reader(zipped, check_submission),
    "raw": Reader(raw, lambda path: decode(path, views=3)),
    "raw_metadata": Reader(raw_beside, decodes),
    "white_metadata": Reader(raw_beside, whites),
}

BROKEN: dict[str, Reader] = {
    "raises": Reader(log, lambda path: {}["key"]),
    "grows": Reader(log, lambda path: bytearray(4 * 2**30)),
    "ends": Reader(log, lambda path: os._exit(3)),
}
"""What the harness must see."""
