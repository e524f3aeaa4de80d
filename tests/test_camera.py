"""Disparity <-> depth against the benchmark's formula and the geometry of a pinhole pair."""

import numpy as np
import pytest

from epinet.camera import Camera

KITCHEN = Camera(100.0, 35.0, 11.0, 2300.0, 512, 512)


def test_focus_plane_has_no_disparity():
    assert KITCHEN.depth_mm(np.array(0.0)) == pytest.approx(2300)
    assert KITCHEN.disparity_px(np.array(2300.0)) == pytest.approx(0, abs=1e-6)


def test_nearer_is_positive():
    assert KITCHEN.depth_mm(np.array(1.0)) < 2300 < KITCHEN.depth_mm(np.array(-1.0))


def test_the_two_are_inverse():
    d = np.linspace(-1.6, 1.8, 50)
    np.testing.assert_allclose(KITCHEN.disparity_px(KITCHEN.depth_mm(d)), d, atol=1e-5)


def test_equals_shifted_sensors():
    """Two pinholes a baseline apart whose sensors are shifted to agree at the focus distance."""
    z = np.array([1500.0, 2000.0, 4000.0])
    f, pixel_mm = KITCHEN.focal_length_mm, 35.0 / 512
    parallax_mm = f * KITCHEN.baseline_mm / z
    shift_mm = f * KITCHEN.baseline_mm / KITCHEN.focus_distance_mm
    np.testing.assert_allclose(
        KITCHEN.disparity_px(z), (parallax_mm - shift_mm) / pixel_mm, rtol=1e-4
    )


def test_at_and_beyond_infinity_depth_is_infinite():
    at_infinity = float(KITCHEN.disparity_px(np.array(np.inf)))
    assert np.isinf(KITCHEN.depth_mm(np.array(at_infinity - 0.01)))
    assert np.isfinite(KITCHEN.depth_mm(np.array(at_infinity + 0.01)))
