"""`epinet evaluate` and `epinet submit` in processes of their own."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from epinet.io import write_light_field, write_pfm
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.weights import save_weights
from epinet.synth.generator import render_scene
from epinet.synth.options import Options

SIZE = (40, 48)
MAP = np.zeros(SIZE)


def run(*arguments: object, columns: int = 80) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "epinet", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=os.environ | {"COLUMNS": str(columns)},
        check=False,
    )


def scene(folder: Path, name: str = "a", truth: np.ndarray = MAP) -> Path:
    write_pfm(folder / "data" / name / "gt_disp_lowres.pfm", truth)
    return folder / "data"


def maps(folder: Path, **given: np.ndarray) -> Path:
    for name, map_ in given.items():
        write_pfm(folder / "maps" / f"{name}.pfm", map_)
    return folder / "maps"


def evaluate(folder: Path, *more: object) -> list[object]:
    return ["evaluate", folder / "maps", "--data", folder / "data", "-o", folder / "out", *more]


CASES: dict[str, tuple[Callable[[Path], list[object]], tuple[str, ...]]] = {}


def case(*says: str):
    def register(make):
        CASES[make.__name__] = (make, says)

    return register


@case(
    r"maps/a\.pfm: the map is 48x38 px, it must be 48x40 px",
    r"maps/b\.pfm: in colour",
    r"left out: d \(no maps of them in ",
    r"left out: maps of c, stranger in ",
    r"c/gt_disp_lowres\.pfm: truth is NaN at every pixel",
    r"w\.safetensors: no such weights file",
    r"nothing: no maps in it",
)
def everything_at_once(folder):
    for name in ("a", "b", "d"):
        scene(folder, name)
    scene(folder, "c", MAP * np.nan)
    maps(folder, a=MAP[2:], b=np.zeros((*SIZE, 3)), c=MAP, stranger=MAP)
    (folder / "nothing").mkdir()
    return evaluate(folder, folder / "w.safetensors", folder / "nothing")


@case("no truth to score against")
def scene_without_truth(folder):
    lf = render_scene(Options(size=(32, 32)), seed=1, index=0, star_only=True)
    write_light_field(folder / "data" / "a", lf, "hci")
    (folder / "data" / "a" / "gt_disp_lowres.pfm").unlink()
    maps(folder, a=MAP)
    return evaluate(folder)


@case("no scene in it")
def folder_without_scenes(folder):
    (folder / "data").mkdir()
    maps(folder, a=MAP)
    return evaluate(folder)


@case("scene boxes: not there; there are a", r"BadPix\(-1\)", "method maps: given more than once")
def options_that_cannot_be(folder):
    scene(folder)
    maps(folder, a=MAP)
    return evaluate(folder, "--scene", "boxes", "--badpix", "-1", folder / "maps")


@case("a border of 30 px leaves nothing of 48x40 px")
def border_beyond_the_scene(folder):
    scene(folder)
    maps(folder, a=MAP)
    return evaluate(folder, "--border", 30)


@case("data/a: no views in it for a model to see")
def model_on_a_scene_without_views(folder):
    scene(folder)
    return ["evaluate", "sweepnet", "--data", folder / "data"]


@case("give MAPS_OR_MODEL and -o")
def submission_of_nothing(folder):
    return ["submit", "-o", folder / "x.zip"]


@case(r"no map of scene backgammon", r"boxes\.pfm: the map is 48x40 px, it must be 512x512 px")
def submission_of_too_little(folder):
    return ["submit", maps(folder, boxes=MAP), "-o", folder / "x.zip"]


@case(r"x\.zip: cannot be read as a zip")
def check_of_what_is_no_zip(folder):
    (folder / "x.zip").write_text("no zip")
    return ["submit", "--check", folder / "x.zip"]


def snapshot(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """All cases, two processes at a time."""

    def attempt(name: str):
        folder = tmp_path_factory.mktemp(name)
        arguments = CASES[name][0](folder)
        before = snapshot(folder)
        return run(*arguments), before, snapshot(folder)

    with ThreadPoolExecutor(2) as pool:
        return dict(zip(CASES, pool.map(attempt, CASES), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_named_and_nothing_is_written(outcomes, name):
    done, before, after = outcomes[name]
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    for pattern in CASES[name][1]:
        assert re.search(pattern, done.stderr), done.stderr
    assert after == before


def test_maps_and_a_model_from_disk_to_report(tmp_path):
    """Piped into 40 columns: no line is cut."""
    lf = render_scene(Options(size=(64, 64)), seed=1, index=0, star_only=True)
    write_light_field(tmp_path / "data" / "a", lf, "hci")
    maps(tmp_path, a=lf.truth)
    save_weights(tmp_path / "net.safetensors", Epinet(EpinetConfig(views=3, stream_width=2)), {})
    done = run(*evaluate(tmp_path, tmp_path / "net.safetensors", "--badpix", 0.5), columns=40)
    assert done.returncode == 0, done.stderr
    header, units, ours, model, *_ = done.stdout.splitlines()
    assert header.split()[:3] == ["scene", "method", "BadPix(.5)"] and "Runtime" in header
    assert len(header) == len(units) == len(model)
    assert ours.split()[:3] == ["a", "maps", "0.00"]
    assert float(model.split()[2]) > 0
    assert done.stdout.splitlines()[-1] == f"-> {tmp_path / 'out' / 'report.html'}"
    assert (tmp_path / "out" / "maps" / "net" / "a" / "run.json").exists()


def test_maps_of_scenes_that_are_not_asked_for_do_not_matter(tmp_path):
    scene(tmp_path, "a", MAP + 1), maps(tmp_path, a=MAP - 1, b=MAP)
    done = run(*evaluate(tmp_path))
    assert done.returncode == 0, done.stderr
    left_out, hint = done.stderr.splitlines()
    assert left_out == f"left out: maps of b in {tmp_path / 'maps'} (the scenes are a)"
    assert "the maps of maps seem to have the opposite sign" in hint
