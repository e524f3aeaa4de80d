"""Depth maps read back by other programs' readers."""

import json

import cv2
import numpy as np
import pytest
from PIL import Image

from epinet.errors import InputError
from epinet.geometry.depth_files import PNG_FAR, fitting_step_mm, write_depth
from epinet.io import read_pfm
from epinet.io.camera_file import CameraFacts, camera_facts

INF, NAN = np.inf, np.nan
DEPTH = np.array([[812.3, 1500.0, INF], [NAN, 2999.9, 1e9]], np.float32)
CAMERA = CameraFacts(focus_distance_mm=900.0)


@pytest.mark.parametrize("name", ["depth.pfm", "depth.tiff", "depth.tif"])
def test_floats_are_mm_as_they_are(tmp_path, name):
    assert "mm" in write_depth(tmp_path / name, DEPTH, CAMERA)
    if name.endswith("pfm"):
        found = read_pfm(tmp_path / name)
    else:
        found = cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found, DEPTH)


def test_npz_holds_validity_and_camera(tmp_path):
    write_depth(tmp_path / "depth.npz", DEPTH, CAMERA)
    found = np.load(tmp_path / "depth.npz")
    np.testing.assert_array_equal(found["depth_mm"], DEPTH)
    np.testing.assert_array_equal(found["valid"], np.isfinite(DEPTH))
    assert camera_facts(json.loads(str(found["camera"])), "npz") == CAMERA


@pytest.mark.parametrize("step", [None, 0.1, 1.0])
def test_png_times_its_stated_step_is_mm(tmp_path, step):
    wall = np.full((40, 50), 2000, np.float32)
    wall[:2, :3] = DEPTH
    meaning = write_depth(tmp_path / "depth.png", wall, CAMERA, step)
    values = cv2.imread(str(tmp_path / "depth.png"), cv2.IMREAD_UNCHANGED)
    assert values.dtype == np.uint16
    stated = float(Image.open(tmp_path / "depth.png").text["depth_step_mm"])
    assert stated == (step or 0.05) and f"value * {stated:g} = mm" in meaning
    near = np.isfinite(wall) & (wall < 1e6)
    assert np.abs(values * stated - wall)[near].max() <= stated / 2 + 1e-3
    assert values[1, 0] == 0
    assert values[0, 2] == values[1, 2] == PNG_FAR


@pytest.mark.parametrize("largest", [0.7, 65.0, 66.0, 999.0, 2999.0, 1e5])
def test_the_step_is_as_fine_as_fits(largest):
    step = fitting_step_mm(np.full((5, 5), largest, np.float32))
    finer = step / (2.5 if str(step).strip("0.").startswith("5") else 2)
    assert largest / step <= PNG_FAR - 1 < largest / finer


def test_no_depth_at_all_can_be_written(tmp_path):
    write_depth(tmp_path / "depth.png", np.full((3, 3), INF, np.float32), CAMERA)
    assert (cv2.imread(str(tmp_path / "depth.png"), cv2.IMREAD_UNCHANGED) == PNG_FAR).all()


def test_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.pfm, \.png"):
        write_depth(tmp_path / "depth.exr", DEPTH, CAMERA)
    with pytest.raises(InputError, match="more than 0 mm"):
        write_depth(tmp_path / "depth.png", DEPTH, CAMERA, 0.0)
    with pytest.raises(InputError, match="a step is for 16-bit PNG"):
        write_depth(tmp_path / "depth.pfm", DEPTH, CAMERA, 1.0)
    assert not list(tmp_path.iterdir())


def test_an_ending_in_capitals_is_kept(tmp_path):
    write_depth(tmp_path / "depth.NPZ", DEPTH, CAMERA)
    assert [p.name for p in tmp_path.iterdir()] == ["depth.NPZ"]
    np.testing.assert_array_equal(np.load(tmp_path / "depth.NPZ")["depth_mm"], DEPTH)


def test_parallel_cameras_are_written_as_json_that_others_read(tmp_path):
    parallel = CameraFacts(focus_distance_mm=INF, baseline_mm=3.0)
    write_depth(tmp_path / "depth.npz", DEPTH, parallel)
    text = str(np.load(tmp_path / "depth.npz")["camera"])
    strict = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert camera_facts(strict, "npz") == parallel
