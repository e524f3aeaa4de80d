from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.lightfield import LightField

MakeLightField = Callable[..., LightField]


@pytest.fixture
def make() -> MakeLightField:
    """Makes a light field of noise; no view is black and all differ."""

    def make_light_field(side: int = 9, dtype: str = "uint8", channels: int = 3) -> LightField:
        rng = np.random.default_rng(side)
        shape = (side, side, 24, 30, channels)
        if dtype == "float32":
            return LightField(rng.random(shape, dtype=np.float32))
        return LightField(rng.integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True))

    return make_light_field


@pytest.fixture
def camera() -> Camera:
    """One whose views have the size of `make`'s."""
    return Camera(100.0, 35.0, 11.0, 500.0, 30, 24, -1.5, 2.0)
