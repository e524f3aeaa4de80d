"""The camera model of a capture: what its metadata say of depth."""

from __future__ import annotations

from epinet.camera import Camera
from epinet.raw.metadata import Frame
from epinet.raw.views import Sampling


def camera_of(frame: Frame, sampling: Sampling) -> Camera | None:
    """Nominal camera of the views, or None where the metadata do not tell the focus.

    The main lens as a thin lens of focal length f and f-number N. A lenslet's image is the lens's
    aperture, f / N wide, so views `step_px` apart look through points (f / N) * step / pitch apart:
    the baseline (Hahne et al., "Baseline and triangulation geometry in a standard plenoptic
    camera", IJCV 2018). The image of infinity lies before the lenslets by lambda * N * pitch,
    where lambda, the infinity lambda of the metadata, is its blur in lenslet pitches; with it the
    thin lens gives the focus distance. The image distance stands for the focal length, as in a
    pinhole camera.
    """
    if frame.infinity_lambda is None or frame.infinity_lambda <= 0:
        return None
    focal, number = frame.focal_length_mm, frame.f_number
    behind_focus = frame.infinity_lambda * number * frame.lens_pitch_mm
    image_distance = focal + behind_focus
    grid, (height, width) = sampling.grid, sampling.size
    return Camera(
        focal_length_mm=image_distance,
        sensor_size_mm=max(width, height) * sampling.spacing_px * frame.pixel_pitch_mm,
        baseline_mm=focal / number * sampling.step_px / grid.pitch_px,
        focus_distance_mm=focal * image_distance / behind_focus,
        width_px=width,
        height_px=height,
    )
