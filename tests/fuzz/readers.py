"""Every reader: a valid file for it, and what reads it."""

from __future__ import annotations

import json
import os
import tarfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import torch
from PIL import Image
from plenoptic_forward import (
    ILLUM,
    Container,
    Optics,
    pack,
    white_image,
    write_capture,
    write_white,
)
from scipy.io import savemat

from epinet.benchmark.maps import MapFile, find_maps, result_map
from epinet.benchmark.scenes import BENCHMARK_SCENES, read_scene
from epinet.benchmark.submission import check_submission, write_submission
from epinet.camera import Camera
from epinet.io import read_light_field, write_light_field
from epinet.io.camera_file import CameraFacts, read_camera, write_camera
from epinet.io.hci import read_view_truths
from epinet.io.lftoolbox import write_v73
from epinet.io.pfm import read_pfm, write_pfm
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.keras import read_keras
from epinet.networks.sweepnet import SweepNet
from epinet.networks.weights import load_weights, save_weights
from epinet.predict.estimator import Estimator
from epinet.predict.result import Result
from epinet.predict.stored import read_result
from epinet.raw import decode
from epinet.raw.white import find_whites, levels, normalised_white
from epinet.synth.dataset import read_record
from epinet.synth.dice import Dice
from epinet.synth.generator import generator
from epinet.synth.photographs import Photographs
from epinet.train.log import Log
from epinet.train.optimisers import Optimisers
from epinet.train.parallel import ALONE
from epinet.train.recipe_files import load_recipe, parse_changes
from epinet.train.run import Run

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


def whole_white(folder: Path) -> Path:
    """The packed pixels of a white image; a capture lies beside its folder."""
    write_capture(folder / "a.lfr", OPTICS, ILLUM, white_image(OPTICS, ILLUM))
    return write_white(folder / "white", OPTICS, ILLUM, white_image(OPTICS, ILLUM))


def white_tar(folder: Path) -> Path:
    path = whole_white(folder)
    with tarfile.open(folder / "caldata.tar", "w") as archive:
        for file in sorted(path.parent.iterdir()):
            archive.add(file, file.name)
    return folder / "caldata.tar"


def white_volume(folder: Path) -> Path:
    """An F01's data.C.0."""
    beside = write_white(folder / "white", OPTICS, ILLUM, white_image(OPTICS, ILLUM))
    file = Container()
    files = [
        {"name": f"C:\\T1CALIB\\{each.name}", "dataRef": file.add(each.read_bytes())}
        for each in (beside, beside.with_suffix(".TXT"))
    ]
    return file.write(folder / "data.C.0", {"files": files}, True)


def flat_fielded(path: Path) -> None:
    """A white image is chosen for a capture and divided by."""
    source = path.parent if path.suffix == ".RAW" else path
    for white in find_whites(source):
        level = normalised_white(levels(white.read(), white.frame), white.frame)
        assert np.isfinite(level).all()


def mat_map(folder: Path) -> Path:
    savemat(folder / "a.mat", {"disparity": np.ones(SIZE, np.float32)})
    return folder / "a.mat"


def mat_map_v73(folder: Path) -> Path:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file["disparity"] = np.ones(SIZE, np.float32).T
    return folder / "a.mat"


def reads_map(path: Path) -> None:
    map_ = MapFile(path).read(SIZE)
    assert map_.shape == SIZE and map_.dtype == np.float32


def run_time(folder: Path) -> Path:
    write_pfm(folder / "scene.pfm", np.ones(SIZE, np.float32))
    (folder / "runtimes").mkdir()
    (folder / "runtimes" / "scene.txt").write_text("12.5\n")
    return folder / "runtimes" / "scene.txt"


def times(path: Path) -> None:
    seconds = find_maps(path.parent.parent, {"scene": SIZE})["scene"].seconds
    assert seconds is not None and 0 < seconds < float("inf")


def with_masks(name: str) -> Callable[[Path], Path]:
    """A scene with objects, masks, truths of other views and of ten times the resolution."""

    def make(folder: Path) -> Path:
        mask, objects = np.zeros(SIZE, bool), np.zeros(SIZE, np.uint16)
        mask[3:9, 4:20], objects[:9] = True, 7
        masks = dict.fromkeys(("invalid", "textureless"), mask)
        lf = replace(light_field(), masks=masks, objects=objects)
        lf = replace(lf, view_truths={(1, 0): lf.truth})
        write_light_field(folder / "scene", lf, "hci")
        write_pfm(folder / "scene" / "gt_disp_highres.pfm", np.ones((10 * SIZE[0], 10 * SIZE[1])))
        return folder / "scene" / name

    return make


def scores(path: Path) -> None:
    """As training and evaluation read a scene."""
    scene = read_scene(path.parent)
    lf = read_light_field(path.parent)
    read_view_truths(path.parent, lf, [(1, 0)])
    masks = scene.masks_of(("invalid",), "low", scene.size)
    assert masks["invalid"].dtype == bool
    if scene.has_high_resolution:
        assert not np.isinf(scene.truth_of("high")).any()


def picture_of_result(name: str) -> Callable[[Path], Path]:
    return lambda folder: result(folder).with_name(name)


def reads_whole_result(path: Path) -> None:
    stored = read_result(path.parent)
    assert stored.disparity.shape == stored.confidence.shape == stored.centre_view.shape[:2]
    assert 0 <= stored.confidence.min() <= stored.confidence.max() <= 1


def photograph(folder: Path) -> Path:
    dice = np.random.default_rng(1)
    for name in ("a.jpg", "b.jpg"):
        Image.fromarray(dice.integers(0, 255, (60, 70, 3), np.uint8)).save(folder / name)
    return folder / "a.jpg"


def photographs(path: Path) -> None:
    Photographs.from_folder(path.parent).draw(Dice(generator(1)), 2, 16)


def begun(folder: Path) -> Run:
    """A run without scenes, to write and read its checkpoint."""
    run = Run.__new__(Run)
    run.recipe = load_recipe("fast-9x9", {"averaging": 0.0})
    run.folder, run.device, run.team = folder, torch.device("cpu"), ALONE
    run.net = Epinet(EpinetConfig(views=3, stream_width=2))
    run.averaged, run._validation = None, None
    run.optimisers = Optimisers(run.net, run.recipe)
    run.step, run.seconds, run.best, run.losses = 3, 1.5, 2.5, [0.5]
    run.started_from, run.history = None, [{"step": 2, "scores": {"badpix_0.07": 2.5}}]
    return run


def checkpoint(folder: Path) -> Path:
    begun(folder).save()
    return folder / "last.pt"


def resumes(path: Path) -> None:
    run = begun(path.parent)
    run._resume()
    assert all(torch.isfinite(t).all() for t in run.net.state_dict().values())
    run.metadata()
    assert run.step + run.seconds >= 0
    assert not run.best < sum(run.losses) - 1e30
    assert run.optimisers.state()


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
    "map": Reader(npy_map, reads_map),
    "map_mat": Reader(mat_map, reads_map),
    "map_mat_v73": Reader(mat_map_v73, reads_map),
    "run_time": Reader(run_time, times),
    "mask": Reader(with_masks("invalid_mask.png"), scores),
    "objects": Reader(with_masks("objectids_lowres.png"), scores),
    "view_truth": Reader(with_masks("gt_disp_lowres_Cam003.pfm"), scores),
    "fine_truth": Reader(with_masks("gt_disp_highres.pfm"), scores),
    "camera_json": Reader(camera("a.json"), facts),
    "camera_yaml": Reader(camera("a.yaml"), facts),
    "recipe": Reader(recipe, lambda path: load_recipe(str(path))),
    "set": Reader(changes, lambda path: parse_changes([path.read_text(errors="replace")])),
    "weights": Reader(small_weights, predicts),
    "sweep_weights": Reader(sweep_weights, predicts),
    "keras": Reader(keras, read_keras),
    "run": Reader(result, reads_result),
    "result_map": Reader(picture_of_result("disparity.pfm"), reads_whole_result),
    "result_confidence": Reader(picture_of_result("confidence.png"), reads_whole_result),
    "result_view": Reader(picture_of_result("centre.png"), reads_whole_result),
    "data_set": Reader(data_set, lambda path: read_record(path.parent)),
    "log": Reader(log, goes_on),
    "submission": Reader(zipped, check_submission),
    "raw": Reader(raw, lambda path: decode(path, views=3)),
    "raw_metadata": Reader(raw_beside, decodes),
    "white_metadata": Reader(raw_beside, whites),
    "white": Reader(whole_white, flat_fielded),
    "white_tar": Reader(white_tar, flat_fielded),
    "white_volume": Reader(white_volume, flat_fielded),
    "photograph": Reader(photograph, photographs),
    "checkpoint": Reader(checkpoint, resumes),
}

BROKEN: dict[str, Reader] = {
    "raises": Reader(log, lambda path: {}["key"]),
    "grows": Reader(log, lambda path: bytearray(4 * 2**30)),
    "ends": Reader(log, lambda path: os._exit(3)),
}
"""What the harness must see."""
