"""Depth maps on disk: PFM, 16-bit PNG, float TIFF and NPZ.

| file | values | infinitely far | no disparity |
|---|---|---|---|
| .pfm | float32, mm | inf | NaN |
| .tif, .tiff | float32, mm | inf | NaN |
| .npz | `depth_mm` float32, `valid` (finite depth), `camera` (JSON) | inf | NaN |
| .png | 16 bit, value * step = mm | 65535 | 0 |

A PNG's step is stated in its text chunk `depth_step_mm`. Depths that the step cannot hold count as
infinitely far.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.camera_file import CameraFacts
from epinet.io.pfm import write_pfm

SUFFIXES = (".pfm", ".png", ".tif", ".tiff", ".npz")

PNG_FAR = 65535
"""Value of a PNG where it is infinitely far, or too far for the step."""
_HELD_PERCENTILE = 99.0
"""The step is chosen to hold at least this share of the finite depths."""
_TIFF_DESCRIPTION = 270


def check_suffix(path: Path) -> None:
    """Refuse, before any work, what cannot be written.

    Raises:
        InputError: another ending.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: depth is written as {', '.join(SUFFIXES)}, by the name's end")


def write_depth(
    path: str | Path,
    depth_mm: NDArray[np.float32],
    camera: CameraFacts,
    step_mm: float | None = None,
) -> str:
    """Write depth (H, W), by the ending of the name; see the table above.

    Args:
        path: where to.
        depth_mm: along the optical axis; inf where infinitely far, NaN where unknown.
        camera: what is known of it, for the NPZ.
        step_mm: of a PNG; None takes the finest of 1, 2, 5, 10, ... (times a power of ten) that
            holds 99 percent of the finite depths.

    Returns:
        What the values mean, in words.

    Raises:
        InputError: another ending, a step for another file than PNG or not positive, or an
            unwritable path.
    """
    path = Path(path)
    check_suffix(path)
    suffix = path.suffix.lower()
    if step_mm is not None and suffix != ".png":
        raise InputError(f"{path}: a step is for 16-bit PNG; other files hold mm as they are")
    if step_mm is not None and not 0 < step_mm < np.inf:
        raise InputError(f"{path}: the step must be more than 0 mm, not {step_mm}")
    if suffix == ".png":
        return _write_png(path, depth_mm, step_mm or fitting_step_mm(depth_mm))
    if suffix == ".pfm":
        write_pfm(path, depth_mm)
    elif suffix == ".npz":
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                depth_mm=depth_mm,
                valid=np.isfinite(depth_mm),
                camera=camera.as_json(),
            )
    else:
        about = {_TIFF_DESCRIPTION: "depth in mm along the optical axis; inf: far, NaN: unknown"}
        with atomic_path(path) as temporary:
            Image.fromarray(depth_mm.astype(np.float32)).save(temporary, tiffinfo=about)
    return "values in mm, inf where infinitely far, NaN where unknown"


def fitting_step_mm(depth_mm: NDArray[np.float32]) -> float:
    """The finest step of 1, 2 or 5 times a power of ten that holds the depths in 16 bits.

    Example:
        >>> fitting_step_mm(np.float32([900, 2900]))
        0.05
    """
    finite = depth_mm[np.isfinite(depth_mm)]
    largest = float(np.percentile(finite, _HELD_PERCENTILE)) if finite.size else 1.0
    needed = largest / (PNG_FAR - 1)
    power = 10.0 ** np.floor(np.log10(needed))
    step = next(factor for factor in (1, 2, 5, 10) if factor * power >= needed) * power
    return float(np.format_float_positional(step, precision=3, fractional=False))


def _write_png(path: Path, depth_mm: NDArray[np.float32], step_mm: float) -> str:
    steps = np.clip(np.nan_to_num(depth_mm, nan=0.0, posinf=np.inf) / step_mm, 0, PNG_FAR)
    values = np.where(np.isnan(depth_mm), 0, np.maximum(np.round(steps), 1)).astype(np.uint16)
    meaning = f"value * {step_mm:g} = mm; 65535: infinite or too far, 0: unknown"
    text = PngInfo()
    text.add_text("depth_step_mm", f"{step_mm:g}")
    text.add_text("Description", f"depth along the optical axis: {meaning}")
    with atomic_path(path) as temporary:
        Image.fromarray(values).save(temporary, pnginfo=text)
    return meaning
