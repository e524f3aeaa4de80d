"""Which white image is taken, and from what sort of calibration data."""

from __future__ import annotations

import json
import shutil
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plenoptic_forward import F01, ILLUM, Body, Container, Optics, frame_metadata, pack, write_white

from epinet.errors import InputError
from epinet.raw.bayer import mosaic, planes
from epinet.raw.metadata import Frame, parse_frame
from epinet.raw.white import choose_white, find_whites, levels, normalised_white

OPTICS = Optics(size=(32, 48))


def frame(body: Body = F01, serial: str | None = F01.serial) -> Frame:
    private = {} if serial is None else {"camera": {"serialNumber": serial}}
    return parse_frame(frame_metadata(OPTICS, body), private, "IMG_0001.lfp")


def raw(level: int) -> np.ndarray:
    return np.full(OPTICS.size, level, np.uint16)


def make(folder: Path, name: str, level: int = 1000, **settings: object) -> Path:
    return write_white(folder, OPTICS, replace(F01, **settings), raw(level), name)


def chosen(source: Path, **settings: object) -> str:
    capture = replace(frame(), **settings)
    return choose_white(find_whites(source), capture, source).frame.where.split("/")[-1]


def test_zoom_comes_before_focus(tmp_path: Path) -> None:
    make(tmp_path / "white", "MOD_0000", zoom_step=100, focus_step=500)
    make(tmp_path / "white" / "deeper", "MOD_0001", zoom_step=200, focus_step=400)
    make(tmp_path / "white", "MOD_0002", zoom_step=200, focus_step=900)
    source = tmp_path / "white"
    assert "MOD_0000" in chosen(source, zoom_step=140, focus_step=900)
    assert "MOD_0001" in chosen(source, zoom_step=160, focus_step=500)
    assert "MOD_0002" in chosen(source, zoom_step=160, focus_step=700)


def test_of_equal_settings_the_longest_exposure(tmp_path: Path) -> None:
    for name, seconds in (("MOD_0000", 0.01), ("MOD_0001", 0.05), ("MOD_0002", 0.02)):
        path = make(tmp_path, name).with_suffix(".TXT")
        text = path.read_text().replace("0.0166", str(seconds))
        path.write_text(text + "\0\0")  # the cameras end some so
    assert "MOD_0001" in chosen(tmp_path)


def test_other_cameras_are_passed_over(tmp_path: Path) -> None:
    make(tmp_path, "MOD_0000", serial="A000000001")
    make(tmp_path, "MOD_0001", zoom_step=1)
    assert "MOD_0001" in chosen(tmp_path)
    with pytest.raises(InputError, match=r"another camera \(serial number A000000001, A303134643"):
        chosen(tmp_path, serial="A999999999")
    assert "MOD_0000" in chosen(tmp_path, serial=None)


def test_white_images_that_do_not_tell_their_camera_may_be_its(tmp_path: Path) -> None:
    def forget(path: Path) -> None:
        text = json.loads(path.with_suffix(".TXT").read_text())
        text["master"]["picture"]["frameArray"][0]["frame"].pop("privateMetadata")
        path.with_suffix(".TXT").write_text(json.dumps(text))

    forget(make(tmp_path, "MOD_0000"))
    make(tmp_path, "MOD_0001", serial="A000000001")
    assert "MOD_0000" in chosen(tmp_path)
    make(tmp_path, "MOD_0002", zoom_step=1)
    assert "MOD_0002" in chosen(tmp_path)  # this camera's own


def test_hidden_files_are_passed_over_in_folders_and_archives(tmp_path: Path) -> None:
    folder = tmp_path / "unitdata"
    make(folder, "MOD_0000")
    for name in ("._MOD_0000.RAW", "._MOD_0000.TXT", "._caldata.tar"):
        (folder / name).write_bytes(b"\0\5\x16\7 of macOS")
    assert "MOD_0000" in chosen(folder)
    with tarfile.open(tmp_path / "caldata-1.tar", "w") as archive:
        archive.add(folder, "unitdata")
    assert "MOD_0000" in chosen(tmp_path / "caldata-1.tar")


def test_another_size_is_refused(tmp_path: Path) -> None:
    make(tmp_path, "MOD_0000")
    with pytest.raises(InputError, match=r"48x32 px; IMG_0001.lfp has 96x64"):
        chosen(tmp_path, size=(64, 96))


def test_tar_as_the_illum_has(tmp_path: Path) -> None:
    for i in range(2):
        make(tmp_path / "unitdata", f"MOD_000{i}", level=1000 + i, focus_step=100 * i)
    with tarfile.open(tmp_path / "caldata-B5143909630.tar", "w") as archive:
        archive.add(tmp_path / "unitdata", "unitdata")
    source = tmp_path / "caldata-B5143909630.tar"
    shutil.rmtree(tmp_path / "unitdata")
    for given in (source, tmp_path):
        white = choose_white(find_whites(given), replace(frame(), focus_step=99), given)
        np.testing.assert_array_equal(white.read(), raw(1001))


def test_volumes_as_the_f01_has(tmp_path: Path) -> None:
    for volume in range(2):
        white = make(tmp_path / "made", f"MOD_000{volume}", 1000 + volume, focus_step=volume * 9)
        file, files = Container(), []
        for part in (white, white.with_suffix(".TXT")):
            reference = file.add(part.read_bytes())
            files.append({"name": f"C:\\T1CALIB\\{part.name}", "dataRef": reference})
        following = {"nextFile": "data.C.1"} if volume == 0 else {}
        file.write(tmp_path / f"data.C.{volume}", {"files": files, **following}, True)
    source = tmp_path / "data.C.0"
    white_ = choose_white(find_whites(source), replace(frame(), focus_step=8), source)
    np.testing.assert_array_equal(white_.read(), raw(1001))


def test_one_file(tmp_path: Path) -> None:
    make(tmp_path, "MOD_0000")
    path = make(tmp_path, "MOD_0001", focus_step=1)
    assert "MOD_0001" in chosen(path)
    assert "MOD_0001" in chosen(path.with_suffix(".TXT"))


def test_nothing_to_be_found(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or folder"):
        find_whites(tmp_path / "nowhere")
    (tmp_path / "notes.txt").write_text("{}")
    with pytest.raises(InputError, match="no white image in it"):
        find_whites(tmp_path)
    (tmp_path / "broken.tar").write_bytes(b"none" * 200)
    with pytest.raises(InputError, match="not a readable"):
        find_whites(tmp_path / "broken.tar")


def test_a_white_image_that_is_cut_off(tmp_path: Path) -> None:
    path = make(tmp_path, "MOD_0000")
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(InputError, match=r"MOD_0000.RAW: the raw image has .* cut off"):
        find_whites(path)[0].read()


@pytest.mark.parametrize("body", [F01, ILLUM], ids=lambda body: body.model)
def test_levels_use_each_channels_own_black_and_white(body: Body) -> None:
    metadata = frame_metadata(OPTICS, body)
    details = metadata["image"].get("rawDetails", metadata["image"])
    channels = ("r", "gr", "gb", "b")
    details["pixelFormat"]["black"] = {c: 100 * (i + 1) for i, c in enumerate(channels)}
    details["pixelFormat"]["white"] = {c: 100 * (i + 1) + 500 for i, c in enumerate(channels)}
    image = levels(raw(600), parse_frame(metadata, {}, "a"))
    order = {"b": [["b", "gb"], ["gr", "r"]], "gr": [["gr", "r"], ["b", "gb"]]}[body.upper_left]
    for y in (0, 1):
        for x in (0, 1):
            due = (500 - 100 * channels.index(order[y][x])) / 500
            np.testing.assert_allclose(planes(image)[y][x], due, rtol=1e-6)


def test_each_colour_of_a_white_image_is_brightest_at_one() -> None:
    level = np.array([0.6, 0.9, 0.5])[mosaic("b")]
    image = np.tile(level, (16, 24)).astype(np.float32)
    image[8:20] *= 0.25
    found = normalised_white(image, frame())
    np.testing.assert_allclose(found[:8], 1, rtol=1e-5)
    np.testing.assert_allclose(found[8:20], 0.25, rtol=1e-5)
    with pytest.raises(InputError, match="nearly black"):
        normalised_white(image * 0.03, frame())


def test_metadata_beside_white_images_must_be_readable(tmp_path: Path) -> None:
    path = make(tmp_path, "MOD_0000").with_suffix(".TXT")
    path.write_text(json.dumps([1]))
    with pytest.raises(InputError, match=r"MOD_0000.RAW, its metadata: unreadable"):
        find_whites(tmp_path)


def test_packed_pixels_come_back(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 4096, OPTICS.size, np.uint16)
    path = write_white(tmp_path, OPTICS, F01, noise)
    assert path.read_bytes() == pack(noise, 12)
    np.testing.assert_array_equal(find_whites(path)[0].read(), noise)
