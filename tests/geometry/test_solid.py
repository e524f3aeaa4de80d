"""Solids to print: closed whatever the depth map, and of the size asked for."""

import numpy as np
import pytest
import trimesh

from epinet.errors import InputError
from epinet.geometry.solid import Print, solid
from epinet.geometry.surface_files import write_solid


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("faces", [None, 5000])
def test_closed_whatever_the_depth_map(camera, tmp_path, seed, faces):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(300, 3000, (12, 16)).repeat(10, 0).repeat(10, 1)
    depth += rng.normal(0, 5, depth.shape)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    depth[rng.random(depth.shape) < 0.05] = np.inf
    made = solid(depth, camera, faces=faces)
    write_solid(tmp_path / "solid.stl", made.mesh)
    read = trimesh.load(tmp_path / "solid.stl")
    assert read.is_watertight and read.is_winding_consistent and read.volume > 0
    assert read.body_count == 1
    assert faces is None or len(read.faces) < 1.3 * faces


def test_volume_and_size_of_a_wall(camera):
    """A frustum by hand: what lies between the wall and the plane behind it, and the base."""
    made = solid(np.full((120, 160), 1000.0), camera, Print(size_mm=80, base_mm=2))
    low, high = made.mesh.bounds
    width, height = high[:2] - low[:2]
    assert width == pytest.approx(80)
    assert height == pytest.approx(80 * 119 / 159)
    ray_mm = 1.0 * made.scale  # a thousandth of the wall's depth lies behind it
    assert high[2] - low[2] == pytest.approx(2 + ray_mm)
    ratio = 1 / 1.001  # of the wall to the plane behind it
    frustum = width * height * ray_mm * (1 + ratio + ratio**2) / 3
    assert made.mesh.volume == pytest.approx(2 * width * height + frustum, rel=1e-6)


def test_true_proportions(camera, step):
    made = solid(-step.points_mm[..., 2], camera, Print(size_mm=100, base_mm=2))
    points = made.mesh.vertices
    top = points[np.abs(points[:, 2] - points[:, 2].max()) < 1e-6]
    # The step is 200 mm deep; the near wall's edge is at column 0 of a wall 700 mm away.
    seen_mm = 159 / camera.focal_px * 900 * 1.001
    scale = 100 / seen_mm
    assert made.scale == pytest.approx(scale)
    assert points[:, 2].max() == pytest.approx(2 + (200 + 0.9) * scale, rel=1e-6)
    left = 79.5 / camera.focal_px * 700 * scale
    assert top[:, 0].min() == pytest.approx(-left)
    assert "1:" in made.describe()


def test_relief_sets_the_height_alone(camera, step):
    depth = -step.points_mm[..., 2]
    made = solid(depth, camera, Print(size_mm=100, base_mm=3, relief_mm=10))
    low, high = made.mesh.bounds
    assert high[0] - low[0] == pytest.approx(100)
    assert high[2] == pytest.approx(3 + 10 * (1 + 0.9 / 200))


def test_wrong_pixels_do_not_set_the_size(camera):
    depth = np.full((120, 160), 1000.0)
    depth[::2, ::2] = 1100
    depth[0, 0], depth[5, 5] = 1e7, 1.0
    made = solid(depth, camera)
    assert (made.nearest_mm, made.farthest_mm) == (1000, 1100)
    bounded = solid(depth, camera, near_mm=900, far_mm=1050)
    assert (bounded.nearest_mm, bounded.farthest_mm) == (900, 1050)


def test_what_cannot_be_printed_is_refused(camera):
    with pytest.raises(InputError, match="no pixel has a finite depth"):
        solid(np.full((120, 160), np.inf), camera)
    with pytest.raises(InputError, match=r"nothing lies between 2000 mm and 3000 mm"):
        solid(np.full((120, 160), 1000.0), camera, near_mm=2000, far_mm=3000)
    with pytest.raises(InputError, match="base of the print must be more than 0 mm") as refused:
        Print(size_mm=-1, base_mm=0)
    assert len(refused.value.problems) == 2
