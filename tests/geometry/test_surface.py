"""Surfaces against the scenes they show: in mm, whole where one thing is, and cut between two."""

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.geometry.points import project
from epinet.geometry.surface import surface

HEIGHT, WIDTH = 120, 160
ALL_FACES = 2 * (HEIGHT - 1) * (WIDTH - 1)


def normals_of(points, faces):
    """Unit normals of faces, counter-clockwise."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    crossed = np.cross(b - a, c - a)
    return crossed / np.linalg.norm(crossed, axis=1, keepdims=True)


def extremes(points):
    return points.min(axis=0), points.max(axis=0)


def tilted(degrees: float, around: float = 0.0) -> tuple[float, float, float]:
    """The normal of a plane turned from facing the camera, leaning towards `around` degrees."""
    s, a = np.radians([degrees, around])
    return np.sin(s) * np.cos(a), np.sin(s) * np.sin(a), np.cos(s)


@pytest.mark.parametrize("at_mm", [400, 800, 5000])
@pytest.mark.parametrize("normal", [(0, 0, 1), tilted(50), tilted(60, 135)])
def test_a_plane_comes_back_whole_and_metric(camera, plane, picture, normal, at_mm):
    scene = plane(normal, at_mm)
    made = surface(scene.disparity, picture, camera)
    assert len(made.faces) == ALL_FACES
    # The rounding of a float32 disparity of some px, in mm of depth: as the square of the depth.
    rounding_mm = 0.01 * max(1.0, (-scene.points_mm[..., 2].min() / 800) ** 2)
    assert np.abs(made.points_mm @ normal + at_mm * normal[2]).max() < rounding_mm
    exact = scene.points_mm.reshape(-1, 3)
    for found, true in zip(extremes(made.points_mm), extremes(exact), strict=True):
        np.testing.assert_allclose(found, true, rtol=1e-4, atol=rounding_mm)


def strip(camera, rays, slant, at_mm):
    """Disparities of a strip so narrow that the line of sight hardly turns, so that a plane's
    normal makes one angle with it."""
    n = np.array(tilted(slant))
    middle = slice(WIDTH // 2 - 6, WIDTH // 2 + 6)
    disparity = np.full(rays.shape[:2], np.nan, np.float32)
    disparity[:, middle] = camera.disparity_px(-at_mm * n[2] / (rays[:, middle] @ n))
    return disparity


@pytest.mark.parametrize("slant", [0, 45, 70, 78])
@pytest.mark.parametrize("at_mm", [300, 3000])
def test_what_holds_together_is_the_slant_not_the_distance(camera, rays, picture, slant, at_mm):
    made = surface(strip(camera, rays, slant, at_mm), picture, camera)
    assert len(made.faces) == 2 * (HEIGHT - 1) * 11


def test_what_is_steeper_is_cut(camera, rays, picture):
    with pytest.raises(InputError, match="no surface is left"):
        surface(strip(camera, rays, 86, 300), picture, camera)


def test_a_sphere_comes_back_metric_and_apart_from_the_wall(camera, sphere, picture):
    made = surface(sphere.disparity, picture, camera)
    middle, radius = np.array([40.0, -25.0, -700.0]), 90.0
    to_middle = np.linalg.norm(made.points_mm - middle, axis=1)
    on_sphere = np.abs(to_middle - radius) < 0.01
    on_wall = np.abs(made.points_mm[:, 2] + 1200) < 0.02
    assert (on_sphere ^ on_wall).all()
    joined = on_sphere[made.faces]
    assert (joined.all(axis=1) | ~joined.any(axis=1)).all()  # no rubber sheet
    assert on_sphere.sum() > 0.9 * sphere.front.sum()
    assert on_wall.sum() > 0.98 * (~sphere.front).sum()


def test_faces_look_outward_from_the_sphere(camera, sphere, picture):
    made = surface(sphere.disparity, picture, camera)
    outward = made.points_mm[made.faces].mean(axis=1) - [40.0, -25.0, -700.0]
    length = np.linalg.norm(outward, axis=1)
    inner = length < 90.1
    normals = normals_of(made.points_mm, made.faces)
    cosines = (normals[inner] * outward[inner]).sum(axis=1) / length[inner]
    assert np.degrees(np.arccos(np.median(cosines))) < 1
    assert (normals[~inner] @ [0, 0, 1]).min() > 0.999  # the wall's, towards the camera


def test_a_step_is_cut_all_along_and_nowhere_else(camera, step, picture):
    made = surface(step.disparity, picture, camera)
    depth = -made.points_mm[:, 2]
    near = np.abs(depth - 700) < 0.01
    assert (near ^ (np.abs(depth - 900) < 0.01)).all()
    assert len(made.faces) == ALL_FACES - 2 * (HEIGHT - 1)
    assert near.sum() == step.front.sum()
    bridged = surface(step.disparity, picture, camera, cut_px=np.inf)
    assert len(bridged.faces) == ALL_FACES


def test_noise_does_not_tear_a_far_plane(camera, plane, picture):
    noise = np.random.default_rng(0).normal(0, 0.005, (HEIGHT, WIDTH)).astype(np.float32)
    made = surface(plane((0, 0, 1), 20_000).disparity + noise, picture, camera)
    assert len(made.faces) == ALL_FACES


def test_what_has_no_depth_is_left_out(camera, plane, picture):
    disparity = plane((0, 0, 1), 900).disparity.copy()
    disparity[:, :40] = np.nan
    disparity[:, 120:] = camera.disparity_px(np.array(np.inf)) - 0.5
    made = surface(disparity, picture, camera)
    assert np.isfinite(made.points_mm).all()
    assert set(made.pixels[:, 0]) == set(range(40, 120))
    keep = np.zeros(disparity.shape, dtype=bool)
    keep[:60] = True
    assert surface(disparity, picture, camera, keep=keep).pixels[:, 1].max() == 59


def test_crumbs_are_left_out(camera, plane, picture):
    disparity = plane((0, 0, 1), 900).disparity.copy()
    disparity[50:52, 50:52] += 3
    made = surface(disparity, picture, camera)
    assert np.abs(made.points_mm[:, 2] + 900).max() < 0.01


def test_each_point_has_the_colour_and_texture_of_its_pixel(camera, sphere, picture):
    made = surface(sphere.disparity, picture, camera)
    x, y = made.pixels.astype(int).T
    np.testing.assert_array_equal(made.colours, picture[y, x])
    u, v = made.uv.T  # from the bottom left of the picture
    np.testing.assert_allclose(u * WIDTH - 0.5, x, atol=1e-9)
    np.testing.assert_allclose(HEIGHT - v * HEIGHT - 0.5, y, atol=1e-9)


def test_simplified_surfaces_keep_shape_and_picture(camera, sphere, picture):
    made = surface(sphere.disparity, picture, camera)
    few = made.simplified(3000, camera)
    assert 1000 < len(few.faces) <= 3000
    to_middle = np.linalg.norm(few.points_mm - [40.0, -25.0, -700.0], axis=1)
    off = np.minimum(np.abs(to_middle - 90), np.abs(few.points_mm[:, 2] + 1200))
    assert np.percentile(off, 90) < 1  # mm
    seen_at = project(few.points_mm, camera)
    inside = (seen_at >= 0).all(axis=1) & (seen_at <= [WIDTH - 1, HEIGHT - 1]).all(axis=1)
    told = few.colours[inside].astype(float) / [1, 2, 1]
    np.testing.assert_allclose(told[:, :2], seen_at[inside], atol=0.6)
    assert made.simplified(10**6, camera) is made


def test_an_empty_mesh_is_refused(camera, plane, picture):
    disparity = plane((0, 0, 1), 900).disparity
    with pytest.raises(InputError, match="no pixel is left"):
        surface(np.full_like(disparity, -100), picture, camera)
    torn = disparity + np.random.default_rng(0).normal(0, 5, disparity.shape).astype(np.float32)
    with pytest.raises(InputError, match="no surface is left after cutting"):
        surface(torn, picture, camera, cut_px=0)
