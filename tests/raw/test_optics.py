"""The camera model against a ray trace through a thin lens and lenslets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plenoptic_forward import F01, ILLUM, Body, Optics, frame_metadata

from epinet.raw.lenslets import LensletGrid
from epinet.raw.metadata import Frame, parse_frame
from epinet.raw.optics import camera_of
from epinet.raw.views import Sampling, plan_sampling


def sampled(body: Body, pitch: float) -> tuple[Frame, Sampling]:
    optics = Optics(size=(800, 1000), pitch=pitch)
    row = pitch * np.sqrt(3) / 2
    grid = LensletGrid((500.0, 400.0), (pitch, 0.0), (pitch / 2, row))
    frame = parse_frame(frame_metadata(optics, body), {}, "a.lfp")
    return frame, plan_sampling(grid, optics.size, 9, "a.lfp")


@pytest.mark.parametrize(("body", "pitch"), [(F01, 10.0), (ILLUM, 14.286)])
@pytest.mark.parametrize("depth_mm", [80.0, 200.0, 500.0, 5e3, 1e7])
def test_disparity_of_a_point(body: Body, pitch: float, depth_mm: float) -> None:
    """Rays from a point through two places of the lens, as far apart as two views look."""
    frame, sampling = sampled(body, pitch)
    camera = camera_of(frame, sampling)
    assert camera is not None
    f, aperture = frame.focal_length_mm, frame.focal_length_mm / frame.f_number
    lenslets_at = f + frame.infinity_lambda * frame.f_number * frame.lens_pitch_mm
    image_at = 1 / (1 / f - 1 / depth_mm)
    apart = aperture * sampling.step_px / pitch  # a lenslet's image is the aperture
    moved_mm = apart * (1 - lenslets_at / image_at)  # where the rays meet the lenslets
    moved_px = moved_mm / (sampling.spacing_px * frame.pixel_pitch_mm)
    found = float(camera.disparity_px(np.array(depth_mm)))
    # Looking from the right moves near points left in the upright picture; the image in the camera
    # is upside down, so there they move right.
    assert found == pytest.approx(moved_px, rel=1e-5, abs=1e-6)
    assert float(camera.depth_mm(np.array(found))) == pytest.approx(depth_mm, rel=1e-3)


def test_sharp_where_the_lenslets_are() -> None:
    frame, sampling = sampled(F01, 10.0)
    camera = camera_of(frame, sampling)
    assert camera is not None
    image_at = 1 / (1 / frame.focal_length_mm - 1 / camera.focus_distance_mm)
    assert image_at == pytest.approx(camera.focal_length_mm)
    assert (camera.height_px, camera.width_px) == sampling.size


@pytest.mark.parametrize("infinity", [None, 0.0, -2.0])
def test_without_a_finite_focus_there_is_no_camera(infinity: float | None) -> None:
    frame, sampling = sampled(F01, 10.0)
    assert camera_of(replace(frame, infinity_lambda=infinity), sampling) is None
