"""White images: taken through a diffuser at the factory, they show the lenslets' vignetting.

A camera has many, one for each of several zoom and focus settings. The nearest is taken as the
Light Field Toolbox does: the same camera, then the nearest zoom, then the nearest focus.
"""

from __future__ import annotations

import os
import tarfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from epinet import documents
from epinet.documents import short
from epinet.errors import InputError
from epinet.raw.bayer import Image, planes
from epinet.raw.capture import frame_of_document, unpack_frame
from epinet.raw.container import is_container, parse_json, read_container
from epinet.raw.metadata import CHANNELS, Frame
from epinet.reading import open_regular, read_bytes

BESIDE = "white"
"""A folder of this name beside a capture is searched for white images."""

_MOST_VOLUMES = 100
_FIRST_VOLUME = "data.c.0"
_METADATA_SUFFIXES = (".txt", ".json")
_BRIGHTEST_PERCENTILE = 99.0
_DARKEST = 0.02
_DARK_MEAN = 0.03
"""White images with a mean below this share of the white level show too little: the factory took
dark ones of the F01, too."""


@dataclass(frozen=True)
class White:
    """A white image that there is, not read yet."""

    frame: Frame
    load: Callable[[], bytes]
    """Reads its packed pixels."""

    def read(self) -> NDArray[np.uint16]:
        """(H, W) pixels.

        Raises:
            InputError: it is cut off.
        """
        return unpack_frame(self.frame, self.load())


def find_whites(source: Path) -> list[White]:
    """White images of a folder and all below it, a .tar, a data.C.0 or one .RAW file.

    Raises:
        InputError: there is none, or one is damaged.
    """
    if not source.exists():
        raise InputError(f"{source}: no such file or folder of white images")
    files = dict(_files(source))
    by_stem: dict[str, Callable[[], bytes]] = {}
    for name, load in files.items():
        if name.lower().endswith(_METADATA_SUFFIXES):
            by_stem.setdefault(_stem(name), load)
    whites = []
    for name, load in files.items():
        if name.lower().endswith(".raw") and _stem(name) in by_stem:
            where = f"{source}: {name}" if name != str(source) else name
            document = parse_json(by_stem[_stem(name)](), f"{where}, its metadata")
            whites.append(White(frame_of_document(document, where), load))
    if not whites:
        raise InputError(
            f"{source}: no white image in it (MOD_0000.RAW with MOD_0000.TXT and so on); give the "
            "camera's calibration data: the folder, the caldata-....tar of an Illum or the "
            "data.C.0 of an F01"
        )
    return whites


def choose_white(whites: list[White], capture: Frame, source: Path) -> White:
    """The white image nearest in zoom, then in focus, of the camera that took the capture.

    Of equal settings the longest exposure is taken.

    Raises:
        InputError: all are of other cameras or sizes.
    """
    fitting = [w for w in whites if w.frame.serial == capture.serial or capture.serial is None]
    if not fitting:
        serials = ", ".join(sorted({str(w.frame.serial) for w in whites}))
        raise InputError(
            f"{source}: white images of another camera (serial number {serials}); {capture.where} "
            f"was taken with {capture.serial}. Give that camera's, or none to estimate the "
            "vignetting from the picture"
        )
    same_size = [w for w in fitting if w.frame.size == capture.size]
    if not same_size:
        height, width = fitting[0].frame.size
        raise InputError(
            f"{source}: white images of {width}x{height} px; {capture.where} has "
            f"{capture.size[1]}x{capture.size[0]}"
        )
    return min(
        same_size,
        key=lambda w: (
            abs(w.frame.zoom_step - capture.zoom_step),
            abs(w.frame.focus_step - capture.focus_step),
            -w.frame.exposure_s,
        ),
    )


def levels(raw: NDArray[np.uint16], frame: Frame) -> Image:
    """(H, W) raw pixels with black at 0 and the sensor's white at 1."""
    image = raw.astype(np.float32)
    for channel, plane in _channels(image, frame):
        black = frame.black[channel]
        plane -= np.float32(black)
        plane /= np.float32(frame.white[channel] - black)
    return image


def normalised_white(white: Image, frame: Frame) -> Image:
    """(H, W) vignetting from a white image: 1 where it is brightest, for each colour by itself.

    So dividing by it keeps the colours, and leaves the white balance to the metadata's gains.

    Raises:
        InputError: it is too dark.
    """
    if white.mean() < _DARK_MEAN:
        raise InputError(f"{frame.where}: a white image that is nearly black; give another one")
    white = white.copy()
    for _, plane in _channels(white, frame):
        brightest = np.percentile(plane[::4, ::4], _BRIGHTEST_PERCENTILE)
        if brightest < _DARKEST:
            raise InputError(f"{frame.where}: a white image that is nearly black in one colour")
        plane /= brightest
    return np.maximum(white, np.float32(_DARKEST), out=white)


def _channels(image: Image, frame: Frame) -> Iterator[tuple[str, Image]]:
    """The mosaic's four parts by channel."""
    start = CHANNELS.index(frame.upper_left)
    flipped_y, flipped_x = start // 2, start % 2
    for y, row in enumerate(planes(image)):
        for x, plane in enumerate(row):
            yield CHANNELS[2 * (y ^ flipped_y) + (x ^ flipped_x)], plane


def _files(source: Path) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Names, and functions that read them, of the files in a source of calibration data."""
    if source.is_dir():
        for file in sorted(source.rglob("*")):
            name = str(file.relative_to(source))
            if file.name.startswith(".") or not file.is_file():
                continue
            if file.suffix.lower() == ".tar" or file.name.lower() == _FIRST_VOLUME:
                yield from ((f"{name}/{inner}", load) for inner, load in _files(file))
            else:
                yield name, partial(read_bytes, file)
    elif source.suffix.lower() == ".tar":
        yield from _files_of_tar(source)
    elif is_container(source):
        yield from _files_of_archive(source)
    else:
        for file in sorted(source.parent.glob(f"{source.stem}.*")):
            yield str(file), partial(read_bytes, file)


def _files_of_tar(source: Path) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Files of a .tar that is not compressed: each a part of it, so that none is larger."""
    try:
        with open_regular(source) as file, tarfile.open(fileobj=file, mode="r:") as archive:
            size = os.fstat(file.fileno()).st_size
            members = [m for m in archive if m.isfile() and not m.issparse()]
    except (tarfile.TarError, ValueError, OverflowError) as error:
        raise InputError(f"{source}: not a readable .tar ({error}); copy it again") from error
    for member in members:
        if not 0 <= member.offset_data <= member.offset_data + member.size <= size:
            raise InputError(f"{source}: {short(member.name)} is cut off; copy it again")
        yield member.name, partial(_part, source, member.offset_data, member.size)


def _part(source: Path, offset: int, size: int) -> bytes:
    with open_regular(source) as file:
        file.seek(offset)
        return file.read(size)


class _File(BaseModel):
    """An entry of the table of contents of data.C.0."""

    name: str
    dataRef: str | None = None  # noqa: N815 (as the camera writes it)


class _Volume(BaseModel):
    """What is read of such a table."""

    files: list[_File] = []
    nextFile: str | None = None  # noqa: N815


def _files_of_archive(
    source: Path, before: frozenset[Path] = frozenset()
) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Files of data.C.0 and the volumes that follow it, as an F01's are backed up."""
    container = read_container(source)
    volume = documents.validated(_Volume, container.contents, f"{source}, its table of contents")
    for entry in volume.files:
        if entry.dataRef is not None and entry.dataRef in container:
            name = entry.name.removeprefix("C:\\").replace("\\", "/")
            yield name, partial(container.section, entry.dataRef)
    if not volume.nextFile:
        return
    following = source.parent / PureWindowsPath(volume.nextFile).name  # beside it, whatever it says
    if following in before | {source} or len(before) > _MOST_VOLUMES:
        raise InputError(f"{source}: names {following.name} as its next volume, which came before")
    if following.is_file():
        yield from _files_of_archive(following, before | {source})


def _stem(name: str) -> str:
    path = PurePosixPath(name)
    return str(path.parent / path.stem).lower()
