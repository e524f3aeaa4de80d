"""The benchmark's zip: what is written can be submitted, and every fault is named."""

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epinet.benchmark.maps import find_maps
from epinet.benchmark.methods import maps_to_submit
from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.benchmark.submission import check_submission, write_submission
from epinet.errors import InputError
from epinet.io import read_pfm, write_pfm
from epinet.io.images import write_png
from epinet.progress import progress

SIZE = (512, 512)


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> Path:
    """Twelve maps, each its own, and run times."""
    folder = tmp_path_factory.mktemp("maps")
    (folder / "runtimes").mkdir()
    for k, name in enumerate(BENCHMARK_SCENES):
        write_pfm(folder / f"{name}.pfm", np.full(SIZE, k / 8) + np.arange(512))
        (folder / "runtimes" / f"{name}.txt").write_text(f"{k + 0.5}\n")
    return folder


@pytest.fixture(scope="module")
def good(maps, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("zip") / "good.zip"
    write_submission(path, maps_to_submit(str(maps), None, path.parent, path, progress=progress))
    return path


def edited(good: Path, path: Path, prefix: str = "", **changes: bytes | None) -> Path:
    """A copy with entries changed, added or (None) left out."""
    with zipfile.ZipFile(good) as old, zipfile.ZipFile(path, "w") as new:
        contents = {name: old.read(name) for name in old.namelist()} | changes
        for name, data in contents.items():
            if data is not None:
                new.writestr(prefix + name, data)
    return path


def problems(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        check_submission(path)
    return caught.value.problems


def test_what_is_written_can_be_submitted(good, maps, tmp_path):
    check_submission(good)
    with zipfile.ZipFile(good) as archive:
        assert sorted(archive.namelist()) == sorted(
            f"{folder}/{name}.{suffix}"
            for folder, suffix in (("disp_maps", "pfm"), ("runtimes", "txt"))
            for name in BENCHMARK_SCENES
        )
        archive.extractall(tmp_path)
    for k, name in enumerate(BENCHMARK_SCENES):
        file = tmp_path / "disp_maps" / f"{name}.pfm"
        np.testing.assert_array_equal(read_pfm(file), read_pfm(maps / f"{name}.pfm"))
        assert file.read_bytes().startswith(b"Pf\n512 512\n-1.0\n")
        assert float((tmp_path / "runtimes" / f"{name}.txt").read_text().split("\n")[0]) == k + 0.5


def test_the_same_maps_make_the_same_zip(good, maps, tmp_path):
    again = tmp_path / "again.zip"
    write_submission(
        again, maps_to_submit(str(maps), None, tmp_path, tmp_path / "new.zip", progress=progress)
    )
    assert again.read_bytes() == good.read_bytes()


def pfm(values: np.ndarray, header: bytes = b"Pf\n512 512\n-1\n") -> bytes:
    return header + values.astype("<f4").tobytes()


ZEROS = np.zeros(SIZE)
HOLED = np.where(np.arange(512) == 7, np.nan, ZEROS)
FAULTS = {
    "missing map": ({"disp_maps/herbs.pfm": None}, "disp_maps/herbs.pfm: missing"),
    "missing run time": ({"runtimes/herbs.txt": None}, "runtimes/herbs.txt: missing"),
    "backslashes": (
        {"disp_maps/herbs.pfm": None, "disp_maps\\herbs.pfm": pfm(ZEROS)},
        r"1 names hold a backslash, such as disp_maps\herbs.pfm",
    ),
    "hidden": ({"__MACOSX/disp_maps/._herbs.pfm": b"x"}, "1 hidden files of macOS"),
    "extra file": ({"disp_maps/notes.txt": b"x"}, "notes.txt: does not belong"),
    "wrong case": ({"disp_maps/Herbs.pfm": b"x"}, "Herbs.pfm: does not belong"),
    "not a PFM": ({"disp_maps/dots.pfm": b"P6"}, "dots.pfm: not a PFM"),
    "cut short": ({"disp_maps/dots.pfm": pfm(ZEROS)[:-4]}, "dots.pfm: the header says 512x512"),
    "smaller": (
        {"disp_maps/dots.pfm": pfm(np.zeros((490, 490)), b"Pf\n490 490\n-1\n")},
        "dots.pfm: the map is 490x490 px, it must be 512x512 px",
    ),
    "colour": (
        {"disp_maps/dots.pfm": pfm(np.zeros((512, 512, 3)), b"PF\n512 512\n-1\n")},
        "dots.pfm: in colour",
    ),
    "big-endian": (
        {"disp_maps/dots.pfm": b"Pf\n512 512\n1\n" + ZEROS.astype(">f4").tobytes()},
        "dots.pfm: big-endian",
    ),
    "scaled": ({"disp_maps/dots.pfm": pfm(ZEROS, b"Pf\n512 512\n-2\n")}, "multiply by 2"),
    "header in one line": ({"disp_maps/dots.pfm": pfm(ZEROS, b"Pf 512 512 -1\n")}, "three lines"),
    "holes": ({"disp_maps/dots.pfm": pfm(HOLED)}, "512 of 262144 values are not finite"),
    "run time in words": ({"runtimes/dots.txt": b"fast"}, "not 'fast'"),
    "no run time": ({"runtimes/dots.txt": b""}, "not ''"),
    "negative run time": ({"runtimes/dots.txt": b"-1"}, "not '-1'"),
    "endless run time": ({"runtimes/dots.txt": b"inf"}, "not 'inf'"),
    "run time as Python writes it": ({"runtimes/dots.txt": b"1_0"}, "not '1_0'"),
    "run time in other digits": ({"runtimes/dots.txt": "\uff12.5".encode()}, "not '\uff12.5'"),
    "nested folder": (
        {"mine/disp_maps/": b""},
        "mine/disp_maps/: a folder that does not belong",
    ),
    "empty folder": ({"disp_maps/more/": b""}, "disp_maps/more/: a folder that does not belong"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named(good, tmp_path, name):
    changes, says = FAULTS[name]
    (problem,) = problems(edited(good, tmp_path / "bad.zip", **changes))
    assert "bad.zip" in problem and says in problem


def test_an_outer_folder_is_one_fault_and_hides_no_other(good, tmp_path):
    path = edited(good, tmp_path / "bad.zip", prefix="mine/", **{"runtimes/dots.txt": b"fast"})
    outer, other = problems(path)
    assert "in the folder mine" in outer and "root of the zip" in outer
    assert "mine/runtimes/dots.txt" in other


def test_names_must_be_those_of_the_site_to_the_letter(good, tmp_path):
    (problem,) = problems(edited(good, tmp_path / "bad.zip", prefix="./"))
    assert "in the folder .;" in problem


def test_all_faults_are_told_at_once(good, tmp_path):
    changes = {}
    for name in ("missing map", "extra file", "holes", "no run time"):
        changes |= FAULTS[name][0]
    assert len(problems(edited(good, tmp_path / "bad.zip", **changes))) == 4


def test_damaged_zips_are_told(good, tmp_path):
    path = tmp_path / "bad.zip"
    path.write_bytes(b"not a zip")
    assert "cannot be read as a zip" in problems(path)[0]
    data = bytearray(good.read_bytes())
    data[200:300] = bytes(100)
    path.write_bytes(data)
    assert "damaged" in problems(path)[0]
    assert "cannot be read" in problems(tmp_path / "none.zip")[0]


def test_what_cannot_be_submitted_is_told_before_anything_is_written(maps, tmp_path):
    folder = tmp_path / "maps"
    for name in BENCHMARK_SCENES[1:]:
        write_pfm(folder / f"{name}.pfm", HOLED if name == "dots" else ZEROS)
    with pytest.raises(InputError) as caught:
        maps_to_submit(str(folder), None, tmp_path, tmp_path / "new.zip", progress=progress)
    text = str(caught.value)
    assert "no map of scene backgammon" in text
    assert "dots.pfm: 512 of 262144 values are not finite" in text
    assert text.count("no run time is stated") == 11


def test_a_model_needs_all_scenes(tmp_path):
    with pytest.raises(InputError, match="a model needs the scenes"):
        maps_to_submit("sweepnet", None, tmp_path, tmp_path / "new.zip", progress=progress)
    (tmp_path / "data" / "boxes").mkdir(parents=True)
    write_pfm(tmp_path / "data" / "boxes" / "gt_disp_lowres.pfm", ZEROS)
    with pytest.raises(InputError) as caught:
        maps_to_submit(
            "sweepnet", tmp_path / "data", tmp_path, tmp_path / "new.zip", progress=progress
        )
    assert sum("is missing" in problem for problem in caught.value.problems) == 11
    assert "boxes: no views in it" in str(caught.value)


def test_scenes_that_cannot_be_submitted_are_named_before_the_model_runs(tmp_path):
    small = np.zeros((16, 24, 3), np.uint8)
    for name in (*BENCHMARK_SCENES, "more/cotton"):
        write_png(tmp_path / "data" / name / "input_Cam000.png", small)
    with pytest.raises(InputError) as caught:
        maps_to_submit(
            "sweepnet", tmp_path / "data", tmp_path, tmp_path / "new.zip", progress=progress
        )
    text = str(caught.value)
    assert text.count("views of 24x16 px; the benchmark's scenes have 512x512 px") == 11
    assert "cotton: scenes of one name" in text


def test_a_bad_run_time_hides_no_fault_of_the_map(tmp_path):
    write_pfm(tmp_path / "dots.pfm", HOLED)
    write_pfm(tmp_path / "boxes.pfm", np.zeros((20, 30, 3)))
    (tmp_path / "runtimes").mkdir()
    (tmp_path / "runtimes" / "dots.txt").write_text("fast")
    with pytest.raises(InputError) as caught:
        find_maps(tmp_path, dict.fromkeys(("dots", "boxes"), SIZE), complete=True)
    text = str(caught.value)
    for fault in ("not finite", "not 'fast'", "in colour", "the map is 30x20 px", "no run time"):
        assert fault in text


def test_a_short_run_time_is_kept(maps, tmp_path):
    found = maps_to_submit(str(maps), None, tmp_path, tmp_path / "new.zip", progress=progress)
    quick = {name: replace(file, seconds=1e-11) for name, file in found.items()}
    write_submission(tmp_path / "quick.zip", quick)
    with zipfile.ZipFile(tmp_path / "quick.zip") as archive:
        assert float(archive.read("runtimes/dots.txt")) == 1e-11
