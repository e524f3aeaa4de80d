"""Light fields of surfaces with a smooth pattern, each view written out, not warped."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from epinet.lightfield import LightField

HEIGHT, WIDTH, SIDE = 48, 64, 7

Pattern = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


@pytest.fixture(scope="session")
def pattern() -> Pattern:
    """Colours (..., 3) in 0..1 at any place x, y."""
    rng = np.random.default_rng(3)
    waves = rng.uniform(-0.7, 0.7, (4, 2))
    phases = rng.uniform(0, 6, (4, 3))

    def colours(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        along = x[..., None] * waves[:, 0] + y[..., None] * waves[:, 1]
        return 0.5 + 0.48 * np.sin(along[..., None] + phases).mean(axis=-2)

    return colours


@pytest.fixture(scope="session")
def views_of(pattern: Pattern) -> Callable[..., LightField]:
    """Makes the light field of a plane with disparity d = d0 + slope * x of the centre view.

    The pixel x' of a view `step` columns to the right shows the centre view's x where
    x - d(x) * step = x'.
    """

    def make(d0: float, slope: float = 0.0) -> LightField:
        rows, cols = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
        views = np.empty((SIDE, SIDE, HEIGHT, WIDTH, 3))
        for row in range(SIDE):
            for col in range(SIDE):
                down, right = row - SIDE // 2, col - SIDE // 2
                x = (cols + d0 * right) / (1 - slope * right)
                views[row, col] = pattern(x, rows + (d0 + slope * x) * down)
        return LightField(np.round(255 * views).astype(np.uint8))

    return make
