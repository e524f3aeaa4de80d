"""The decoder returns the light field that the forward model photographed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from plenoptic_forward import (
    F01,
    ILLUM,
    Body,
    Optics,
    Scene,
    camera_rgb,
    expose,
    frame_metadata,
    photograph,
    private_metadata,
    srgb,
    white_image,
)
from scipy.ndimage import map_coordinates

from epinet.raw.capture import Capture
from epinet.raw.decoder import decode_capture
from epinet.raw.metadata import parse_frame
from epinet.raw.views import Sampling

CAMERAS = {
    "illum": (ILLUM, Optics()),
    "f01": (F01, Optics(size=(400, 440), pitch=10.0, rotation=-0.00086, centre=(222.2, 199.1))),
    "turned": (ILLUM, Optics(size=(420, 450), pitch=13.9, rotation=0.012, centre=(210.4, 201.7))),
}
STEP_OF_PITCH = 0.75 / (2 * np.sqrt(2) * 4)
"""Distance of adjacent views in pitches that 9x9 views are documented to have (docs/raw.md)."""
LIMIT_DB = 35
BIAS_LIMIT_PX = 0.02


@dataclass(frozen=True)
class Decoded:
    views: NDArray[np.uint16]
    sampling: Sampling
    scene: Scene

    def truth(self, row: int, col: int) -> NDArray[np.float64]:
        """The view (H, W, 3) as it must be."""
        x, y = np.moveaxis(self.sampling.points(), -1, 0)
        dx, dy = self.sampling.directions[row * len(self.views) + col]
        return srgb(self.scene.colour(x, y, dx, dy))

    def psnr_db(self, row: int, col: int) -> float:
        error = self.views[row, col] / 65535 - self.truth(row, col)
        return float(-10 * np.log10(np.mean(error**2)))


def captured(body: Body, optics: Optics, raw: NDArray[np.uint16]) -> Capture:
    frame = parse_frame(frame_metadata(optics, body), private_metadata(body), "a.lfp")
    return Capture(frame, raw)


@lru_cache
def decoded(
    camera: str,
    disparity_px: tuple[float, float] = (-0.6, 0.6),
    *,
    white: bool = True,
    noise: float = 0.0,
    views: int = 9,
    larger: float = 1.0,
) -> Decoded:
    """A plane that recedes from left to right, with waves of at least 6 px of a view."""
    body, optics = CAMERAS[camera]
    height, width = (int(side * larger) // 4 * 4 for side in optics.size)
    optics = replace(optics, size=(height, width))
    view_px = optics.pitch * np.sqrt(3) / 2
    low, high = (d * view_px / (STEP_OF_PITCH * optics.pitch) for d in disparity_px)
    scene = Scene(
        slope0=(low + high) / 2,
        slope_x=(high - low) / width,
        middle=(width / 2, height / 2),
        finest_px=6 * view_px,
    )
    capture = captured(body, optics, photograph(optics, body, scene, noise))
    reference = white_image(optics, body, noise) if white else None
    return Decoded(*decode_capture(capture, reference, views), scene)


@pytest.mark.parametrize("camera", CAMERAS)
def test_every_view_is_the_scenes(camera: str) -> None:
    lf = decoded(camera)
    quality = [[lf.psnr_db(row, col) for col in range(9)] for row in range(9)]
    assert np.min(quality) > LIMIT_DB


def test_large_disparities() -> None:
    lf = decoded("illum", (-1.2, -0.9))
    assert min(lf.psnr_db(row, col) for row, col in [(0, 0), (0, 4), (4, 4), (8, 8)]) > LIMIT_DB


def bias_px(lf: Decoded, row: int, col: int) -> float:
    """How much a view's disparity exceeds the truth: a plain sweep of shifts of the centre view."""
    side = len(lf.views)
    across, down = col - side // 2, row - side // 2
    centre, view = (lf.views[r, c].mean(axis=2) for r, c in ((side // 2, side // 2), (row, col)))
    y, x = np.mgrid[: view.shape[0], : view.shape[1]].astype(float)
    points = lf.sampling.points()
    dx, dy = lf.sampling.directions[row * side + col]
    slope = lf.scene.slope(points[..., 0], points[..., 1], dx, dy)
    disparity = slope * lf.sampling.step_px / lf.sampling.spacing_px
    shifts = np.linspace(-0.1, 0.1, 11)
    inner = slice(6, -6), slice(6, -6)
    costs = []
    for shift in shifts:
        places = y + (disparity + shift) * down, x + (disparity + shift) * across
        warped = map_coordinates(centre, places, order=3, mode="nearest")
        costs.append(np.mean((warped - view)[inner] ** 2))
    curve, slope_, _ = np.polyfit(shifts, costs, 2)
    return float(-slope_ / (2 * curve))


@pytest.mark.parametrize("camera", CAMERAS)
def test_disparity_is_unbiased(camera: str) -> None:
    lf = decoded(camera)
    for row, col in [(4, 0), (4, 8), (0, 4), (8, 4), (0, 0), (8, 8), (0, 8), (8, 0)]:
        assert abs(bias_px(lf, row, col)) < BIAS_LIMIT_PX, (row, col)


def test_noise_of_one_percent_leaves_disparity_unbiased() -> None:
    """A lenslet's pixels are averaged; the colour matrix amplifies what noise is left."""
    lf = decoded("f01", noise=0.01)
    assert lf.psnr_db(4, 4) > 30
    assert abs(bias_px(lf, 4, 0)) < BIAS_LIMIT_PX


def test_without_white_images_the_picture_does() -> None:
    lf = decoded("illum", white=False, larger=1.6)
    quality = [lf.psnr_db(row, col) for row in range(0, 9, 4) for col in range(0, 9, 4)]
    assert min(quality) > 30
    assert abs(bias_px(lf, 4, 0)) < BIAS_LIMIT_PX
    assert abs(bias_px(lf, 0, 4)) < BIAS_LIMIT_PX


@pytest.mark.parametrize("views", [3, 7, 13])
def test_other_numbers_of_views(views: int) -> None:
    lf = decoded("f01", (-0.3, 0.3), views=views)
    assert lf.views.shape[:2] == (views, views)
    assert min(lf.psnr_db(0, 0), lf.psnr_db(views - 1, views // 2)) > LIMIT_DB
    reach = np.abs(lf.sampling.directions).max() * np.sqrt(2)
    assert reach == pytest.approx(0.75 * 10 / 2, rel=0.01)


@pytest.mark.parametrize("body", [F01, ILLUM], ids=lambda body: body.model)
@pytest.mark.parametrize("colour", [(0.8, 0.8, 0.8), (0.1, 0.1, 0.1), (0.7, 0.3, 0.2)])
def test_colours_are_those_of_the_metadata(body: Body, colour: tuple[float, ...]) -> None:
    optics = Optics(size=(280, 300), centre=(150.3, 138.6))
    light = camera_rgb(body, np.array(colour))
    raw = expose(optics, body, lambda x, y, dx, dy: np.broadcast_to(light, (*x.shape, 3)))
    views, _ = decode_capture(captured(body, optics, raw), white_image(optics, body))
    np.testing.assert_allclose(
        views / 65535, np.broadcast_to(srgb(np.array(colour)), views.shape), atol=0.01
    )


def test_blown_highlights_are_not_tinted() -> None:
    optics = Optics(size=(280, 300), centre=(150.3, 138.6))
    raw = expose(optics, ILLUM, lambda x, y, dx, dy: np.full((*x.shape, 3), 4.0))
    views, _ = decode_capture(captured(ILLUM, optics, raw), white_image(optics, ILLUM))
    assert (views[4, 4] == 65535).mean() > 0.99
