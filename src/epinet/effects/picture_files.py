"""Pictures as files, by the ending of the name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from epinet.errors import InputError
from epinet.io.atomic import atomic_path

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff")
_QUALITY = 95


def check_suffix(path: Path) -> None:
    """Refuse, before any work, what cannot be written.

    Raises:
        InputError: another ending.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a picture is written as {', '.join(SUFFIXES)}")


def write_picture(path: str | Path, picture: NDArray[np.uint8]) -> None:
    """Write (H, W, 3) samples.

    Raises:
        InputError: another ending, or an unwritable path.
    """
    path = Path(path)
    check_suffix(path)
    with atomic_path(path) as temporary:
        Image.fromarray(picture).save(temporary, quality=_QUALITY)
