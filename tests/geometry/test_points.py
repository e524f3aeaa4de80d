"""Points against pinholes written out, and there and back."""

import numpy as np

from epinet.geometry.points import project, unproject


def test_a_pixel_becomes_the_point_that_it_shows(camera, sphere):
    depth = camera.depth_mm(sphere.disparity)
    error = np.abs(unproject(depth, camera) - sphere.points_mm)
    assert error.max() < 0.01  # mm, at up to 1200: the rounding of float32 disparities


def test_project_undoes_unproject(camera):
    depth = np.random.default_rng(0).uniform(300, 3000, (120, 160))
    rows, cols = np.mgrid[:120, :160]
    seen = project(unproject(depth, camera), camera)
    np.testing.assert_allclose(seen, np.stack([cols, rows], axis=-1), atol=1e-9)
