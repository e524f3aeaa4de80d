"""Black corners of the camera's own are told from a dark scene."""

import numpy as np
import pytest

from epinet.inspect.vignetting import black_corners
from epinet.io import read_light_field
from epinet.lightfield import LightField

RADIUS_PX = 38


def field(dtype=np.uint8, brightness=1.0, noise=0.0):
    """Noise seen by 5x5 views through a round stop that stands still; and where it is shut."""
    g = np.random.default_rng(1)
    y, x = np.mgrid[:48, :64]
    shut = np.hypot(y - 23.5, x - 31.5) > RADIUS_PX
    views = g.uniform(0.1, 1, (5, 5, 48, 64, 3)) * ~shut[..., None]
    views = np.clip(views + noise * g.normal(size=views.shape), 0, 1) * brightness
    if np.issubdtype(dtype, np.integer):
        views = np.round(np.iinfo(dtype).max * views)
    return LightField(views.astype(dtype)), shut


@pytest.mark.parametrize(
    ("dtype", "brightness", "noise"),
    [(np.uint8, 1.0, 0.0), (np.uint16, 1 / 64, 0.0), (np.float32, 1.0, 0.002)],
)
def test_black_corners_are_those_that_the_stop_shuts(dtype, brightness, noise):
    lf, shut = field(dtype, brightness, noise)
    assert shut[0, 0]
    assert (black_corners(lf) == shut).all()


def test_what_moves_with_the_views_is_the_scene():
    """Black in the corners of every view, but in another place of each."""
    lf, _ = field()
    views = lf.views.copy()
    for row, col in np.ndindex(5, 5):
        views[row, col, :, :] = np.maximum(views[row, col], 30)
        views[row, col, : 6 + 3 * row, : 6 + 3 * col] = 0
    dark = black_corners(LightField(views))
    assert not dark.any()


def test_a_dark_scene_is_no_vignetting():
    views = field()[0].views.copy()
    views[:, :, :30] = 0
    assert not black_corners(LightField(views)).any()
    views[:] = 0
    views[2, 2, 24, 32] = 255
    assert not black_corners(LightField(views)).any()


def test_corners_of_a_real_capture(real):
    lf = read_light_field(real / "lytro_2067")
    dark = black_corners(lf)
    assert 0.01 < dark.mean() < 0.04
    assert dark[0, 0]
    assert not dark[lf.size[0] // 2].any()
    assert not black_corners(read_light_field(real / "dino")).any()
