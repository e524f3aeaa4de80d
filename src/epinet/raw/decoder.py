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
from epinet.raw.interpolate import sample_lenslets
from epinet.raw.lenslets import fit_grid
from epinet.raw.optics import camera_of
from epinet.raw.views import Sampling, SquarePixels, plan_sampling
from epinet.raw.vignetting import measured_falloff
from epinet.raw.white import BESIDE, choose_white, find_whites, levels, normalised_white

DEFAULT_VIEWS = 9
FEWEST_VIEWS, MOST_VIEWS = 3, 15


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
    capture = read_capture(path)
    frame = capture.frame
    chosen, notes = _white_of(capture, path, white)
    image = levels(capture.raw, frame)
    if chosen is None:
        grid = fit_grid(image, frame.pitch_px, frame.where)
        seen = image
    else:
        seen = normalised_white(levels(chosen, frame), frame)
        grid = fit_grid(seen, frame.pitch_px, f"the white image of {frame.where}")
    pattern = mosaic(frame.upper_left)
    falloff = measured_falloff(seen, grid, pattern)
    if chosen is not None:
        image /= seen
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
        devignetted=chosen is not None,
        progress=lambda share: progress(0.6 * share),
    ).reshape(*index.shape[:2], views * views, 3)
    out = np.empty((views * views, *sampling.size, 3), np.uint16)
    square = SquarePixels(sampling)
    for k in range(views * views):
        out[k] = to_srgb(square.view(np.ascontiguousarray(samples[:, :, k])), frame)
        progress(0.4 / views**2)
    return LightField(
        out.reshape(views, views, *out.shape[1:]),
        camera=camera_of(frame, sampling),
        notes=notes + _notes(capture, sampling),
    )


def _white_of(
    capture: Capture, path: Path, source: Path | None
) -> tuple[NDArray[np.uint16] | None, tuple[str, ...]]:
    """The white image to use, if there is one, and what to tell about it."""
    frame = capture.frame
    if source is None and capture.embedded_white is not None:
        return capture.embedded_white, ("vignetting by the white image in the same file",)
    beside = path.parent / BESIDE
    try:
        if source is None and not beside.is_dir():
            raise InputError("no white image is known (--white gives the camera's)")
        whites = find_whites(source or beside)
        white = choose_white(whites, frame, source or beside)
    except InputError as error:
        if source is not None:
            raise
        return None, (
            "vignetting and lenslets are estimated from the picture itself, so brightness and "
            f"disparity are less exact, as {error}",
        )
    zoom, focus = white.frame.zoom_step - frame.zoom_step, white.frame.focus_step - frame.focus_step
    off = f" ({zoom:+d} zoom and {focus:+d} focus steps off)" if zoom or focus else ""
    return white.read(), (f"vignetting by the white image {white.frame.where}{off}",)


def _notes(capture: Capture, sampling: Sampling) -> tuple[str, ...]:
    frame, grid = capture.frame, sampling.grid
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
