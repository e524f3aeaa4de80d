"""From rendered views to a mesh in mm: the error of the whole way, against the truth."""

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.geometry.surface import surface
from epinet.lightfield import LightField
from epinet.predict.estimator import load_model

SIZE, SIDE = 160, 9
OFF = np.arange(SIDE) - SIDE // 2
PRESENT = (OFF == 0) | (OFF[:, None] == 0) | (np.abs(OFF) == np.abs(OFF)[:, None])
"""The star, which is all that the network sees."""
CAMERA = Camera(50.0, 36.0, 12.0, 800.0, SIZE, SIZE)


def plane(eye, rays):
    """Tilted by 40 degrees, 850 mm away on the axis."""
    n = np.array([np.sin(np.radians(40)), 0.0, np.cos(np.radians(40))])
    return ((np.array([0, 0, -850.0]) - eye) @ n) / (rays @ n)


def sphere(eye, rays):
    """Radius 120 mm at 800 mm, before a wall at 1000 mm."""
    middle = np.array([10.0, -20.0, -800.0]) - eye
    a, b = (rays**2).sum(-1), rays @ middle
    inside = b**2 - a * (middle @ middle - 120.0**2)
    return np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, 1000.0)


def step(eye, rays):
    """A wall at 700 mm left of the axis, one at 900 mm on the rest."""
    return np.where(eye[0] + rays[..., 0] * 700 < 0, 700.0, 900.0)


def colours(points):
    """A pattern in space, fine enough to match and coarse enough to be sampled."""
    rng = np.random.default_rng(0)
    gray = np.zeros(points.shape[:-1])
    for length_mm in (25, 40, 70, 150):
        waves = rng.normal(size=(6, 3))
        waves *= 2 * np.pi / length_mm / np.linalg.norm(waves, axis=1, keepdims=True)
        gray += np.sin(points @ waves.T + rng.uniform(0, 6, 6)).sum(-1)
    gray = 0.5 + 0.06 * gray
    return np.stack([gray, 0.9 * gray, 0.8 * gray], -1)


def light_field(scene):
    """Views of pinholes whose sensors are shifted to agree at the focus distance."""
    pixel = CAMERA.sensor_size_mm / SIZE / CAMERA.focal_length_mm
    x = (np.arange(SIZE) + 0.5 - SIZE / 2) * pixel
    across, down = np.meshgrid(x, x)
    views = np.zeros((SIDE, SIDE, SIZE, SIZE, 3), np.uint8)
    for row in range(SIDE):
        for col in range(SIDE):
            eye = np.array([col - SIDE // 2, SIDE // 2 - row, 0.0]) * CAMERA.baseline_mm
            if not PRESENT[row, col]:
                continue
            shift = -eye / CAMERA.focus_distance_mm
            rays = np.stack([across + shift[0], -down + shift[1], -np.ones_like(across)], -1)
            points = eye + rays * scene(eye, rays)[..., None]
            views[row, col] = np.round(255 * np.clip(colours(points), 0, 1))
            if row == col == SIDE // 2:
                truth = points
    return LightField(views, present=PRESENT, camera=CAMERA), truth


@pytest.mark.parametrize(
    ("scene", "median_mm", "most_mm"), [(plane, 1.2, 6), (sphere, 1.2, 6), (step, 1.0, 5)]
)
def test_views_become_a_surface_in_mm(scene, median_mm, most_mm):
    """Median, and 95 of 100 points, of the distance to where each point truly is."""
    lf, truth = light_field(scene)
    result = load_model().predict(lf)
    made = surface(result.disparity, result.centre_view, CAMERA)
    x, y = made.pixels.astype(int).T
    error = np.linalg.norm(made.points_mm - truth[y, x], axis=1)
    assert np.median(error) < median_mm
    assert np.percentile(error, 95) < most_mm
    assert len(made.points_mm) > 0.95 * SIZE**2
