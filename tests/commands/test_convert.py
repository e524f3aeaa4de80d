"""`epinet convert`, and raw captures as input of `info` and `predict`."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from plenoptic_forward import (
    F01,
    ILLUM,
    Container,
    Optics,
    Scene,
    photograph,
    white_image,
    write_capture,
    write_white,
)

from epinet.camera import Camera
from epinet.cli import main
from epinet.io import read_light_field, write_light_field
from epinet.lightfield import LightField
from epinet.raw import decode

OPTICS = Optics(size=(320, 360), pitch=10.0, rotation=-0.00086, centre=(180.2, 159.1))


@dataclass(frozen=True)
class Done:
    """What a command line did."""

    code: int
    out: str
    err: str


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Runs `epinet` with arguments, in this process as starting one takes seconds."""

    def run_main(*arguments: object) -> Done:
        monkeypatch.setattr(sys, "argv", ["epinet", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return Done(int(ended.value.code or 0), *capfd.readouterr())

    return run_main


def capture(folder: Path) -> Path:
    scene = Scene(slope0=5.0, middle=(180, 160), finest_px=60)
    return write_capture(folder / "a.lfp", OPTICS, F01, photograph(OPTICS, F01, scene))


@dataclass(frozen=True)
class Case:
    """Bad input and what the message must say."""

    make: Callable[[Path], list[object]]
    """Prepares files in a folder and returns what follows `convert`."""
    says: tuple[str, ...]


CASES: dict[str, Case] = {}


def case(*says: str) -> Callable[[Callable[[Path], list[object]]], None]:
    def register(make: Callable[[Path], list[object]]) -> None:
        CASES[make.__name__] = Case(make, says)

    return register


@case(r"a\.lfp: the file is cut off", "copy it from the camera again")
def truncated_raw(folder):
    path = capture(folder)
    path.write_bytes(path.read_bytes()[:100_000])
    return [path, folder / "out"]


@case(r"a\.lfp: a JPEG image", r"\.lfp or \.lfr")
def jpeg_in_place(folder):
    (folder / "a.lfp").write_bytes(b"\xff\xd8\xff\xe0" + bytes(100))
    return [folder / "a.lfp", folder / "out"]


@case(r"a\.lfp: camera model 'R29' is not known", "F01", "ILLUM")
def unknown_camera(folder):
    body = replace(F01, model="R29")
    raw = np.zeros(OPTICS.size, np.uint16)
    return [write_capture(folder / "a.lfp", OPTICS, body, raw), folder / "out"]


@case(r"white: white images of another camera", "A303134643", "A000000007")
def white_images_of_another_camera(folder):
    body = replace(F01, serial="A000000007")
    write_white(folder / "white", OPTICS, body, white_image(OPTICS, body))
    return [capture(folder), folder / "out", "--white", folder / "white"]


@case("white: no white image in it", "calibration data")
def folder_without_white_images(folder):
    (folder / "white").mkdir()
    return [capture(folder), folder / "out", "--white", folder / "white"]


@case(r"a-stk\.lfp: a stack of refocused pictures", "the file that the camera wrote")
def refocus_stack(folder):
    file = Container()
    image = file.add(b"\xff\xd8\xff picture")
    contents = {"picture": {"accelerationArray": [{"imageRef": image}]}}
    return [file.write(folder / "a-stk.lfp", contents, True), folder / "out"]


@case(r"a\.lfp: no grid of lenslets")
def black_picture(folder):
    raw = np.random.default_rng(0).normal(F01.black, 3, OPTICS.size).round().astype(np.uint16)
    return [write_capture(folder / "a.lfp", OPTICS, F01, raw), folder / "out"]


@case("8 views: an odd number")
def even_number_of_views(folder):
    return [capture(folder), folder / "out", "--views", 8]


@case(r"out: already exists", "--force")
def output_that_is_there(folder):
    (folder / "out").mkdir()
    return [capture(folder), folder / "out"]


@case(r"other things than the files of a light field are in it \(chapter\.txt\)")
def output_over_other_things(folder):
    (folder / "thesis").mkdir()
    (folder / "thesis" / "chapter.txt").write_text("")
    return [capture(folder), folder / "thesis", "--force"]


@case(r"other things .*\(holiday\.jpg\)")
def output_over_a_light_field_and_more(folder):
    save = np.ones((3, 3, 30, 30, 3), np.uint8)
    write_light_field(folder / "mine", LightField(save), "hci")
    (folder / "mine" / "holiday.jpg").write_text("dear to someone")
    return [capture(folder), folder / "mine", "--force"]


@case(r"out\.lfr: nothing is written as \.lfr", r"\.png", r"\.npz")
def output_of_no_known_kind(folder):
    return [capture(folder), folder / "out.lfr"]


@case(r"views\.npy: --white is for raw captures")
def white_images_for_what_is_not_raw(folder):
    np.save(folder / "views.npy", np.ones((3, 3, 30, 30, 3), np.uint8))
    return [folder / "views.npy", folder / "out", "--white", folder]


@case(r"nothing\.lfp: no such file")
def raw_that_is_not_there(folder):
    return [folder / "nothing.lfp", folder / "out"]


@case("eslf takes 9x9 views, not 7x7")
def grid_that_the_layout_cannot_hold(folder):
    return [capture(folder), folder / "out.png", "--views", 7]


def listing(folder: Path) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


@pytest.mark.parametrize("name", CASES)
def test_bad_input_gets_one_clear_message(tmp_path, run, name):
    arguments = CASES[name].make(tmp_path)
    before = listing(tmp_path)
    done = run("convert", *arguments)
    assert done.code == 2
    assert all(line.startswith("error: ") for line in done.err.splitlines()), done.err
    for pattern in CASES[name].says:
        assert re.search(pattern, done.err), done.err
    assert done.out == ""
    assert listing(tmp_path) == before


def test_raw_to_the_benchmarks_folder_and_eslf(tmp_path, run):
    path = capture(tmp_path)
    white = write_white(tmp_path / "calibration", OPTICS, F01, white_image(OPTICS, F01))
    done = run("convert", path, tmp_path / "scene", "--white", white.parent)
    assert done.code == 0, done.err
    assert "white image" in done.err
    assert re.fullmatch(r".*a\.lfp: 9x9 views of \d+x\d+ px -> .*scene \(hci\)\n", done.out)
    direct = decode(path, white.parent)
    folder = read_light_field(tmp_path / "scene")
    np.testing.assert_array_equal(folder.views, direct.views)
    assert folder.camera == direct.camera and folder.captured
    done = run("convert", tmp_path / "scene", tmp_path / "scene.png")
    assert done.code == 0, done.err
    np.testing.assert_array_equal(read_light_field(tmp_path / "scene.png").views, direct.views)
    done = run("convert", tmp_path / "scene", tmp_path / "few", "--views", 5, "--flip-rows")
    assert done.code == 0, done.err
    assert run("convert", tmp_path / "scene", tmp_path / "few", "--views", 3).code == 2
    few = read_light_field(tmp_path / "few")
    np.testing.assert_array_equal(few.views, direct.views[6:1:-1, 2:7])
    assert run("convert", tmp_path / "scene", tmp_path / "few", "--force").code == 0
    assert read_light_field(tmp_path / "few").grid == (9, 9)


def test_info_and_predict_take_the_raw_file(tmp_path, run):
    path = capture(tmp_path)
    write_white(tmp_path / "white", OPTICS, F01, white_image(OPTICS, F01))
    report = json.loads(run("info", "--json", path).out)
    assert report["layout"] == "lytro_raw"
    assert report["bits"] == 16
    assert report["camera"]["focus_distance_mm"] > 0
    notes = " ".join(report["notes"])
    assert "serial number A303134643" in notes and "MOD_0000.RAW" in notes
    done = run("predict", tmp_path, "-o", tmp_path / "out")
    assert done.code == 0, done.err
    assert done.out.startswith("a: disparity")


def test_the_white_image_in_an_illums_file_is_used(tmp_path):
    optics = Optics(size=(420, 440), centre=(200.3, 198.6))
    raw = photograph(optics, ILLUM, Scene(slope0=5.0, finest_px=75))
    path = write_capture(tmp_path / "a.lfr", optics, ILLUM, raw, white_image(optics, ILLUM))
    lf = decode(path)
    assert lf.notes[0] == "vignetting by the white image in the same file"
    write_white(tmp_path / "white", optics, ILLUM, white_image(optics, ILLUM))
    np.testing.assert_array_equal(decode(path, tmp_path / "white").views, lf.views)


def test_what_a_layout_cannot_hold_is_said(tmp_path, run):
    camera = Camera(50.0, 36.0, 5.0, 800.0, 30, 30)
    views, truth = np.ones((9, 9, 30, 30, 3), np.uint8), np.zeros((30, 30), np.float32)
    lf = LightField(views, camera=camera, truth=truth, masks={"invalid": truth > 0})
    write_light_field(tmp_path / "scene", lf, "hci")
    told = {
        "copy": None,
        "a.npy": "camera, truth, masks",
        "a.npz": "camera, masks",
        "a.png": "camera, truth, masks",
        "a.h5": "camera, masks",
    }
    for name, what in told.items():
        done = run("convert", tmp_path / "scene", tmp_path / name)
        assert done.code == 0, done.err
        found = re.findall(r"not written, as \w+ does not hold it: (.*)", done.err)
        assert found == ([] if what is None else [what]), name
