"""A raw capture to a light field."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.raw.bayer import mosaic
from epinet.raw.capture import Capture, read_capture
from epinet.raw.colour import balance, to_srgb
from epinet.raw.family import calibration_by_name
from epinet.raw.interpolate import sample_lenslets
from epinet.raw.lenslets import fit_grid
from epinet.raw.metadata import Frame
from epinet.raw.optics import camera_of
from epinet.raw.views import Sampling, SquarePixels, plan_sampling
from epinet.raw.vignetting import measured_falloff
from epinet.raw.white import BESIDE, choose_white, find_whites, levels, normalised_white

DEFAULT_VIEWS = 9
FEWEST_VIEWS, MOST_VIEWS = 3, 15

_ESTIMATED = (
    "vignetting and lenslets are estimated from the picture itself, so brightness and disparity "
    "are less exact, as {}"
)
_SAMPLING_SHARE = 0.5
"""Of the work, for showing progress."""


def decode(
    path: Path,
    white: Path | None = None,
    views: int = DEFAULT_VIEWS,
    progress: Callable[[float], None] = lambda share: None,
) -> LightField:
    """Views of a raw capture, 16-bit sRGB, with the nominal camera.

    Args:
        path: a .lfp or .lfr, or a .raw with its metadata beside.
        white: white images of the camera: a folder, a .tar, a data.C.0 or a .RAW. None takes the
            one in the file, then those of a folder `white` beside it; failing both, vignetting and
            grid are estimated from the picture.
        views: per row and column; odd.
        progress: called with shares of the work.

    Raises:
        InputError: a file or white image that cannot be used, or another number of views.
    """
    if views % 2 == 0 or not FEWEST_VIEWS <= views <= MOST_VIEWS:
        raise InputError(f"{views} views: an odd number from {FEWEST_VIEWS} to {MOST_VIEWS}")
    if found := calibration_by_name(path):
        raise InputError(f"{path}: {found}")
    capture = read_capture(path)
    white_raw, notes = _white_of(capture, path, white)
    pixels, sampling = decode_capture(capture, white_raw, views, progress)
    return LightField(
        pixels,
        camera=camera_of(capture.frame, sampling),
        captured=True,
        source=Path(path),
        layout="lytro_raw",
        notes=notes + _notes(capture.frame, sampling),
    )


def decode_capture(
    capture: Capture,
    white: NDArray[np.uint16] | None,
    views: int = DEFAULT_VIEWS,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[NDArray[np.uint16], Sampling]:
    """Views (V, V, H, W, 3), 16-bit sRGB, and where they lie on the sensor.

    Args:
        capture: the raw capture.
        white: (H, W) raw white image; None estimates vignetting and lenslets from the capture.
        views: per row and column; odd.
        progress: called with shares of the work.

    Raises:
        InputError: no grid of lenslets is to be seen, or the white image is dark.
    """
    frame = capture.frame
    pattern = mosaic(frame.upper_left)
    image = levels(capture.raw, frame)
    if white is None:
        grid = fit_grid(image, frame.pitch_px, frame.where)
        falloff = measured_falloff(image, grid, pattern)
    else:
        bright = normalised_white(levels(white, frame), frame)
        grid = fit_grid(bright, frame.pitch_px, f"the white image for {frame.where}")
        falloff = measured_falloff(bright, grid, pattern)
        image /= bright
    balance(image, frame, pattern)
    sampling = plan_sampling(grid, frame.size, views, frame.where)
    index = sampling.index()
    samples = sample_lenslets(
        image,
        grid,
        falloff,
        pattern,
        index.reshape(-1, 2),
        sampling.directions,
        devignetted=white is not None,
        progress=lambda share: progress(_SAMPLING_SHARE * share),
    ).reshape(*index.shape[:2], views**2, 3)
    square = SquarePixels(sampling)
    pixels = np.empty((views**2, *sampling.size, 3), np.uint16)
    for k in range(views**2):
        pixels[k] = to_srgb(square.view(np.ascontiguousarray(samples[:, :, k])), frame)
        progress((1 - _SAMPLING_SHARE) / views**2)
    return pixels.reshape(views, views, *pixels.shape[1:]), sampling


def _white_of(
    capture: Capture, path: Path, source: Path | None
) -> tuple[NDArray[np.uint16] | None, tuple[str, ...]]:
    """The white image to use, if there is one, and what to tell about it."""
    frame = capture.frame
    if source is None and capture.embedded_white is not None:
        return capture.embedded_white, ("vignetting by the white image in the same file",)
    beside = path.parent / BESIDE
    if source is None and not beside.is_dir():
        return None, (_ESTIMATED.format("no white image is known (--white gives the camera's)"),)
    try:
        white = choose_white(find_whites(source or beside), frame, source or beside)
    except InputError as error:
        if source is not None:
            raise
        return None, (_ESTIMATED.format(error),)
    zoom, focus = white.frame.zoom_step - frame.zoom_step, white.frame.focus_step - frame.focus_step
    whose = "" if white.frame.serial else "; it does not say of which camera"
    off = f" ({zoom:+d} zoom and {focus:+d} focus steps off)" if zoom or focus else ""
    return white.read(), (f"vignetting by the white image {white.frame.where}{off}{whose}",)


def _notes(frame: Frame, sampling: Sampling) -> tuple[str, ...]:
    grid = sampling.grid
    serial = "unknown" if frame.serial is None else frame.serial
    notes = [
        f"raw capture of a Lytro {frame.model}, serial number {serial}",
        f"lenslets {grid.pitch_px:.3f} px apart, turned by {math.degrees(grid.rotation):.3f} "
        f"degrees, off their grid by {grid.scatter_px:.2f} px; adjacent views look "
        f"{sampling.step_px:.2f} px apart through them",
    ]
    if camera_of(frame, sampling) is None:
        notes.append("focused at infinity or beyond, or unknown: no metric depth by the metadata")
    else:
        notes.append("the camera is nominal, by a thin lens and the metadata: calibrate for depth")
    return tuple(notes)
