"""The grid of lenslets is found where the forward model put it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plenoptic_forward import ILLUM, Body, Optics, Scene, photograph, white_image

from epinet.errors import InputError
from epinet.raw.bayer import mosaic
from epinet.raw.lenslets import LensletGrid, fit_grid
from epinet.raw.vignetting import measured_falloff

WITHOUT_COLOUR = Body("ILLUM", 10, 64, "gr", (1, 1, 1), (1, 0, 0, 0, 1, 0, 0, 0, 1), (1, 1, 1))


def levels(raw: np.ndarray) -> np.ndarray:
    return (raw.astype(np.float32) - 64) / (1023 - 64)


def errors_px(grid: LensletGrid, optics: Optics) -> np.ndarray:
    """Distance of the grid's lenslets inside the image from the nearest true ones."""
    x, y = grid.centres(*grid.within(optics.size, 0).T).T
    true_x, true_y = optics.lenslet_of(x, y)
    return np.hypot(x - true_x, y - true_y)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    pitch=st.floats(9.5, 16),
    rotation=st.floats(-0.02, 0.02),
    scale_y=st.floats(0.998, 1.002),
    x=st.floats(130, 150),
    y=st.floats(120, 140),
)
def test_white_image(pitch: float, rotation: float, scale_y: float, x: float, y: float) -> None:
    optics = Optics((310, 330), pitch, rotation, scale_y, (x, y))
    grid = fit_grid(levels(white_image(optics, WITHOUT_COLOUR)), pitch * 1.004, "white")
    assert errors_px(grid, optics).max() < 0.08  # at whole pitches, which align with the pixels
    assert grid.pitch_px == pytest.approx(pitch, abs=0.004)
    assert grid.rotation == pytest.approx(rotation, abs=4e-4)
    assert grid.row_height_px == pytest.approx(pitch * np.sqrt(3) / 2 * scale_y, abs=0.004)


@pytest.mark.parametrize("slope", [0.0, 7.0, -7.0])
def test_a_picture_will_do(slope: float) -> None:
    optics = Optics((700, 760))
    raw = photograph(optics, ILLUM, Scene(slope0=slope, finest_px=75))
    grid = fit_grid(levels(raw), optics.pitch, "picture")
    error = errors_px(grid, optics)
    assert error.mean() < 0.2
    assert error.max() < 0.5


@pytest.mark.parametrize("image", [np.zeros((300, 300)), np.full((300, 300), 0.5)])
def test_no_grid(image: np.ndarray) -> None:
    noise = np.random.default_rng(0).normal(0, 0.02, image.shape)
    with pytest.raises(InputError, match="no grid of lenslets"):
        fit_grid((image + noise).astype(np.float32), 14.3, "picture")


def test_too_small_for_a_grid() -> None:
    with pytest.raises(InputError, match="too few lenslets"):
        fit_grid(np.ones((40, 400), np.float32), 14.3, "picture")


@pytest.mark.parametrize("kind", ["white", "picture"])
def test_the_falloff_is_that_of_the_lenslets(kind: str) -> None:
    optics = Optics((500, 560))
    scene = Scene(slope0=3.0, finest_px=75, colourfulness=0.1)
    raw = (white_image if kind == "white" else lambda o, b: photograph(o, b, scene))(
        optics, WITHOUT_COLOUR
    )
    image = levels(raw)
    grid = fit_grid(image, optics.pitch, kind)
    radius = np.linspace(0, 0.9 * optics.pitch / 2, 20)
    found = measured_falloff(image, grid, mosaic("gr")).at(radius)
    due = optics.vignetting(radius, np.zeros_like(radius)) / optics.vignetting(0.0, 0.0)
    np.testing.assert_allclose(found, due, atol=0.02 if kind == "white" else 0.05)
