"""The geometry on a scene of the benchmark: what is square in a kitchen is square in its mesh."""

import itertools

import numpy as np
import pytest

import epinet
from epinet.geometry.points import unproject


def plane_normal(points):
    """Of the plane through most of the points: a fit, again without what lies far off."""
    for _ in range(5):
        middle = points.mean(axis=0)
        normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
        off = np.abs((points - middle) @ normal)
        points = points[off <= 3 * np.median(off)]
    return normal


def test_walls_and_worktop_of_a_kitchen_meet_at_right_angles(real):
    """A wrong focal length, baseline or focus distance would shear them."""
    lf = epinet.read_light_field(real / "kitchen")
    disparity = epinet.load_model().predict(lf).disparity
    points = unproject(lf.camera.depth_mm(disparity), lf.camera)
    left_wall, right_wall = points[20:200, 20:140], points[20:110, 230:490]
    worktop = points[450:505, 20:200]
    normals = [plane_normal(part.reshape(-1, 3)) for part in (left_wall, right_wall, worktop)]
    for one, other in itertools.combinations(normals, 2):
        assert np.degrees(np.arccos(abs(one @ other))) == pytest.approx(90, abs=1)
