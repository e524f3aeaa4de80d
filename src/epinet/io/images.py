"""Images: read completely or refused, and written without loss."""

from __future__ import annotations

import io
import struct
import sys
import zlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.names import is_shown
from epinet.io.pnm import decode_pnm, is_pnm
from epinet.io.problems import listed, parsing
from epinet.reading import check_allowed, check_decoded, open_regular, read_bytes, stored_bytes

IMAGE_SUFFIXES = frozenset(
    {".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".tif", ".tiff", ".bmp", ".webp"}
    | {".ppm", ".pgm", ".pnm"}
)

_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP")
"""What is decoded, whatever its ending: Pillow knows others, some of which run programs."""

_PNG_BEGINS, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
_PNG_UNUSED = frozenset({b"tEXt", b"zTXt", b"iTXt", b"iCCP"})
"""Texts and colour profiles: never used, and some are larger than Pillow takes."""
_TIFF_SUBFILE, _TIFF_BITS_PER_SAMPLE, _TIFF_PHOTOMETRIC = 254, 258, 262
_TIFF_PLANAR_CONFIGURATION = 284
_TIFF_REDUCED = 1
"""Flag of a page that is a smaller version of another."""
_MOST_PAGES = 64
_RAW_MODES_OF_16 = {
    "LA;16": "RGBA",
    "RGB;16": "RGB;16{}",
    "RGBA;16": "RGBA;16{}",
    "RGBa;16": "RGBA;16{}",
    "RGBX;16": "RGBX;16{}",
}
"""How Pillow is told to take samples of 16 bits, by how it would take them itself; both names are
followed by the byte order."""
_WHITE_IS_ZERO = 0
_ORIENTATION = 274
_TURNS: dict[int, tuple[bool, int]] = {
    2: (True, 0),
    3: (False, 2),
    4: (True, 2),
    5: (True, 1),
    6: (False, 3),
    7: (True, 3),
    8: (False, 1),
}
"""Mirrored left to right first?, then how many quarter turns counter-clockwise, by orientation."""


def image_files(folder: Path) -> list[Path]:
    """The image files of a folder by suffix, sorted by name; hidden ones are left out."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGE_SUFFIXES and is_shown(file)
    )


def image_size(path: Path) -> tuple[int, int] | None:
    """(width, height) by the beginning of an image file; None where it tells none."""
    try:
        with open_regular(path) as file:
            return Image.open(file, formats=(*_FORMATS, "PPM")).size
    except Exception:  # a damaged file makes Pillow raise anything
        return None


def read_image(path: str | Path) -> NDArray[Any]:
    """Read an image as (H, W, C): uint8 or uint16, C = 1 (gray) or 3 (RGB), alpha dropped.

    Reads what Pillow reads, turned upright as its EXIF says; 16 bits per sample are kept in PNG,
    TIFF, PGM and PPM.

    Raises:
        InputError: the file is missing, truncated, damaged, holds several pages or another sort of
            pixel.
    """
    path = Path(path)
    with parsing(path, "an image"):
        data = read_bytes(path)
        if is_pnm(data):
            return decode_pnm(path, data)
        image = _intact(path, data)
        return _upright(_pixels(path, image, data), image)


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """Read a mask as (H, W): alpha > 0 where the image has alpha, else any value > 0.

    Raises:
        InputError: as `read_image`.
    """
    path = Path(path)
    with parsing(path, "an image"):
        image = _intact(path, read_bytes(path))
        if image.has_transparency_data:
            return _upright(np.asarray(image.convert("RGBA"))[..., 3] > 0, image)
        pixels = np.asarray(image.convert("RGB") if image.mode == "P" else image)
        mask = pixels > 0
        return _upright(np.asarray(mask.any(axis=2) if mask.ndim == 3 else mask), image)


def check_samples(views: NDArray[Any]) -> None:
    """Refuse views that no image can hold.

    Raises:
        InputError: they are float.
    """
    if views.dtype == np.float32:
        raise InputError(
            "images hold 8 or 16 bits, not float views; write .npz, .h5 or .mat instead"
        )


def write_png(path: str | Path, image: NDArray[Any]) -> None:
    """Write (H, W), (H, W, 1) or (H, W, 3) uint8 or uint16 pixels as PNG, without loss.

    Raises:
        InputError: another shape or type of array, or an unwritable path.
    """
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3) or image.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"{path}: a PNG holds (H, W) or (H, W, 3) values of 8 or 16 bits, "
            f"not {image.shape} {image.dtype}"
        )
    with atomic_path(path) as temporary:
        temporary.write_bytes(_encode_png(image))


def _encode_png(image: NDArray[Any]) -> bytes:
    """The bytes of a PNG of (H, W, 1 or 3) uint8 or uint16 samples; Pillow writes no 16-bit colour.

    Each row is stored less the one above (filter 2, "Up").
    """
    height, width, channels = image.shape
    rows = np.ascontiguousarray(image.astype(image.dtype.newbyteorder(">"))).view(np.uint8)
    rows = rows.reshape(height, -1)
    filtered = np.full((height, 1 + rows.shape[1]), 2, np.uint8)
    filtered[0, 1:], filtered[1:, 1:] = rows[0], rows[1:] - rows[:-1]
    colour_type = {1: 0, 3: 2}[channels]
    header = struct.pack(">IIBBBBB", width, height, 8 * image.itemsize, colour_type, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(filtered.tobytes(), 3), b"IEND": b""}
    return _PNG_BEGINS + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks.items()
    )


def _intact(path: Path, data: bytes) -> Image.Image:
    """Decode fully; `verify` first, as only it checks the sums of a PNG."""
    Image.init()  # Pillow loads few formats by itself
    data = _without_unused(data)
    try:
        image = Image.open(io.BytesIO(data), formats=_FORMATS)
        check_decoded(path, decoded_bytes(image), "the image")
        image.verify()
    except UnidentifiedImageError as error:
        raise InputError(f"{path}: not an image, or its beginning is damaged") from error
    except Image.DecompressionBombError as error:
        raise InputError(
            f"{path}: too large for one image ({error}); a folder of one image per view, or an "
            ".npz or .h5 file, may hold as much"
        ) from error
    image = Image.open(io.BytesIO(data), formats=_FORMATS)
    _check_pages(path, image)
    image.load()
    if image.format == "PNG" and _PNG_END not in data:
        raise InputError(f"{path}: the end of the file is missing; copy or download it again")
    return image


def decoded_bytes(image: Image.Image) -> int:
    """An upper bound of what an image takes in memory, by its header."""
    wide = image.mode.startswith(("I", "F")) or image.mode in ("RGB", "RGBA")  # or 16 bits a sample
    return image.width * image.height * len(image.getbands()) * (2 if wide else 1)


def check_decoded_images(folder: Path, files: Iterable[Path]) -> None:
    """Refuse images of a folder that together would take more memory than they may.

    Raises:
        InputError: they would, or one is no regular file.
    """
    Image.init()
    needed = on_disk = 0
    for file in files:
        with parsing(file, "an image"), open_regular(file) as opened:
            on_disk += stored_bytes(file)
            with suppress(UnidentifiedImageError, Image.DecompressionBombError):  # said later
                needed += decoded_bytes(_opened(file, opened))
    check_allowed(folder, needed, on_disk, "its images")


def _opened(path: Path, file: BinaryIO) -> Image.Image:
    """An image whose header alone is read, unless its texts are more than Pillow takes."""
    try:
        return Image.open(file, formats=_FORMATS)
    except ValueError:
        return Image.open(io.BytesIO(_without_unused(read_bytes(path))), formats=_FORMATS)


def _without_unused(data: bytes) -> bytes:
    """A PNG less the chunks that are never used; anything else as it is."""
    if not data.startswith(_PNG_BEGINS):
        return data
    kept, here = [data[:8]], 8
    while here < len(data):
        end = here + 12 + int.from_bytes(data[here : here + 4], "big")
        if data[here + 4 : here + 8] not in _PNG_UNUSED:
            kept.append(data[here:end])
        here = end
    return b"".join(kept)


def _check_pages(path: Path, image: Image.Image) -> None:
    """Refuse several pages, unless all but the first are smaller versions of it.

    A camera's JPEG may hold others behind the picture (its format is MPO): viewers pass over them.
    """
    count = getattr(image, "n_frames", 1)
    if count == 1 or image.format == "MPO":
        return
    sizes, reduced = [], []
    for page in range(min(count, _MOST_PAGES)):
        image.seek(page)
        sizes.append("{}x{}".format(*image.size))
        reduced.append(getattr(image, "tag_v2", {}).get(_TIFF_SUBFILE, 0) & _TIFF_REDUCED)
    image.seek(0)
    if reduced[0] or not all(reduced[1:]) or count > _MOST_PAGES:
        raise InputError(
            f"{path}: {count} pages ({listed(list(dict.fromkeys(sizes)), 4)} px), and any of them "
            "may be meant; save each as an image of its own"
        )


def _upright(pixels: NDArray[Any], image: Image.Image) -> NDArray[Any]:
    """Turned as the EXIF says; Pillow and OpenCV have done so where it is a TIFF."""
    mirrored, turns = _TURNS.get(image.getexif().get(_ORIENTATION, 1), (False, 0))
    return np.ascontiguousarray(np.rot90(pixels[:, ::-1] if mirrored else pixels, turns))


def _pixels(path: Path, image: Image.Image, data: bytes) -> NDArray[Any]:
    """(H, W, C) as stored."""
    if image.mode.startswith("I;16"):
        pixels = np.asarray(image).astype(np.uint16)[..., None]
        inverted = getattr(image, "tag_v2", {}).get(_TIFF_PHOTOMETRIC) == _WHITE_IS_ZERO
        return ~pixels if inverted else pixels  # Pillow inverts those of 8 bits itself
    if image.mode in ("I", "F"):
        raise InputError(f"{path}: 32 bits per pixel; 8 or 16 bit images are needed")
    gray = image.mode in ("1", "L", "LA", "La")
    if _bits_per_sample(image, data) == 16:
        return _decode_16_bit(path, image, data)
    pixels = np.asarray(image.convert("L" if gray else "RGB"))
    return pixels[..., None] if gray else pixels


def _bits_per_sample(image: Image.Image, data: bytes) -> int:
    if image.format == "PNG":
        return data[24]
    bits: Sequence[int] = getattr(image, "tag_v2", {}).get(_TIFF_BITS_PER_SAMPLE, (8,))
    return max(bits)


def _decode_16_bit(path: Path, image: Image.Image, data: bytes) -> NDArray[np.uint16]:
    """(H, W, 1 or 3) samples of 16 bits, of which Pillow keeps one byte in colour images.

    Which byte it keeps depends on the byte order that it is told: the first of each sample where
    that is big-endian, the second where it is little-endian. Decoding twice gives both.
    """
    if getattr(image, "tag_v2", {}).get(_TIFF_PLANAR_CONFIGURATION) == 2:
        raise InputError(f"{path}: colours lie in separate planes; save it as PNG")
    first, raw_mode = _bytes_of_16(path, data, "B")
    if raw_mode == "LA;16B":  # both bytes of both samples, as they lie
        high, low = first[..., :1], first[..., 1:2]
    else:
        second, _ = _bytes_of_16(path, data, "L")
        is_big = raw_mode[-1] == "B" or (raw_mode[-1] == "N" and sys.byteorder == "big")
        high, low = (first, second) if is_big else (second, first)
    return np.asarray(high[..., :3].astype(np.uint16) << 8 | low[..., :3], np.uint16)


def _bytes_of_16(path: Path, data: bytes, order: str) -> tuple[NDArray[np.uint8], str]:
    """(H, W, C) bytes that Pillow keeps of samples of 16 bits when it is told a byte order, "B" or
    "L"; and its own name of how the samples lie, which ends in their byte order: "N" is the
    machine's, into which libtiff brings them."""
    image: Any = Image.open(io.BytesIO(_without_unused(data)), formats=_FORMATS)
    in_png = image.format == "PNG"
    raw_modes = {tile.args if in_png else tile.args[0] for tile in image.tile}
    raw_mode = raw_modes.pop()
    if raw_modes or raw_mode[:-1] not in _RAW_MODES_OF_16:
        raise InputError(f"{path}: this kind of 16-bit image cannot be read; save it as PNG")
    told = _RAW_MODES_OF_16[raw_mode[:-1]].format(order)
    image.tile = [
        tile._replace(args=told if in_png else (told, *tile.args[1:])) for tile in image.tile
    ]
    return np.asarray(image), raw_mode
