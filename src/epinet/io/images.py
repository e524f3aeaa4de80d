"""Images: read completely or refused, and written without loss."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.names import is_shown
from epinet.io.problems import parsing
from epinet.reading import check_allowed, check_decoded, open_regular, read_bytes, stored_bytes

IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"})

_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP")
"""What is decoded, whatever its ending: Pillow knows others, some of which run programs."""

_PNG_END = b"IEND\xaeB`\x82"
_TIFF_BITS_PER_SAMPLE, _TIFF_PLANAR_CONFIGURATION = 258, 284


def image_files(folder: Path) -> list[Path]:
    """The image files of a folder by suffix, sorted by name; hidden ones are left out."""
    return sorted(
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGE_SUFFIXES and is_shown(file)
    )


def read_image(path: str | Path) -> NDArray[Any]:
    """Read an image as (H, W, C): uint8 or uint16, C = 1 (gray) or 3 (RGB), alpha dropped.

    Reads what Pillow reads; 16 bits per sample are kept in PNG and TIFF.

    Raises:
        InputError: the file is missing, truncated, damaged or holds another sort of pixel.
    """
    path = Path(path)
    with parsing(path, "an image"):
        data = read_bytes(path)
        image = _intact(path, data)
        if image.mode.startswith("I;16"):
            return np.asarray(image).astype(np.uint16)[..., None]
        if image.mode in ("I", "F"):
            raise InputError(f"{path}: 32 bits per pixel; 8 or 16 bit images are needed")
        gray = image.mode in ("1", "L", "LA", "La")
        if _bits_per_sample(image, data) == 16:
            return _decode_16_bit(path, image, data, gray)
        upright = ImageOps.exif_transpose(image)  # as every viewer shows it
        pixels = np.asarray(upright.convert("L" if gray else "RGB"))
        return pixels[..., None] if gray else pixels


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """Read a mask as (H, W): alpha > 0 where the image has alpha, else any value > 0.

    Raises:
        InputError: as `read_image`.
    """
    path = Path(path)
    with parsing(path, "an image"):
        image = _intact(path, read_bytes(path))
        if image.has_transparency_data:
            return np.asarray(image.convert("RGBA"))[..., 3] > 0
        pixels = np.asarray(image.convert("RGB") if image.mode == "P" else image)
        mask = pixels > 0
        return np.asarray(mask.any(axis=2) if mask.ndim == 3 else mask)


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
    import cv2

    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3) or image.dtype not in (np.uint8, np.uint16):
        raise InputError(
            f"{path}: a PNG holds (H, W) or (H, W, 3) values of 8 or 16 bits, "
            f"not {image.shape} {image.dtype}"
        )
    encoded = cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1]))[1]
    with atomic_path(path) as temporary:
        temporary.write_bytes(encoded.tobytes())


def _intact(path: Path, data: bytes) -> Image.Image:
    """Decode fully; `verify` first, as only it checks the sums of a PNG."""
    Image.init()  # Pillow loads few formats by itself
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
                needed += decoded_bytes(Image.open(opened, formats=_FORMATS))
    check_allowed(folder, needed, on_disk, "its images")


def _bits_per_sample(image: Image.Image, data: bytes) -> int:
    if image.format == "PNG":
        return data[24]
    bits: Sequence[int] = getattr(image, "tag_v2", {}).get(_TIFF_BITS_PER_SAMPLE, (8,))
    return max(bits)


def _decode_16_bit(path: Path, image: Image.Image, data: bytes, gray: bool) -> NDArray[np.uint16]:
    """Decode with OpenCV, because Pillow cuts 16-bit colour to 8 bits."""
    import cv2

    if getattr(image, "tag_v2", {}).get(_TIFF_PLANAR_CONFIGURATION) == 2:
        raise InputError(f"{path}: colours lie in separate planes; save it as PNG")
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.dtype != np.uint16 or pixels.ndim != 3:
        raise InputError(f"{path}: this kind of 16-bit image cannot be read; save it as PNG")
    rgb = pixels[..., 2::-1]
    return np.ascontiguousarray(rgb[..., :1] if gray else rgb)
