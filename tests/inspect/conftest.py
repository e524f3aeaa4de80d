"""A plain, slow renderer of fronto-parallel layers, independent of the package's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from epinet.lightfield import LightField

Disc = tuple[float, float, float]
"""(x, y, radius) in the centre view, as shares of its width."""


@pytest.fixture(scope="session")
def render() -> Callable[..., LightField]:
    return render_layers


def render_layers(
    layers: Mapping[float, Disc | None],
    grid: int = 9,
    size: tuple[int, int] = (96, 112),
    contrast: float = 0.15,
    noise: float = 0.0,
) -> LightField:
    """Views (grid, grid, H, W, 1) of textured planes by disparity: a disc, or None to fill all."""
    rng = np.random.default_rng(0)
    textures = {disparity: _texture(rng, size, contrast) for disparity in sorted(layers)}
    views = np.zeros((grid, grid, *size, 1), np.float32)
    for row, col in np.ndindex(grid, grid):
        image = np.zeros(size)
        for disparity, texture in textures.items():  # from the farthest to the nearest
            shift = disparity * (row - grid // 2), disparity * (col - grid // 2)
            _paint(image, texture, layers[disparity], *shift)
        views[row, col, ..., 0] = image + rng.normal(0, noise, size)
    return LightField(np.clip(views, 0, 1))


def _texture(
    rng: np.random.Generator, size: tuple[int, int], contrast: float
) -> NDArray[np.float64]:
    fine = gaussian_filter(rng.normal(size=size), 1.2, mode="wrap")
    coarse = gaussian_filter(rng.normal(size=size), 5, mode="wrap")
    mixed = fine / fine.std() + coarse / coarse.std()
    return np.asarray(rng.uniform(0.4, 0.6) + contrast * mixed / mixed.std())


def _paint(
    image: NDArray[np.float64],
    texture: NDArray[np.float64],
    disc: Disc | None,
    dy: float,
    dx: float,
) -> None:
    """Paint what the view sees of a plane: its pixel (x, y) shows the centre's (x + dx, y + dy)."""
    height, width = image.shape
    y, x = np.mgrid[:height, :width] + np.array([dy, dx])[:, None, None]
    colour = map_coordinates(texture, [y, x], order=1, mode="grid-wrap")
    if disc is None:
        image[:] = colour
        return
    centre_x, centre_y, radius = (share * width for share in disc)
    inside = (x - centre_x) ** 2 + (y - centre_y) ** 2 < radius**2
    image[inside] = colour[inside]
