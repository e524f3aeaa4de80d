"""Layout `eslf`: one image with 14 x 14 pixels per lenslet (Stanford Lytro archive).

Pixel [14 * y + row, 14 * x + col] is pixel (x, y) of view (row, col). The outer views are dark
(vignetting), so the 9 x 9 around view (7, 7) are kept.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from epinet.errors import InputError
from epinet.io.array import present_views
from epinet.io.images import IMAGE_SUFFIXES, read_image, write_png
from epinet.io.layout import Layout
from epinet.lightfield import LightField

_LENSLET_PX = 14
_FIRST, _KEPT = 3, 9
_SPARE_ROWS = _LENSLET_PX - _FIRST - _KEPT


def recognises(path: Path) -> bool:
    """Whether it is an image."""
    return path.suffix.lower() in IMAGE_SUFFIXES


def read(path: Path) -> LightField:
    """Read the 9 x 9 views around view (7, 7).

    A height up to two rows short of a multiple of 14 (the archive has such) is padded by repeating
    the last row; that touches none of the views kept.

    Raises:
        InputError: not an image, or one whose size does not fit.
    """
    image = read_image(path)
    height, width = image.shape[:2]
    short = -height % _LENSLET_PX
    if width % _LENSLET_PX or short > _SPARE_ROWS:
        raise InputError(
            f"{path}: one image of {width}x{height} px; an ESLF image holds 14x14 pixels per "
            "lenslet, so both are multiples of 14. For views in separate files give their folder"
        )
    image = np.pad(image, ((0, short), (0, 0), (0, 0)), mode="edge")
    lenslets = image.reshape(-1, _LENSLET_PX, width // _LENSLET_PX, _LENSLET_PX, image.shape[2])
    kept = slice(_FIRST, _FIRST + _KEPT)
    views = np.ascontiguousarray(lenslets[:, kept, :, kept].transpose(1, 3, 0, 2, 4))
    return LightField(
        views,
        present_views(views),
        grid_origin=(_FIRST, _FIRST),
        notes=("of 14x14 views the 9x9 around (7, 7) are kept, the outer ones being dark",),
    )


def write(path: Path, lf: LightField) -> None:
    """Write a 9 x 9 grid as views 3 to 11 of 14 x 14, the others black.

    Raises:
        InputError: another grid, or float views.
    """
    if lf.grid != (_KEPT, _KEPT):
        raise InputError(f"the layout eslf takes 9x9 views, not {lf.grid[0]}x{lf.grid[1]}")
    if lf.views.dtype == np.float32:
        raise InputError("images hold 8 or 16 bits, not float views; use the layout `array`")
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
