"""Scenes whose surfaces are known exactly, seen by a camera array written out as pinholes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from epinet.camera import Camera

WIDTH, HEIGHT = 160, 120
PITCH_MM = 36 / WIDTH


@dataclass(frozen=True)
class Scene:
    """What the centre view sees; points in mm, x right, y up, z towards the viewer."""

    points_mm: NDArray[np.float64]
    """(H, W, 3) exact."""
    disparity: NDArray[np.float32]
    """(H, W), from where two pinholes a baseline apart see each point."""
    front: NDArray[np.bool_]
    """(H, W) which pixels show the nearer of two things."""


@pytest.fixture(scope="session")
def camera() -> Camera:
    return Camera(50.0, 36.0, 5.0, 800.0, WIDTH, HEIGHT)


@pytest.fixture(scope="session")
def rays() -> NDArray[np.float64]:
    """(H, W, 3) through the middle of each pixel, 1 mm along the optical axis."""
    x = (np.arange(WIDTH) + 0.5) * PITCH_MM - 36 / 2
    y = HEIGHT * PITCH_MM / 2 - (np.arange(HEIGHT) + 0.5) * PITCH_MM
    right, up = np.meshgrid(x / 50, y / 50)
    return np.stack([right, up, -np.ones_like(up)], axis=-1)


def seen(points_mm: NDArray[np.float64], front: NDArray[np.bool_] | None = None) -> Scene:
    """A point's place on the sensor of the next view to the right, whose sensor is shifted so
    that things at the focus distance stay where they are, subtracted from its place in ours."""
    x, z = points_mm[..., 0], -points_mm[..., 2]
    ours = 50 * x / z
    next_view = 50 * (x - 5.0) / z + 50 * 5.0 / 800.0
    disparity = ((ours - next_view) / PITCH_MM).astype(np.float32)
    nothing = np.zeros(disparity.shape, dtype=bool)
    return Scene(points_mm, disparity, nothing if front is None else front)


@pytest.fixture(scope="session")
def plane(rays: NDArray[np.float64]) -> Callable[[tuple[float, float, float], float], Scene]:
    """Makes the plane of a normal that the optical axis meets at a distance."""

    def make(normal: tuple[float, float, float], at_mm: float) -> Scene:
        n = np.array(normal)
        depth = np.full(rays.shape[:2], -at_mm * n[2]) / (rays @ n)
        return seen(rays * depth[..., None])

    return make


@pytest.fixture(scope="session")
def sphere(rays: NDArray[np.float64]) -> Scene:
    """Radius 90 mm, its middle 700 mm away and off the axis, before a wall at 1200 mm."""
    middle, radius = np.array([40.0, -25.0, -700.0]), 90.0
    a, b = (rays**2).sum(-1), rays @ middle
    inside = b**2 - a * (middle @ middle - radius**2)
    depth = (b - np.sqrt(np.maximum(inside, 0))) / a
    front = inside > 0
    return seen(rays * np.where(front, depth, 1200.0)[..., None], front)


@pytest.fixture(scope="session")
def step(rays: NDArray[np.float64]) -> Scene:
    """A wall at 700 mm on the left third, one at 900 mm on the rest."""
    front = np.broadcast_to(np.arange(WIDTH) < WIDTH // 3, rays.shape[:2])
    return seen(rays * np.where(front, 700.0, 900.0)[..., None], front)


@pytest.fixture(scope="session")
def picture() -> NDArray[np.uint8]:
    """(H, W, 3) whose red tells the column and whose green tells the row."""
    rows, cols = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([cols, 2 * rows, np.full_like(rows, 77)], axis=-1).astype(np.uint8)
