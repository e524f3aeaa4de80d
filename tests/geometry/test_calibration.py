"""Calibration against cameras that are known."""

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.geometry.assumed import assumed_camera
from epinet.geometry.calibration import Point, calibrate
from epinet.io.camera_file import CameraFacts

CAMERA = Camera(50, 36, 5, 800, 160, 120)


def scene(camera, depths_mm):
    """A map of vertical strips at depths, and a point in the middle of each."""
    width = 160 // len(depths_mm)
    depth = np.repeat(depths_mm, width)[None].repeat(120, 0)
    points = [Point(width * i + width // 2, 60, z) for i, z in enumerate(depths_mm)]
    return camera.disparity_px(depth), points


@pytest.mark.parametrize(
    ("focus_mm", "depths_mm"),
    [
        (800, [500, 1500]),
        (800, [500, 700, 1500, np.inf]),
        (np.inf, [500, 700, 1500]),
        (-3000, [500, 700, 1500]),
        (120, [900, 700, 1500]),
    ],
)
def test_exact_distances_give_the_camera(focus_mm, depths_mm):
    camera = Camera(50, 36, 5, focus_mm, 160, 120)
    made = calibrate(*scene(camera, np.array(depths_mm, float)))
    assert made.baseline_focal_mm_px == pytest.approx(camera.baseline_focal_mm_px, rel=1e-4)
    assert made.inverse_focus_per_mm == pytest.approx(1 / focus_mm, abs=1e-7)
    np.testing.assert_allclose(made.residuals_px, 0, atol=1e-4)
    np.testing.assert_allclose(1 / made.depths_mm, 1 / np.array(depths_mm), atol=1e-7)


def test_the_depth_it_gives_needs_no_field_of_view():
    depths = np.array([500.0, 1500.0])
    disparity, points = scene(CAMERA, depths)
    facts = calibrate(disparity, points).facts
    found = facts.camera((120, 160), metric_depth_only=True).depth_mm(disparity)
    np.testing.assert_allclose(found, CAMERA.depth_mm(disparity), rtol=1e-4)
    with pytest.raises(InputError, match="the field of view"):
        facts.camera((120, 160))


def test_wrong_pixels_around_a_point_do_not_matter():
    disparity, points = scene(CAMERA, np.array([500.0, 1500.0]))
    for point in points:
        disparity[point.y - 1 : point.y + 1, point.x - 2 : point.x + 2] += 40
    made = calibrate(disparity, points)
    assert made.baseline_focal_mm_px == pytest.approx(CAMERA.baseline_focal_mm_px, rel=1e-4)
    assert all(r.pick.on_edge for r in made.readings)


@pytest.mark.parametrize("error_px", [0.05, 0.2])
def test_the_errors_stated_are_those_made(error_px):
    """Over many calibrations with noise, as large as the spread of what they find."""
    rng = np.random.default_rng(0)
    exact, points = scene(CAMERA, np.array([450, 500, 600, 700, 900, 1200, 2000, 4000.0]))
    made = []
    for _ in range(400):
        disparity = exact.copy()
        for point in points:
            strip = slice(point.x - 5, point.x + 5)
            disparity[:, strip] += np.float32(rng.normal(0, error_px))
        made.append(calibrate(disparity, points))
    scales = [m.baseline_focal_mm_px for m in made]
    focuses = [m.inverse_focus_per_mm for m in made]
    stated_scale = np.sqrt(np.mean([m.baseline_focal_error_mm_px**2 for m in made]))
    stated_focus = np.sqrt(np.mean([m.inverse_focus_error_per_mm**2 for m in made]))
    assert np.std(scales) == pytest.approx(stated_scale, rel=0.15)
    assert np.std(focuses) == pytest.approx(stated_focus, rel=0.15)
    assert np.mean(scales) == pytest.approx(CAMERA.baseline_focal_mm_px, rel=0.02)


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([Point(40, 60, 500)], "at least two points"),
        ([Point(40, 60, 500), Point(120, 60, 500)], "all points are at one depth, 500 mm"),
        ([Point(40, 60, 500), Point(41, 62, 1500)], r"differ by 0\.000 px only"),
        ([Point(40, 60, 1500), Point(120, 60, 500)], "nearer points have the smaller disparity"),
        ([Point(160, 60, 500), Point(-1, 5, 900)], "point 160,60: it lies outside the map"),
        ([Point(40, 10, 500), Point(120, 60, 900)], "point 40,10: the map has no disparity"),
    ],
)
def test_points_that_say_nothing_are_refused(points, says):
    disparity, _ = scene(CAMERA, np.array([500.0, 1500.0]))
    disparity[:20] = np.nan
    with pytest.raises(InputError, match=says):
        calibrate(disparity, points)


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "a,2,3", "1.5,2,3", "1,2,-5", "1,2,nan"])
def test_texts_that_are_no_points_are_refused(text):
    with pytest.raises(InputError, match="--point"):
        Point.parse(text)


def test_an_assumed_camera_spans_what_it_says():
    disparity = np.linspace(-3, 2, 120 * 160, dtype=np.float32).reshape(120, 160)
    facts, _ = assumed_camera(disparity, CameraFacts())
    camera = facts.camera((120, 160))
    found = np.percentile(camera.depth_mm(disparity), [1, 99])
    np.testing.assert_allclose(found, [1000, 2000], rtol=1e-3)
    assert 2 * np.degrees(np.arctan(80 / camera.focal_px)) == pytest.approx(40)
    flat, _ = assumed_camera(np.ones((120, 160), np.float32), CameraFacts())
    flat = flat.camera((120, 160))
    assert np.isfinite(flat.depth_mm(np.ones(1))).all()


@pytest.mark.parametrize(
    "known",
    [CameraFacts(fov_deg=80), CameraFacts(focal_length_mm=20, sensor_size_mm=36, baseline_mm=7)],
)
def test_an_assumed_camera_keeps_the_view_that_is_known(known):
    disparity = np.linspace(-3, 2, 120 * 160, dtype=np.float32).reshape(120, 160)
    facts, made_up = assumed_camera(disparity, known)
    assert "view of" not in made_up
    focal_px = 80 / np.tan(np.radians(40)) if known.fov_deg else 160 * 20 / 36
    assert facts.camera((120, 160)).focal_px == pytest.approx(focal_px)
    assert facts.baseline_mm is None  # made up with the depths
