"""A short film that moves from view to view and back, so that a flat screen shows depth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from epinet.effects.sampling import sampled
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.lightfield import LightField

SUFFIXES = (".gif", ".mp4")


def wiggle_frames(lf: LightField, still_px: float) -> list[NDArray[np.uint8]]:
    """Frames (h, w, 3) along the centre row of views to the right and back, for an endless loop.

    The views are shifted so that what has the disparity `still_px` stays where it is, and cut to
    the part that all of them show.

    Raises:
        InputError: fewer than two views stand in that row, or they have no part in common.
    """
    row, middle = lf.centre
    cols = np.flatnonzero(lf.present[row])
    if len(cols) < 2:
        raise InputError("a wiggle needs two views or more in the centre row")
    height, width = lf.size
    shifts = still_px * (cols - middle)
    left, right = (int(np.ceil(max(0.0, s))) for s in (shifts.max(), -shifts.min()))
    if left + right >= width:
        raise InputError(
            f"held still at a disparity of {still_px:g} px, the views have no part in common; "
            "choose a disparity of the scene (--disparity)"
        )
    y, x = np.mgrid[:height, left : width - right]
    there = []
    for col, shift in zip(cols, shifts, strict=True):
        cut = sampled(lf.rgb(row, int(col)), x - shift, y)
        there.append(np.round(255 * np.clip(cut, 0, 1)).astype(np.uint8))
    return [*there, *there[-2:0:-1]]


def check_suffix(path: Path) -> None:
    """Refuse, before any work, what cannot be written.

    Raises:
        InputError: another ending, or MP4 where OpenCV is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a wiggle is written as {' or '.join(SUFFIXES)}")
    if path.suffix.lower() == ".mp4":
        try:
            import cv2  # noqa: F401
        except ImportError as error:
            raise InputError(
                f"{path}: MP4 is written by OpenCV, which is not installed: "
                "pip install 'epinet[mp4]', or take .gif"
            ) from error


def write_film(path: str | Path, frames: Sequence[NDArray[np.uint8]], per_second: float) -> None:
    """Write frames as an endless GIF, or once as MP4 (MPEG-4 part 2), by the name's ending.

    Raises:
        InputError: another ending, MP4 without OpenCV or its encoder, or an unwritable path.
    """
    path = Path(path)
    check_suffix(path)
    with atomic_path(path) as temporary:
        if path.suffix.lower() == ".gif":
            first, *rest = (Image.fromarray(frame) for frame in frames)
            first.save(
                temporary, save_all=True, append_images=rest, duration=1000 / per_second, loop=0
            )
        else:
            _write_mp4(path, temporary, frames, per_second)


def _write_mp4(
    path: Path, temporary: Path, frames: Sequence[NDArray[np.uint8]], per_second: float
) -> None:
    import cv2

    height, width = (side // 2 * 2 for side in frames[0].shape[:2])  # the format wants them even
    code = cv2.VideoWriter.fourcc(*"mp4v")
    film = cv2.VideoWriter(str(temporary), code, per_second, (width, height))
    if not film.isOpened():
        raise InputError(f"{path}: this OpenCV cannot write MP4; take .gif")
    for frame in frames:
        film.write(np.ascontiguousarray(frame[:height, :width, ::-1]))
    film.release()
