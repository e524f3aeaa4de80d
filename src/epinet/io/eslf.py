"""Layout `eslf`: one image with 14 x 14 pixels per lenslet (Stanford Lytro archive).

Pixel [14 * y + row, 14 * x + col] is pixel (x, y) of view (row, col). The outer views are dark
(vignetting), so the 9 x 9 around view (7, 7) are kept.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.io.array import present_views
from epinet.io.images import IMAGE_SUFFIXES, check_samples, read_image, write_png
from epinet.io.layout import Layout
from epinet.lightfield import LightField

_LENSLET_PX = 14
_FIRST, _KEPT = 3, 9


def recognises(path: Path) -> bool:
    """Whether it is an image."""
    return path.suffix.lower() in IMAGE_SUFFIXES


def read(path: Path) -> LightField:
    """Read the 9 x 9 views around view (7, 7).

    A size that is no multiple of 14 is padded up to one by repeating the edge.

    Raises:
        InputError: not an image, or one whose outer views are not dark: an ordinary photograph.
    """
    image = read_image(path)
    height, width = image.shape[:2]
    padding = [(0, -height % _LENSLET_PX), (0, -width % _LENSLET_PX), (0, 0)]
    image = np.pad(image, padding, mode="edge")
    rows, cols = image.shape[0] // _LENSLET_PX, image.shape[1] // _LENSLET_PX
    lenslets = image.reshape(rows, _LENSLET_PX, cols, _LENSLET_PX, image.shape[2])
    if not _has_dark_border(lenslets):
        raise InputError(
            f"{path}: one image of {width}x{height} px; an ESLF image holds 14x14 pixels per "
            "lenslet, the outer ones of which are dark; these are not. "
            "For views in separate files give their folder"
        )
    kept = slice(_FIRST, _FIRST + _KEPT)
    views = np.ascontiguousarray(lenslets[:, kept, :, kept].transpose(1, 3, 0, 2, 4))
    return LightField(
        views,
        present_views(views),
        grid_origin=(_FIRST, _FIRST),
        notes=("of 14x14 views the 9x9 around (7, 7) are kept, the outer ones being dark",),
    )


def _has_dark_border(lenslets: NDArray[Any]) -> bool:
    """Whether the corner view is dark, as a lenslet's is; a photograph's is like all others."""
    middle = _LENSLET_PX // 2
    corner, centre = lenslets[:, 0, :, 0].mean(), lenslets[:, middle, :, middle].mean()
    return bool(corner < 0.5 * centre)


def write(path: Path, lf: LightField) -> None:
    """Write a 9 x 9 grid as views 3 to 11 of 14 x 14, the others black.

    Raises:
        InputError: another grid, or float views.
    """
    if lf.grid != (_KEPT, _KEPT):
        raise InputError(f"the layout eslf takes 9x9 views, not {lf.grid[0]}x{lf.grid[1]}")
    check_samples(lf.views)
    (height, width), channels = lf.size, lf.views.shape[4]
    lenslets = np.zeros((height, _LENSLET_PX, width, _LENSLET_PX, channels), lf.views.dtype)
    kept = slice(_FIRST, _FIRST + _KEPT)
    lenslets[:, kept, :, kept] = lf.views.transpose(2, 0, 3, 1, 4)
    write_png(path, lenslets.reshape(height * _LENSLET_PX, width * _LENSLET_PX, channels))


LAYOUT = Layout(
    name="eslf",
    description="one image with 14x14 pixels per lenslet (Stanford Lytro archive)",
    recognises=recognises,
    read=read,
    write=write,
    suffixes=(".png",),
)
