from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from epinet.errors import InputError
from epinet.io.images import read_image, read_mask, write_png

RNG = np.random.default_rng(0)
RGB8 = RNG.integers(0, 256, (24, 30, 3), dtype=np.uint8)
RGB16 = RNG.integers(0, 65536, (24, 30, 3), dtype=np.uint16)
GRAY8, GRAY16 = RGB8[..., :1], RGB16[..., :1]


@pytest.mark.parametrize("image", [RGB8, GRAY8, RGB16, GRAY16])
def test_png_is_without_loss(tmp_path: Path, image: np.ndarray) -> None:
    write_png(tmp_path / "a.png", image)
    read = read_image(tmp_path / "a.png")
    assert read.dtype == image.dtype
    np.testing.assert_array_equal(read, image)


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp", "webp"])
@pytest.mark.parametrize("mode", ["RGB", "L", "RGBA", "LA", "P", "1"])
def test_eight_bit_kinds(tmp_path: Path, suffix: str, mode: str) -> None:
    if (suffix, mode) in {("bmp", "RGBA"), ("bmp", "LA")}:
        pytest.skip("there is no such file")
    image = Image.fromarray(RGB8).convert(mode)
    if "A" in mode:
        image.putalpha(Image.fromarray(GRAY8[..., 0]))
    options = {"lossless": True, "exact": True} if suffix == "webp" else {}
    image.save(tmp_path / f"a.{suffix}", **options)
    gray = mode in ("L", "LA", "1") and suffix != "webp"
    expected = np.asarray(image.convert("L" if mode in ("L", "LA", "1") else "RGB"))
    expected = expected[..., None] if expected.ndim == 2 else expected
    read = read_image(tmp_path / f"a.{suffix}")
    assert read.dtype == np.uint8
    np.testing.assert_array_equal(read, expected if gray else np.broadcast_to(expected, RGB8.shape))


def test_jpeg(tmp_path: Path) -> None:
    flat = np.full((24, 30, 3), (200, 100, 50), np.uint8)
    Image.fromarray(flat).save(tmp_path / "a.jpg", quality=100)
    assert np.abs(read_image(tmp_path / "a.jpg").astype(int) - flat).max() <= 3


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("image", [RGB16, np.dstack([RGB16, GRAY16]), GRAY16])
def test_sixteen_bit_kinds(tmp_path: Path, suffix: str, image: np.ndarray) -> None:
    """Pillow alone would cut the colours to 8 bits."""
    bgr = image if image.shape[2] == 1 else image[..., [2, 1, 0, 3][: image.shape[2]]]
    (tmp_path / f"a{suffix}").write_bytes(cv2.imencode(suffix, bgr)[1].tobytes())
    np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), image[..., :3])


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".webp", ".jpg"])
@pytest.mark.parametrize("kept", [0, 10, 0.3, 0.6, 0.9, -8])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_truncated_images_are_refused(tmp_path: Path, suffix: str, kept: float) -> None:
    Image.fromarray(RGB8).save(tmp_path / f"whole{suffix}")
    check_cut(tmp_path / f"whole{suffix}", kept)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("image", [RGB16, GRAY16])
@pytest.mark.parametrize("kept", [10, 0.3, 0.9, -16])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_truncated_sixteen_bit_images_are_refused(
    tmp_path: Path, suffix: str, image: np.ndarray, kept: float
) -> None:
    (tmp_path / f"whole{suffix}").write_bytes(cv2.imencode(suffix, image)[1].tobytes())
    check_cut(tmp_path / f"whole{suffix}", kept)


@pytest.mark.parametrize("image", [RGB8, GRAY8, RGB16, GRAY16])
def test_a_png_without_its_last_byte_is_refused(tmp_path: Path, image: np.ndarray) -> None:
    write_png(tmp_path / "whole.png", image)
    check_cut(tmp_path / "whole.png", -1)


def check_cut(whole: Path, kept: float) -> None:
    data = whole.read_bytes()
    cut = whole.with_stem("cut")
    cut.write_bytes(data[: int(len(data) * kept) if 0 < kept < 1 else int(kept)])
    with pytest.raises(InputError, match="cut"):
        read_image(cut)


@pytest.mark.parametrize("image", [RGB8, RGB16])
def test_a_damaged_png_is_refused(tmp_path: Path, image: np.ndarray) -> None:
    write_png(tmp_path / "a.png", image)
    data = bytearray((tmp_path / "a.png").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.png.*damaged"):
        read_image(tmp_path / "a.png")


def test_other_pixels_are_refused(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((24, 30), np.float32)).save(tmp_path / "a.tif")
    with pytest.raises(InputError, match="32 bits"):
        read_image(tmp_path / "a.tif")
    with pytest.raises(InputError, match="No such file"):
        read_image(tmp_path / "none.png")
    with pytest.raises(InputError, match="8 or 16 bits"):
        write_png(tmp_path / "a.png", np.zeros((2, 2)))


def test_masks_by_alpha_or_value(tmp_path: Path) -> None:
    mask = RGB8[..., 0] > 128
    Image.fromarray(mask).save(tmp_path / "bit.png")
    Image.fromarray(mask.astype(np.uint8)).save(tmp_path / "gray.png")
    Image.fromarray(np.dstack([0 * GRAY8, GRAY8 * 0, mask])).save(tmp_path / "rgb.png")
    Image.fromarray(np.dstack([RGB8 | 1, mask.astype(np.uint8)])).save(tmp_path / "alpha.png")
    for name in ("bit", "gray", "rgb", "alpha"):
        np.testing.assert_array_equal(read_mask(tmp_path / f"{name}.png"), mask)


def test_a_photograph_is_read_as_viewers_show_it(tmp_path: Path) -> None:
    """The camera was turned: what lies on its side in the file has an orientation in its EXIF."""
    picture = np.zeros((24, 40), np.uint8)
    picture[:12] = 255  # the upper half is bright
    exif = Image.Exif()
    exif[0x0112] = 6  # the picture is to be turned clockwise
    sideways = Image.fromarray(np.rot90(picture))
    sideways.save(tmp_path / "turned.jpg", exif=exif, quality=95)
    image = read_image(tmp_path / "turned.jpg")[..., 0]
    assert image.shape == (24, 40)
    assert image[:10].min() > 200 and image[14:].max() < 50


EXIF_TURNED = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0%c\0\0\0\0\0\0\0"
SHAPES = [RGB8, GRAY8, RGB16, GRAY16]


def chunk(kind: bytes, data: bytes) -> bytes:
    body = kind + data
    return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))


def with_chunk(path: Path, kind: bytes, content: bytes) -> None:
    data = path.read_bytes()
    place = data.index(b"IDAT") - 4
    path.write_bytes(data[:place] + chunk(kind, content) + data[place:])


def tiff(image: np.ndarray, *, orientation: int = 1, white_is_zero: bool = False) -> bytes:
    """A bare one of a single strip."""
    height, width, channels = image.shape
    bits, photometric = 8 * image.itemsize, 2 if channels == 3 else int(not white_is_zero)
    entries = 10
    behind = 8 + 2 + 12 * entries + 4
    short, long = 3, 4
    out = b"II*\0" + struct.pack("<IH", 8, entries)
    for tag, kind, count, value in (
        (256, short, 1, width),
        (257, short, 1, height),
        (258, short, channels, bits if channels == 1 else behind),
        (259, short, 1, 1),
        (262, short, 1, photometric),
        (273, long, 1, behind + 2 * channels),
        (274, short, 1, orientation),
        (277, short, 1, channels),
        (278, short, 1, height),
        (279, long, 1, image.nbytes),
    ):
        out += struct.pack("<HHII", tag, kind, count, value)
    return out + b"\0" * 4 + struct.pack("<3H", *[bits] * 3)[: 2 * channels] + image.tobytes()


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("image", SHAPES)
def test_all_kinds_are_turned_upright_alike(
    tmp_path: Path, image: np.ndarray, orientation: int
) -> None:
    """As Pillow turns the same picture of 8 bits, whose samples number the pixels."""
    numbers = Image.fromarray(np.arange(24 * 9, dtype=np.uint8).reshape(24, 9))
    numbers.getexif()[0x0112] = orientation
    turned = np.asarray(ImageOps.exif_transpose(numbers))
    expected = image[:, :9].reshape(24 * 9, -1)[turned]
    write_png(tmp_path / "a.png", image[:, :9])
    with_chunk(tmp_path / "a.png", b"eXIf", EXIF_TURNED.replace(b"%c", bytes([orientation])))
    (tmp_path / "a.tif").write_bytes(tiff(image[:, :9].copy(), orientation=orientation))
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), expected)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), expected)
    np.testing.assert_array_equal(read_mask(tmp_path / "a.png"), (expected > 0).any(axis=2))


@pytest.mark.parametrize("image", [GRAY8, GRAY16])
def test_grays_whose_zero_is_white_are_inverted(tmp_path: Path, image: np.ndarray) -> None:
    (tmp_path / "a.tif").write_bytes(tiff(image, white_is_zero=True))
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), ~image)


@pytest.mark.parametrize("image", SHAPES)
def test_texts_and_profiles_of_any_size_are_passed_over(tmp_path: Path, image: np.ndarray) -> None:
    write_png(tmp_path / "a.png", image)
    packed = zlib.compress(bytes(70_000_000))
    with_chunk(tmp_path / "a.png", b"iTXt", b"XML:com.adobe.xmp\0\1\0\0\0" + packed)
    with_chunk(tmp_path / "a.png", b"iCCP", b"icc\0\0" + packed)
    with_chunk(tmp_path / "a.png", b"zTXt", b"Comment\0\0" + packed)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), image)


def test_several_pages_are_named_unless_they_are_smaller_versions(tmp_path: Path) -> None:
    page, small = Image.fromarray(RGB8), Image.fromarray(RGB8[::2, ::2])
    small.save(tmp_path / "a.tif", save_all=True, append_images=[page])
    with pytest.raises(InputError, match=r"a\.tif: 2 pages \(15x12, 30x24 px\)"):
        read_image(tmp_path / "a.tif")
    for suffix in ("png", "webp"):
        page.save(tmp_path / f"b.{suffix}", save_all=True, append_images=[small.resize((30, 24))])
        with pytest.raises(InputError, match="2 pages"):
            read_image(tmp_path / f"b.{suffix}")
    small.encoderinfo = {"tiffinfo": {254: 1}}
    page.save(tmp_path / "c.tif", save_all=True, append_images=[small])
    np.testing.assert_array_equal(read_image(tmp_path / "c.tif"), RGB8)
    page.save(tmp_path / "d.jpg", format="MPO", save_all=True, append_images=[small], quality=100)
    assert read_image(tmp_path / "d.jpg").shape == RGB8.shape


@pytest.mark.parametrize("largest", [1, 200, 255, 1023, 4095, 65535])
@pytest.mark.parametrize("kind", ["P2", "P3", "P5", "P6"])
def test_pnm_of_any_largest_value(tmp_path: Path, kind: str, largest: int) -> None:
    shape = (24, 30, 3 if kind in ("P3", "P6") else 1)
    samples = np.random.default_rng(2).integers(0, largest, shape, endpoint=True)
    head = f"{kind}\n# by hand\n30 24\n{largest}\n".encode()
    if kind in ("P2", "P3"):
        body = " ".join(map(str, samples.ravel())).encode()
    else:
        body = samples.astype(">u2" if largest > 255 else "u1").tobytes()
    path = tmp_path / "a.pnm"
    path.write_bytes(head + body)
    white = 65535 if largest > 255 else 255
    image = read_image(path)
    assert image.dtype.itemsize == (2 if largest > 255 else 1)
    np.testing.assert_allclose(image / white, samples / largest, atol=0.5001 / white)
    for cut in (body[:-12], body[: len(body) // 2], b""):
        path.write_bytes(head + cut)
        with pytest.raises(InputError, match=r"a\.pnm.*cut off"):
            read_image(path)


@pytest.mark.parametrize("head", ["P5 0 24 255\n", "P5 30 24 0\n", "P6 30 24 99999\n", "P5 30\n"])
def test_a_pnm_that_cannot_be(tmp_path: Path, head: str) -> None:
    (tmp_path / "a.pgm").write_bytes(head.encode() + bytes(720))
    with pytest.raises(InputError, match=r"a\.pgm.*header"):
        read_image(tmp_path / "a.pgm")
    (tmp_path / "a.pgm").write_bytes(b"P5 30 24 9\n" + bytes([10]) * 720)
    with pytest.raises(InputError, match="samples up to 10, its header says 9"):
        read_image(tmp_path / "a.pgm")
    (tmp_path / "a.pgm").write_bytes(b"P5 99999999 99999999 255\n" + bytes(720))
    with pytest.raises(InputError, match="cut off"):
        read_image(tmp_path / "a.pgm")


def test_an_image_beyond_the_limit_is_named_with_a_way_out(tmp_path: Path) -> None:
    Image.new("1", (20_000, 18_000)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"a\.png: too large for one image .*one image per view"):
        read_image(tmp_path / "a.png")
