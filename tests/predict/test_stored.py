"""A result read back is the result that was written, and its views are found again."""

import json
import math
import shutil

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.inspect.alignment import estimate_alignment
from epinet.io import write_light_field, write_pfm
from epinet.io.images import write_png
from epinet.io.read import read_light_field
from epinet.lightfield import LightField
from epinet.predict.result import Result
from epinet.predict.stored import read_result
from epinet.refine import compensated

CAMERA = Camera(100.0, 35.0, 11.0, 500.0, 30, 24)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A result, its folder, and the views it came from."""
    folder = tmp_path_factory.mktemp("stored")
    views = np.random.default_rng(0).integers(0, 256, (9, 9, 24, 30, 3)).astype(np.uint8)
    write_light_field(folder / "views", LightField(views, camera=CAMERA), "hci")
    lf = read_light_field(folder / "views").reordered(flip_rows=True).central(3, step=2)
    result = Result(
        np.random.default_rng(1).normal(0, 1, (24, 30)).astype(np.float32),
        np.linspace(0, 1, 24 * 30, dtype=np.float32).reshape(24, 30),
        lf,
        settings={"step": 2},
    )
    result.save(folder / "result")
    return result, folder


@pytest.fixture
def folder(saved, tmp_path):
    """The same on a place of its own, to be damaged."""
    shutil.copytree(saved[1] / "result", tmp_path / "result")
    return tmp_path / "result"


def test_what_was_saved_is_read(saved):
    result, folder = saved
    stored = read_result(folder / "result")
    np.testing.assert_array_equal(stored.disparity, result.disparity)
    np.testing.assert_array_equal(stored.centre_view, result.centre_view)
    np.testing.assert_allclose(stored.confidence, result.confidence, atol=1e-5)
    assert stored.camera_facts.camera(stored.size) == Camera(100, 35, 22, 500, 30, 24)


def test_the_views_are_those_that_were_used(saved, tmp_path):
    result, folder = saved
    stored = read_result(folder / "result")
    np.testing.assert_array_equal(stored.read_views().views, result.lightfield.views)
    shutil.copytree(folder / "views", tmp_path / "elsewhere")
    moved = stored.read_views(tmp_path / "elsewhere")
    np.testing.assert_array_equal(moved.views, result.lightfield.views)


def test_views_that_are_gone_or_others_are_refused(saved, folder, tmp_path):
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(run | {"input": str(tmp_path / "gone")}))
    with pytest.raises(InputError, match=r"at .*gone and are not there.*--views"):
        read_result(folder).read_views()
    others = 255 - saved[0].lightfield.views
    np.save(tmp_path / "others.npy", np.repeat(np.repeat(others, 3, 0), 3, 1))
    with pytest.raises(InputError, match="not those that"):
        read_result(folder).read_views(tmp_path / "others.npy")


def test_all_that_is_wrong_is_said(folder):
    (folder / "disparity.pfm").write_bytes(b"Pf\n30 24\n-1\n")
    (folder / "centre.png").unlink()
    with pytest.raises(InputError) as refused:
        read_result(folder)
    assert {p.split(": ")[0] for p in refused.value.problems} == {
        str(folder / "disparity.pfm"),
        str(folder / "centre.png"),
    }


def test_maps_of_another_size_are_refused(folder):
    write_pfm(folder / "disparity.pfm", np.zeros((12, 15), np.float32))
    with pytest.raises(InputError, match=r"centre\.png: 30x24 px, but disparity\.pfm has 15x12"):
        read_result(folder)


def test_maps_without_any_disparity_are_refused(folder):
    write_pfm(folder / "disparity.pfm", np.full((24, 30), np.nan, np.float32))
    with pytest.raises(InputError, match="no pixel has a disparity"):
        read_result(folder)
    write_pfm(folder / "disparity.pfm", np.zeros((24, 30, 3), np.float32))
    with pytest.raises(InputError, match="one channel"):
        read_result(folder)


def test_other_folders_are_no_results(folder, tmp_path):
    with pytest.raises(InputError, match=r"not a result folder.*no run\.json"):
        read_result(tmp_path)
    (folder / "run.json").write_text("[]")
    with pytest.raises(InputError, match="not the record of this version"):
        read_result(folder)


def test_a_camera_that_cannot_be_is_refused(folder):
    run = json.loads((folder / "run.json").read_text())
    run["camera"]["baseline_mm"] = -1
    (folder / "run.json").write_text(json.dumps(run))
    with pytest.raises(InputError, match="baseline_mm"):
        read_result(folder).camera_facts  # noqa: B018
    write_png(folder / "centre.png", np.zeros((24, 30), np.uint8))
    assert read_result(folder).centre_view.shape == (24, 30, 3)


def test_the_views_of_a_refined_result_are_compensated(tmp_path):
    """What lies on the map's pixels is what the map was made from."""
    rng = np.random.default_rng(2)
    texture = gaussian_filter(rng.normal(size=(60, 70, 1)), (1.5, 1.5, 0))
    texture = 0.5 + 0.12 * texture / texture.std()
    views = np.broadcast_to(texture, (5, 5, 60, 70, 1)).copy()
    views[0, 0] *= 0.8
    path = tmp_path / "shot.npy"
    np.save(path, np.round(255 * views.clip(0, 1)).astype(np.uint8))
    lf = read_light_field(path)
    lit = compensated(lf, estimate_alignment(lf))
    assert (
        abs(lit.unit(0, 0) - lit.unit(2, 2)).mean()
        < 0.2 * abs(lf.unit(0, 0) - lf.unit(2, 2)).mean()
    )
    flat = np.zeros((60, 70), np.float32)
    for refine, expected in ((True, lit), (False, lf)):
        Result(flat, flat + 1, lf, settings={"refine": refine}).save(tmp_path / "result")
        found = read_result(tmp_path / "result").read_views()
        np.testing.assert_array_equal(found.views, expected.views)


def test_parallel_cameras_are_kept_in_json_that_others_read(estimator, tmp_path):
    camera = Camera(50.0, 36.0, 5.0, math.inf, 40, 34)
    views = np.random.default_rng(0).integers(0, 256, (5, 5, 34, 40, 3)).astype(np.uint8)
    folder = estimator.predict(LightField(views, camera=camera)).save(tmp_path / "out")
    text = (folder / "run.json").read_text()
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert read_result(folder).camera_facts.focus_distance_mm == math.inf
