from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

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


def test_an_image_beyond_the_limit_is_named_with_a_way_out(tmp_path: Path) -> None:
    Image.new("1", (20_000, 18_000)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"a\.png: too large for one image .*one image per view"):
        read_image(tmp_path / "a.png")
