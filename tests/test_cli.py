"""The real command line in a process of its own: what it refuses, and what it prints."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from safetensors.numpy import save_file

from epinet.io import LAYOUTS, read_light_field, write_light_field, write_pfm
from epinet.io.images import write_png
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.weights import save_weights

SIZE = (24, 30)


def run(*arguments: object, columns: int | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | ({} if columns is None else {"COLUMNS": str(columns)})
    return subprocess.run(
        [sys.executable, "-m", "epinet", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )


def light_field(views: int = 9, size: tuple[int, int] = SIZE) -> LightField:
    """The same texture in every view: a plane at disparity 0."""
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (*size, 3)).astype(np.uint8)
    array = np.broadcast_to(texture, (views, views, *size, 3)).copy()
    return LightField(array, truth=np.zeros(size, np.float32))


@dataclass(frozen=True)
class Case:
    """Bad input and what the message must say."""

    make: Callable[[Path], list[object]]
    """Prepares files in a folder and returns the command line."""
    says: tuple[str, ...]
    """Regular expressions that the message matches, all of them."""


CASES: dict[str, Case] = {}


def case(*says: str) -> Callable[[Callable[[Path], list[object]]], None]:
    def register(make: Callable[[Path], list[object]]) -> None:
        CASES[make.__name__] = Case(make, says)

    return register


def predicts(path: Path, *more: object) -> list[object]:
    return ["predict", path, "-o", path.parent / "out", *more]


def scene(folder: Path, views: int = 9) -> Path:
    write_light_field(folder / "scene", light_field(views), "hci")
    return folder / "scene"


@case(r"input_Cam004\.png: missing", r"input_Cam072\.png: missing")
def missing_views_are_all_named(folder):
    path = scene(folder)
    (path / "input_Cam004.png").unlink()
    (path / "input_Cam072.png").unlink()
    return predicts(path)


@case(r"input_Cam041\.png")
def truncated_view(folder):
    view = scene(folder) / "input_Cam041.png"
    view.write_bytes(view.read_bytes()[:-200])
    return predicts(view.parent)


@case(r"input_Cam040\.png", r"input_Cam044\.png")
def corrupt_views_are_all_named(folder):
    path = scene(folder)
    for name in ("input_Cam040.png", "input_Cam044.png"):
        (path / name).write_bytes(b"this is no picture")
    return predicts(path)


@case(r"input_Cam000\.png: 31x24 px", r"30x24 px")
def views_of_different_sizes(folder):
    path = scene(folder)
    write_png(path / "input_Cam000.png", np.zeros((24, 31, 3), np.uint8))
    return predicts(path)


@case("3 rows", "4 columns", "square")
def non_square_grid(folder):
    (folder / "grid").mkdir()
    for row in range(3):
        for col in range(4):
            write_png(folder / "grid" / f"v_{row}_{col}.png", np.zeros((*SIZE, 3), np.uint8))
    return predicts(folder / "grid")


@case("10 (views|images)|square")
def count_that_is_no_square(folder):
    (folder / "numbered").mkdir()
    for i in range(10):
        write_png(folder / "numbered" / f"{i:02d}.png", np.zeros((*SIZE, 3), np.uint8))
    return predicts(folder / "numbered")


@case(r"7x7 views", r"need 9x9")
def weights_for_more_views_than_there_are(folder):
    return predicts(scene(folder, views=7), "--weights", "epinet_9x9")


@case(r"at least 3x3|2x2")
def too_few_views(folder):
    np.save(folder / "few.npy", light_field(views=2).views)
    return predicts(folder / "few.npy")


@case(r"too small", r"23x23")
def views_too_small(folder):
    np.save(folder / "tiny.npy", light_field(size=(10, 40)).views)
    return predicts(folder / "tiny.npy")


@case(r"broken\.h5", "HDF5")
def corrupt_hdf5(folder):
    (folder / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(50))
    return predicts(folder / "broken.h5")


@case(r"other\.h5: no dataset LF")
def hdf5_without_views(folder):
    with h5py.File(folder / "other.h5", "w") as file:
        file["something"] = 1
    return predicts(folder / "other.h5")


@case(r"broken\.mat")
def corrupt_mat(folder):
    (folder / "broken.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(300))
    return predicts(folder / "broken.mat")


@case(r"long\.npy", "uint8")
def wrong_dtype(folder):
    np.save(folder / "long.npy", light_field().views.astype(np.int64))
    return predicts(folder / "long.npy")


@case(r"bright\.npy", r"0\.\.1")
def floats_out_of_range(folder):
    np.save(folder / "bright.npy", light_field().views.astype(np.float32))
    return predicts(folder / "bright.npy")


@case(r"nan\.npy", "finite|NaN|nan")
def views_with_nan(folder):
    views = np.zeros((9, 9, *SIZE, 3), np.float32)
    views[4, 4, 3, 3] = np.nan
    np.save(folder / "nan.npy", views)
    return predicts(folder / "nan.npy")


@case(r"cut\.npz")
def truncated_npz(folder):
    np.savez_compressed(folder / "cut.npz", views=light_field().views)
    data = (folder / "cut.npz").read_bytes()
    (folder / "cut.npz").write_bytes(data[: len(data) // 2])
    return predicts(folder / "cut.npz")


@case(r"none\.npz", "views")
def npz_without_views(folder):
    np.savez(folder / "none.npz", numbers=np.arange(5))
    return predicts(folder / "none.npz")


def with_truth(folder: Path, truth: np.ndarray) -> list[object]:
    path = scene(folder)
    write_pfm(path / "gt_disp_lowres.pfm", truth)
    return predicts(path)


@case(r"gt_disp_lowres\.pfm", "NaN at every pixel")
def truth_of_nan(folder):
    return with_truth(folder, np.full(SIZE, np.nan, np.float32))


@case(r"gt_disp_lowres\.pfm", r"truth is 31x24 px")
def truth_of_another_size(folder):
    return with_truth(folder, np.zeros((24, 31), np.float32))


@case(r"gt_disp_lowres\.pfm", r"one \(H, W\) map|colour")
def truth_in_colour(folder):
    return with_truth(folder, np.zeros((*SIZE, 3), np.float32))


@case(r"gt_disp_lowres\.pfm")
def pfm_with_a_lying_header(folder):
    path = scene(folder)
    (path / "gt_disp_lowres.pfm").write_bytes(b"Pf\n30 24\n-1.0\n" + bytes(100))
    return predicts(path)


@case(r"gt_disp_lowres\.pfm")
def pfm_of_absurd_size(folder):
    path = scene(folder)
    (path / "gt_disp_lowres.pfm").write_bytes(b"Pf\n1000000000 1000000000\n-1.0\n" + bytes(9))
    return predicts(path)


@case(r"parameters\.cfg", "baseline_mm")
def broken_camera(folder):
    path = scene(folder)
    (path / "parameters.cfg").write_text(
        "[intrinsics]\nfocal_length_mm = 100\nimage_resolution_x_px = 30\n"
        "image_resolution_y_px = 24\nsensor_size_mm = 35\n"
        "[extrinsics]\nnum_cams_x = 9\nnum_cams_y = 9\nbaseline_mm = wide\nfocus_distance_m = 2\n"
    )
    return predicts(path)


@case(r"invalid_mask\.png", "31x24 px")
def mask_of_another_size(folder):
    path = scene(folder)
    write_png(path / "invalid_mask.png", np.zeros((24, 31, 1), np.uint8))
    return predicts(path)


@case(r"input_Cam040\.png", r"parameters\.cfg", r"gt_disp_lowres\.pfm")
def everything_wrong_is_told_at_once(folder):
    path = scene(folder)
    (path / "input_Cam040.png").write_bytes(b"")
    (path / "parameters.cfg").write_text("no section")
    (path / "gt_disp_lowres.pfm").write_bytes(b"P6\n")
    return predicts(path)


@case("the folder is empty")
def empty_folder(folder):
    (folder / "empty").mkdir()
    return predicts(folder / "empty")


@case(r"nowhere: no such file or folder")
def path_that_is_not_there(folder):
    return predicts(folder / "nowhere")


@case(r"a file, but the layout hci is a folder")
def file_where_a_folder_is_due(folder):
    np.save(folder / "views.npy", light_field().views)
    return predicts(folder / "views.npy", "--layout", "hci")


@case(r"a folder, but the layout array is a file")
def folder_where_a_file_is_due(folder):
    return predicts(scene(folder), "--layout", "array")


@case(r"no layout is named lytro", "rows_cols")
def unknown_layout(folder):
    return predicts(scene(folder), "--layout", "lytro")


@case(r"photo\.png", "14")
def picture_that_is_no_light_field(folder):
    write_png(folder / "photo.png", np.zeros((100, 101, 3), np.uint8))
    return predicts(folder / "photo.png")


@case(r"notes\.txt", "Layouts understood")
def file_of_no_known_kind(folder):
    (folder / "notes.txt").write_text("hello")
    return predicts(folder / "notes.txt")


@case(r"taken: cannot be written")
def output_inside_a_file(folder):
    (folder / "taken").write_text("")
    return ["predict", scene(folder), "-o", folder / "taken"]


@case("a folder with other things in it")
def output_over_the_input(folder):
    return ["predict", scene(folder), "-o", folder]


@case("also named scene")
def inputs_of_one_name(folder):
    return ["predict", scene(folder), scene(folder / "other"), "-o", folder / "out"]


@case(r"w\.safetensors: no such weights file")
def weights_that_are_not_there(folder):
    return predicts(scene(folder), "--weights", folder / "w.safetensors")


@case(r"w\.safetensors: not a readable safetensors file")
def weights_that_are_damaged(folder):
    (folder / "w.safetensors").write_bytes(b"not weights at all")
    return predicts(scene(folder), "--weights", folder / "w.safetensors")


@case(r"w\.safetensors: safetensors, but not weights of epinet")
def weights_of_something_else(folder):
    save_file({"x": np.zeros(3, np.float32)}, folder / "w.safetensors")
    return predicts(scene(folder), "--weights", folder / "w.safetensors")


@case("model 'other': there are sweepnet, epinet")
def unknown_model(folder):
    return predicts(scene(folder), "--model", "other")


@case("weights of epinet, not of sweepnet")
def weights_of_another_model(folder):
    return predicts(scene(folder), "--model", "sweepnet", "--weights", "epinet_9x9")


@case("device 'gpu' cannot be used")
def unknown_device(folder):
    return predicts(scene(folder), "--device", "gpu")


@case("memory bound must be positive")
def no_memory(folder):
    return predicts(scene(folder), "--memory", "0")


@case("memory bound must be positive")
def endless_memory(folder):
    return predicts(scene(folder), "--memory", "inf")


@case(r"views at .row, column. \[\(0, 0\)\]", "are black")
def stack_that_lacks_a_view(folder):
    views = light_field().views.copy()
    views[0, 0] = 0
    np.save(folder / "views.npy", views)
    return predicts(folder / "views.npy", "--weights", "epinet_9x9")


@case(r"w\.safetensors, its configuration: views must be one of")
def weights_of_an_impossible_network(folder):
    header = {"format": "epinet-1", "config": '{"views": 11}', "metadata": "{}"}
    save_file({"x": np.zeros(3, np.float32)}, folder / "w.safetensors", metadata=header)
    return predicts(scene(folder), "--weights", folder / "w.safetensors")


def trains(folder: Path, *arguments: object) -> list[object]:
    return ["train", "-o", folder / "out", *arguments]


@case("batch: .*not 0", "steps: .*not -5")
def training_of_what_cannot_be(folder):
    (folder / "mine.yaml").write_text("base: fast-9x9\nbatch: 0\n")
    return trains(folder, "--recipe", folder / "mine.yaml", "--set", "steps=-5")


@case("recipe 'paper-8x8': no such file", "paper-9x9")
def training_by_an_unknown_recipe(folder):
    return trains(folder, "--recipe", "paper-8x8")


@case(r"bare: no truth to learn from", r"bare: views of 30x24 px are smaller than a patch")
def training_on_a_scene_without_truth(folder):
    write_light_field(folder / "bare", replace(light_field(), truth=None), "hci")
    return trains(folder, "--data", folder / "bare")


@case(r"nowhere")
def training_on_scenes_that_are_not_there(folder):
    return trains(folder, "--data", folder / "nowhere")


@case(r"w\.safetensors: weights of another network")
def training_from_weights_of_another_network(folder):
    net = Epinet(EpinetConfig(streams=2, views=9, stream_width=2))
    save_weights(folder / "w.safetensors", net, {})
    return trains(folder, "--set", f"start={folder / 'w.safetensors'}")


@case(r"last\.pt: not a checkpoint that can be continued", "remove it to begin anew")
def training_from_a_damaged_checkpoint(folder):
    (folder / "out").mkdir()
    (folder / "out" / "last.pt").write_bytes(b"half of it")
    return trains(folder)


@case(r"iter\.hdf5: cannot be read as weights of Keras")
def importing_what_is_no_hdf5(folder):
    (folder / "iter.hdf5").write_bytes(b"nothing")
    return ["weights", "import", folder / "iter.hdf5", "-o", folder / "w.safetensors"]


@case("every 5th view")
def step_beyond_the_grid(folder):
    return predicts(scene(folder), "--step", "5")


@case("no such file or folder")
def info_on_nothing(folder):
    return ["info", folder / "nowhere"]


@case("a folder with other things in it")
def demo_over_other_things(folder):
    (folder / "thesis.txt").write_text("")
    return ["demo", "-o", folder]


@case("--range -1,1 and --no-range exclude each other")
def range_that_is_none(folder):
    return predicts(scene(folder), "--range", "-1,1", "--no-range")


def synth(folder: Path, *more: object, scenes: int = 1, size: str = "32x24") -> list[object]:
    return ["synth", folder / "set", "--scenes", scenes, "--size", size, *more]


@case("a data set of 0 scenes: at least 1")
def data_set_of_nothing(folder):
    return synth(folder, scenes=0)


@case(r"the disparity range 4\.\.-4 px is empty")
def data_set_of_an_empty_range(folder):
    return synth(folder, "--range", "4,-4")


@case("range broad: give narrow, hci, wide or LOW,HIGH")
def data_set_of_an_unknown_range(folder):
    return synth(folder, "--range", "broad")


@case("size 32by24: give WIDTHxHEIGHT")
def data_set_of_a_size_that_is_none(folder):
    return synth(folder, size="32by24")


@case("20x16 px are too small", "23x23")
def data_set_that_could_not_be_read(folder):
    return synth(folder, size="20x16")


@case(r"about \d+ MB are needed, \d+ MB are free")
def data_set_beyond_the_disk(folder):
    return synth(folder, scenes=50, size="99999x99999")


@case("--resume keeps what is there, --force replaces it")
def data_set_to_keep_and_to_replace(folder):
    return synth(folder, "--resume", "--force")


@case("photos: holds no readable image")
def data_set_of_photographs_that_are_none(folder):
    (folder / "photos").mkdir()
    (folder / "photos" / "holiday.jpg").write_text("not a picture")
    return synth(folder, "--textures", folder / "photos")


@case("set: not empty", "--resume", "--force")
def data_set_over_other_things(folder):
    scene(folder / "set")
    return synth(folder)


@case(r"set: no data set of epinet \(dataset\.json is missing")
def data_set_to_replace_that_is_none(folder):
    scene(folder / "set")
    return synth(folder, "--force")


@case("set: a file stands where the data set would go")
def data_set_where_a_file_is(folder):
    (folder / "set").write_text("")
    return synth(folder)


@case("no data set of epinet")
def validation_set_among_other_things(folder):
    scene(folder)
    return ["validation", folder]


@dataclass(frozen=True)
class Outcome:
    """What a command did."""

    done: subprocess.CompletedProcess[str]
    before: dict[str, bytes]
    after: dict[str, bytes]


def snapshot(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    files = (p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory) -> dict[str, Outcome]:
    """All cases, two processes at a time."""

    def attempt(name: str) -> Outcome:
        folder = tmp_path_factory.mktemp(name)
        arguments = CASES[name].make(folder)
        before = snapshot(folder)
        return Outcome(run(*arguments), before, snapshot(folder))

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(CASES, pool.map(attempt, CASES), strict=True))


def test_there_are_enough_cases():
    assert len(CASES) >= 25


@pytest.mark.parametrize("name", CASES)
def test_bad_input_gets_one_clear_message(outcomes, name):
    outcome = outcomes[name]
    done = outcome.done
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert "error: " in done.stderr
    for pattern in CASES[name].says:
        assert re.search(pattern, done.stderr), done.stderr
    assert done.stdout == ""
    assert outcome.after == outcome.before


def test_long_messages_are_neither_wrapped_nor_cut(tmp_path):
    name = "a_rather_long_name_" * 8
    done = run("info", tmp_path / name, columns=40)
    assert f"{name}: no such file or folder" in done.stderr


def test_help_names_every_layout():
    text = run("predict", "--help", columns=200).stdout
    for name in LAYOUTS:
        assert name in text


def test_predict_and_info_from_disk_to_result(tmp_path):
    path = scene(tmp_path)
    done = run(*predicts(path), columns=40)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert line.startswith("scene: disparity")
    assert line.endswith(f"-> {tmp_path / 'out' / 'scene'}")
    again = run(*predicts(path))
    assert "done before" in again.stdout
    done = run("info", "--json", path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["grid"] == {"rows": 9, "columns": 9, "present": 81}
    assert report["truth"] == {"min_px": 0, "max_px": 0, "known": 1}
    text = run("info", path, columns=40).stdout
    assert "30x24 px, 8-bit RGB" in text


def test_demo_from_nothing_to_a_scored_map(tmp_path):
    for _ in range(2):  # it can be run again
        done = run("demo", "-o", tmp_path / "demo")
        assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "demo" / "result" / "run.json").read_text())
    truth = read_light_field(tmp_path / "demo" / "scene").truth
    assert result["scores"]["mse_x100"] < 0.2 * 100 * truth.var()
    assert (tmp_path / "demo" / "result" / "preview.png").stat().st_size > 10_000


def test_synth_from_nothing_to_a_data_set_with_a_sheet(tmp_path):
    done = run(*synth(tmp_path, "--range", "-1,1", "--star", "--sheet"))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert any(line.startswith("disparity") for line in lines)
    assert lines[-1] == f"1 scenes -> {tmp_path / 'set'}"
    lf = read_light_field(tmp_path / "set" / "scene_00000")
    assert (lf.size, lf.present.sum(), lf.truth.shape) == ((24, 32), 33, (24, 32))
    assert (tmp_path / "set" / "sheet.png").stat().st_size > 10_000
    before = snapshot(tmp_path)
    assert run(*synth(tmp_path, "--range", "-1,1", "--star", "--resume")).returncode == 0
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(("own", "spins"), [(None, "1000"), ("7", "7")])
def test_waiting_threads_let_other_programs_work(own, spins):
    """Set before torch is loaded, which reads it once; what the user set stays."""
    script = (
        "import os, sys\n"
        "from epinet.cli import main\n"
        "early = 'torch' not in sys.modules\n"
        "sys.argv = ['epinet', '--version']\n"
        "try: main()\n"
        "except SystemExit: print(early, os.environ['GOMP_SPINCOUNT'])\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "GOMP_SPINCOUNT"}
    environment |= {} if own is None else {"GOMP_SPINCOUNT": own}
    out = subprocess.check_output([sys.executable, "-c", script], env=environment, text=True)
    assert out.splitlines()[-1] == f"True {spins}"
