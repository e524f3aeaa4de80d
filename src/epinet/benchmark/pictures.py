"""Pictures of maps and errors in the benchmark's colours, small enough to stand inside a page."""

from __future__ import annotations

import base64
import io
from typing import Any, Literal

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image

from epinet.predict.pictures import COLOUR_MAP, robust_range

Rgb = NDArray[np.uint8]
"""(H, W, 3)"""

ERROR_LIMIT_PX = 0.2
"""Where the benchmark's signed error saturates."""

ERROR_COLOURS, BADPIX_COLOURS = "seismic", "RdYlGn_r"
GOOD, BAD = 0.2, 1.0
"""Places of good and bad pixels in the benchmark's colours."""
MISSING = (255, 0, 255)
"""Where a method has no estimate."""


def disparity_picture(map_: NDArray[Any], bounds_px: tuple[float, float]) -> Rgb:
    """A map (H, W) between two disparities; missing pixels are magenta."""
    low, high = bounds_px
    return _coloured((map_ - low) / (high - low), COLOUR_MAP)


def error_picture(map_: NDArray[Any], truth: NDArray[Any]) -> Rgb:
    """White is right, red too far, blue too near; gray without truth."""
    share = (truth - map_) / (2 * ERROR_LIMIT_PX) + 0.5
    picture = _coloured(share, ERROR_COLOURS)
    picture[~np.isfinite(truth)] = 160
    return picture


def badpix_picture(
    map_: NDArray[Any], truth: NDArray[Any], threshold_px: float, border: int
) -> Rgb:
    """Green is good, red bad or missing; what is not scored shows the map in gray."""
    bad = ~(np.abs(map_ - truth.astype(np.float64)) <= threshold_px)
    picture = _coloured(np.where(bad, BAD, GOOD), BADPIX_COLOURS)
    outside = ~np.isfinite(truth)
    if border:
        outside[:border] = outside[-border:] = True
        outside[:, :border] = outside[:, -border:] = True
    low, high = robust_range(map_)
    gray = _coloured(np.nan_to_num((map_ - low) / (high - low), nan=0.6), "gray")
    picture[outside] = gray[outside]
    return picture


def colour(name: str, share: float) -> str:
    """A colour of a scale, for a page."""
    return "#" + "".join(f"{round(255 * c):02x}" for c in colormaps[name](share)[:3])


def gradient(name: str) -> str:
    """A scale from left to right, for a page."""
    stops = ", ".join(colour(name, share) for share in np.linspace(0, 1, 9))
    return f"linear-gradient(to right, {stops})"


Kind = Literal["photograph", "map", "classes"]


def data_uri(picture: Rgb, side_px: int, kind: Kind = "map") -> str:
    """A PNG as text, its longer side at most `side_px`.

    Args:
        kind: colours are few but of a photograph; those of classes stay exact, and do not mix.
    """
    image = Image.fromarray(np.ascontiguousarray(picture))
    classes = kind == "classes"
    image.thumbnail(
        (side_px, side_px), Image.Resampling.NEAREST if classes else Image.Resampling.BOX
    )
    if not classes:
        image = image.quantize(256 if kind == "photograph" else 64, dither=Image.Dither.NONE)
    out = io.BytesIO()
    image.save(out, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode("ascii")


def _coloured(share: NDArray[Any], name: str) -> Rgb:
    known = np.isfinite(share)
    picture = np.round(255 * colormaps[name](np.where(known, share, 0))[..., :3]).astype(np.uint8)
    picture[~known] = MISSING
    return picture
