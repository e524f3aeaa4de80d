"""Data sets on disk: whole, continued as begun, and never at the cost of anything else."""

import errno
import json
import shutil
from collections import namedtuple
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io import read_light_field, read_pfm
from epinet.lightfield import LightField
from epinet.synth import dataset
from epinet.synth.dataset import parse_range, parse_size, write_dataset
from epinet.synth.options import Faults, Options
from epinet.synth.overview import write_overview

SMALL = Options(size=(24, 32), views=5)


@pytest.fixture(autouse=True)
def drawn(monkeypatch) -> list[int]:
    """Scenes of noise in place of rendered ones: what is tested is what happens to them.

    Holds the indexes that were asked for.
    """
    asked: list[int] = []

    def draw(options, seed, index, device, *, star_only, textures, truths=False):
        asked.append(index)
        if textures is not None:
            raise InputError(f"{textures}: no photograph")
        rng = np.random.default_rng([seed, index])
        shape = (options.views, options.views, *options.size, 3)
        height, width = options.size
        truth = rng.normal(size=options.size).astype(np.float32)
        return LightField(
            rng.integers(1, 256, shape, np.uint8),
            camera=Camera(100, 35, 11, 500, width, height),
            truth=truth,
            masks={"planes": truth > 0, "valid": truth > 1, "invalid": truth <= 1},
        )

    monkeypatch.setattr(dataset, "render_scene", draw)
    return asked


def content(folder: Path) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


def test_what_is_written_is_read_back(tmp_path):
    first, second = write_dataset(tmp_path / "set", SMALL, seed=3, scenes=2)
    assert (first, second) == (tmp_path / "set/scene_00000", tmp_path / "set/scene_00001")
    lf = read_light_field(second)
    want = dataset.render_scene(SMALL, 3, 1, "cpu", star_only=False, textures=None)
    np.testing.assert_array_equal(lf.views, want.views)
    np.testing.assert_array_equal(lf.truth, want.truth)
    assert lf.camera == want.camera
    assert lf.masks.keys() == want.masks.keys()
    assert all((lf.masks[name] == want.masks[name]).all() for name in want.masks)
    depth = read_pfm(second / "gt_depth_lowres.pfm")
    np.testing.assert_array_equal(depth, want.camera.depth_mm(want.truth))
    record = json.loads((tmp_path / "set/dataset.json").read_text())
    assert record["seed"] == 3
    assert record["scenes"] == ["scene_00000", "scene_00001"]
    assert record["options"]["size"] == [24, 32]
    assert {p.name for p in (tmp_path / "set").iterdir()} == {
        "dataset.json",
        "scene_00000",
        "scene_00001",
    }


def test_resume_makes_just_what_is_missing_and_the_same(tmp_path, drawn):
    out = tmp_path / "set"
    write_dataset(out, SMALL, seed=1, scenes=3)
    before = content(out)
    shutil.rmtree(out / "scene_00001")
    (out / ".scene_00001.0123abcd").mkdir()  # left by a process that was killed
    drawn.clear()
    write_dataset(out, SMALL, seed=1, scenes=3, existing="resume")
    assert drawn == [1]
    assert content(out) == before
    assert not (out / ".scene_00001.0123abcd").exists()


def test_resume_adds_scenes(tmp_path, drawn):
    write_dataset(tmp_path / "a", SMALL, seed=1, scenes=1)
    drawn.clear()
    write_dataset(tmp_path / "a", SMALL, seed=1, scenes=3, existing="resume")
    assert drawn == [1, 2]
    write_dataset(tmp_path / "b", SMALL, seed=1, scenes=3)
    assert content(tmp_path / "a") == content(tmp_path / "b")


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"seed": 2}, "seed is 1 there, 2 here"),
        ({"scenes": 1}, "2 scenes are there or begun, 1 are asked for"),
        ({"star_only": True}, "star_only is False there, True here"),
        ({"options": replace(SMALL, samples=8)}, "options.samples is 4 there, 8 here"),
        (
            {"options": replace(SMALL, faults=Faults(noise=2))},
            "options.faults.noise is 1.0 there, 2 here",
        ),
    ],
)
def test_resume_refuses_other_options_and_names_them(tmp_path, changed, says):
    asked = {"options": SMALL, "seed": 1, "scenes": 2}
    write_dataset(tmp_path / "set", **asked)
    before = content(tmp_path)
    with pytest.raises(InputError, match=says):
        write_dataset(tmp_path / "set", **asked | changed, existing="resume")
    assert content(tmp_path) == before


def test_resume_refuses_another_generator(tmp_path, monkeypatch):
    write_dataset(tmp_path / "set", SMALL, seed=1, scenes=1)
    monkeypatch.setattr(dataset, "VERSION", "other")
    with pytest.raises(InputError, match=r"generator is .* there, other here"):
        write_dataset(tmp_path / "set", SMALL, seed=1, scenes=1, existing="resume")


def test_what_exists_is_kept_unless_told(tmp_path):
    out = tmp_path / "set"
    write_dataset(out, SMALL, seed=1, scenes=2)
    before = content(out)
    with pytest.raises(InputError, match=r"not empty; --resume .* --force"):
        write_dataset(out, SMALL, seed=2, scenes=1)
    with pytest.raises(InputError, match="no photograph"):  # found out before anything is removed
        write_dataset(out, SMALL, seed=2, scenes=1, textures=tmp_path / "none", existing="replace")
    assert content(out) == before
    write_overview(out)
    write_dataset(out, SMALL, seed=2, scenes=1, existing="replace")
    write_dataset(tmp_path / "new", SMALL, seed=2, scenes=1)
    assert content(out) == content(tmp_path / "new")


@pytest.mark.parametrize("foreign", ["thesis.txt", "scene_00000/notes.txt", "scene_00002/a.png"])
def test_nothing_foreign_is_removed(tmp_path, foreign):
    out = tmp_path / "set"
    write_dataset(out, SMALL, seed=1, scenes=2)
    (out / foreign).parent.mkdir(exist_ok=True)
    (out / foreign).write_text("years of work")
    before = content(out)
    with pytest.raises(InputError, match=foreign.split("/")[0]):
        write_dataset(out, SMALL, seed=1, scenes=2, existing="replace")
    assert content(out) == before


def test_a_data_set_from_before_an_option_is_continued_where_it_is_off(tmp_path):
    write_dataset(tmp_path, SMALL, seed=1, scenes=1)
    record = json.loads((tmp_path / "dataset.json").read_text())
    assert {"gloss", "near_lamps"}.isdisjoint(record["options"])
    assert len(write_dataset(tmp_path, SMALL, seed=1, scenes=2, existing="resume")) == 2
    with pytest.raises(InputError, match="near_lamps"):
        write_dataset(tmp_path, replace(SMALL, near_lamps=0.5), seed=1, scenes=3, existing="resume")


@pytest.mark.parametrize("existing", ["refuse", "resume", "replace"])
def test_a_folder_of_other_things_is_refused(tmp_path, existing):
    (tmp_path / "scene_00000").mkdir()
    (tmp_path / "dataset.json").write_text('{"scenes": ["scene_00000"]}')
    before = content(tmp_path)
    with pytest.raises(InputError, match=r"not empty|no data set of epinet"):
        write_dataset(tmp_path, SMALL, seed=1, scenes=1, existing=existing)
    assert content(tmp_path) == before


def test_an_empty_folder_is_taken(tmp_path):
    write_dataset(tmp_path, SMALL, seed=1, scenes=1, existing="replace")
    assert (tmp_path / "scene_00000").is_dir()


def test_too_little_space_is_found_before_the_work(tmp_path, monkeypatch, drawn):
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(400_000))
    with pytest.raises(InputError, match="about 1 MB are needed, 0 MB are free"):
        write_dataset(tmp_path / "set", SMALL, seed=1, scenes=10)
    assert drawn == []
    assert not (tmp_path / "set").exists()
    write_dataset(tmp_path / "set", SMALL, seed=1, scenes=10, star_only=True)


def test_a_full_disk_midway_keeps_what_is_finished(tmp_path, monkeypatch):
    out, write_bytes = tmp_path / "set", Path.write_bytes

    def full(path, data):
        if "scene_00002" in str(path) and "Cam007" in path.name:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write_bytes(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError) as caught:
        write_dataset(out, SMALL, seed=1, scenes=4)
    file = out / "scene_00002" / "input_Cam007.png"
    assert caught.value.problems == [
        f"{file}: cannot be written (No space left on device); "
        "check the name, the permissions and the free space of its folder",
        f"{out}: 2 of 4 scenes are finished; --resume makes the others",
    ]
    assert {p.name for p in out.iterdir()} == {"dataset.json", "scene_00000", "scene_00001"}


def test_views_that_could_not_be_read_again_are_refused(tmp_path):
    with pytest.raises(InputError, match="20x16 px are too small"):
        write_dataset(tmp_path / "set", replace(SMALL, size=(16, 20)), seed=1, scenes=1)


def test_the_overview(tmp_path):
    write_dataset(tmp_path, SMALL, seed=1, scenes=9)
    statistics = write_overview(tmp_path)
    assert statistics.scenes == 9
    assert json.loads((tmp_path / "statistics.json").read_text()) == statistics.report()
    names = {p.name for p in tmp_path.iterdir() if p.is_file()}
    assert names == {
        "dataset.json",
        "sheet.png",
        "sheet_2.png",
        "statistics.json",
        "statistics.png",
    }


def test_words_of_the_command_line():
    assert parse_range("wide") == (-25, 5)
    assert parse_range("-1.5,2") == (-1.5, 2)
    assert parse_size("640x480") == (480, 640)
    for text in ("broad", "1", "1,2,3", "nan,1", "-inf,0", ""):
        with pytest.raises(InputError, match="narrow, hci, wide"):
            parse_range(text)
    for text in ("512", "512x", "-5x5", "512*512", "1e3x5"):
        with pytest.raises(InputError, match="512x512"):
            parse_size(text)
