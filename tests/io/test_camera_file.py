"""Camera files: written, read, completed by each other, and refused."""

import json
import math

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io.camera_file import CameraFacts, facts_of, read_camera, write_camera
from epinet.io.parameters import write_parameters
from epinet.lightfield import LightField

FULL = CameraFacts(
    focal_length_mm=50, sensor_size_mm=36, baseline_mm=5, focus_distance_mm=800, width_px=160
)
SIZE = (120, 160)


@pytest.mark.parametrize("suffix", [".json", ".yaml", ".yml"])
@pytest.mark.parametrize("focus_mm", [800.0, -800.0, math.inf])
def test_files_come_back(tmp_path, suffix, focus_mm):
    facts = FULL.model_copy(update={"focus_distance_mm": focus_mm})
    write_camera(tmp_path / f"camera{suffix}", facts)
    assert read_camera(tmp_path / f"camera{suffix}") == facts


def test_parameters_cfg_is_a_camera_file(tmp_path):
    camera = Camera(50, 36, 5, 800, 160, 120)
    lf = LightField(np.zeros((3, 3, 120, 160, 3), np.uint8), camera=camera)
    write_parameters(tmp_path / "parameters.cfg", lf)
    assert read_camera(tmp_path / "parameters.cfg").camera(SIZE) == camera


def test_every_way_to_say_it_is_the_same_camera():
    camera = FULL.camera(SIZE)
    fov = math.degrees(2 * math.atan(18 / 50))
    by_view = CameraFacts(fov_deg=fov, baseline_mm=5, focus_distance_mm=800).camera(SIZE)
    by_product = CameraFacts(
        fov_deg=fov, baseline_focal_mm_px=5 * 50 / 36 * 160, focus_distance_mm=800
    ).camera(SIZE)
    for other in (by_view, by_product, facts_of(camera).camera(SIZE)):
        assert other.focal_px == pytest.approx(camera.focal_px)
        assert other.baseline_mm == pytest.approx(5)


def test_the_later_word_wins_and_replaces_other_ways_to_say_it():
    changed = FULL.completed_by(CameraFacts(baseline_focal_mm_px=900, fov_deg=60))
    assert changed.known() == {
        "fov_deg": 60,
        "baseline_focal_mm_px": 900,
        "focus_distance_mm": 800,
        "width_px": 160,
    }
    assert changed.completed_by(FULL) == FULL


def test_all_that_is_missing_is_said_at_once():
    with pytest.raises(InputError, match=r"--focus-mm.*--baseline-mm.*--fov"):
        CameraFacts().camera(SIZE)
    with pytest.raises(InputError, match="--fov") as refused:
        CameraFacts(baseline_mm=3, focus_distance_mm=5).camera(SIZE, metric_depth_only=True)
    assert "--focus-mm" not in str(refused.value)


def test_a_camera_of_other_views_is_refused():
    with pytest.raises(InputError, match="160x120 px, the disparity map has 80x60 px"):
        FULL.model_copy(update={"height_px": 120}).camera((60, 80))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"baseline_mm": 0}, "baseline_mm: Input should be greater than 0, not 0"),
        ({"baseline_mm": "wide", "fov_deg": 180}, "fov_deg.*\n.*baseline_mm"),
        ({"baselin_mm": 3}, "baselin_mm is not known; there are focal_length_mm"),
        ({"fov_deg": 40, "sensor_size_mm": 36}, "either the field of view or"),
        ({"baseline_mm": 4, "baseline_focal_mm_px": 36}, "either baseline_mm or"),
        ({"focus_distance_mm": 0}, "focus distance must be a number other than 0"),
        ([1, 2], "holds names and values"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path, values, says):
    (tmp_path / "camera.json").write_text(json.dumps(values))
    with pytest.raises(InputError, match=says) as refused:
        read_camera(tmp_path / "camera.json")
    assert all("camera.json" in problem for problem in refused.value.problems)


def test_damaged_and_foreign_files_are_refused(tmp_path):
    (tmp_path / "camera.json").write_text("{")
    (tmp_path / "camera.txt").write_text("")
    (tmp_path / "parameters.cfg").write_text("[meta]\n")
    with pytest.raises(InputError, match=r"camera\.json: cannot be read"):
        read_camera(tmp_path / "camera.json")
    with pytest.raises(InputError, match=r"ends in \.json, \.yaml"):
        read_camera(tmp_path / "camera.txt")
    with pytest.raises(InputError, match="says nothing about the camera"):
        read_camera(tmp_path / "parameters.cfg")
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read \(No such file"):
        read_camera(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"to write ends in \.json"):
        write_camera(tmp_path / "camera.cfg", FULL)
