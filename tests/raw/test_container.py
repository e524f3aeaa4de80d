"""Raw files read as imageio's Lytro plugin reads them, or refused with a reason."""

from __future__ import annotations

import io
import json
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
from PIL import Image
from plenoptic_forward import (
    F01,
    ILLUM,
    Body,
    Container,
    Optics,
    frame_metadata,
    pack,
    private_metadata,
    write_capture,
    write_white,
)

from epinet.errors import InputError
from epinet.raw.bayer import mosaic, unpack
from epinet.raw.capture import read_capture

SMALL = Optics(size=(32, 48))
FULL_SIZES = {"F01": (3280, 3280), "ILLUM": (5368, 7728)}
"""The only ones that imageio reads."""


def random_raw(body: Body, size: tuple[int, int] = SMALL.size) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 2**body.bits, size, np.uint16)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_capture(path)
    assert all(str(path) in problem for problem in caught.value.problems)
    return str(caught.value)


@pytest.mark.parametrize("body", [F01, ILLUM], ids=lambda body: body.model)
def test_pixels_and_metadata_are_those_that_imageio_reads(tmp_path: Path, body: Body) -> None:
    optics = Optics(size=FULL_SIZES[body.model])
    packed = np.random.default_rng(1).bytes(optics.size[0] * optics.size[1] * body.bits // 8)
    suffix, plugin = {"F01": ("lfp", "lytro-lfp"), "ILLUM": ("lfr", "lytro-lfr")}[body.model]
    path = write_capture(tmp_path / f"a.{suffix}", optics, body, packed)
    options = {} if body is F01 else {"include_thumbnail": False}
    theirs = imageio.imread(path, format=plugin, **options)
    ours = read_capture(path)
    some = slice(None, None, 61)
    np.testing.assert_array_equal(ours.raw[some] / (2.0**body.bits - 1), theirs[some])
    assert theirs.meta["metadata"] == frame_metadata(optics, body)
    assert ours.frame.serial == theirs.meta["privateMetadata"]["camera"]["serialNumber"]
    noted = theirs.meta["metadata"]["devices"]
    assert ours.frame.f_number == noted["lens"]["fNumber"]
    assert ours.frame.pitch_px == pytest.approx(optics.pitch)


def test_raw_pixels_with_metadata_beside_are_those_that_imageio_reads(tmp_path: Path) -> None:
    optics = Optics(size=FULL_SIZES["F01"])
    path = write_white(tmp_path, optics, F01, random_raw(F01, optics.size))
    ours = read_capture(path)
    theirs = imageio.imread(path, format="lytro-f01-raw")
    np.testing.assert_array_equal(ours.raw / 4095, theirs)
    assert (ours.frame.model, ours.frame.serial) == ("F01", F01.serial)


def test_documented_bytes() -> None:
    """12 bit as J. Kučera describes the F01's; 10 bit as the Illum's by the LF Toolbox."""
    assert unpack(bytes.fromhex("fff000" * 2), (1, 4), 12).tolist() == [[4095, 0, 4095, 0]]
    assert unpack(bytes([255, 0, 0, 0, 0b11]), (1, 4), 10).tolist() == [[1023, 0, 0, 0]]
    assert unpack(bytes([0, 0, 0, 1, 0b10000100]), (1, 4), 10).tolist() == [[0, 1, 0, 6]]


@pytest.mark.parametrize("body", [F01, ILLUM], ids=lambda body: body.model)
def test_the_mosaic_is_the_cameras(body: Body) -> None:
    y, x = np.mgrid[:4, :4]
    assert (mosaic(body.upper_left)[y % 2, x % 2] == body.colour_at(x, y)).all()


@pytest.mark.parametrize("body", [F01, ILLUM], ids=lambda body: body.model)
def test_files_cut_off_anywhere_are_refused(tmp_path: Path, body: Body) -> None:
    whole = write_capture(tmp_path / "whole.lfp", SMALL, body, random_raw(body)).read_bytes()
    path = tmp_path / "cut.lfp"
    last = len(whole.rstrip(b"\0"))
    for length in [0, 4, 16, 40, 100, 120, *range(200, last, last // 40), last - 1]:
        path.write_bytes(whole[:length])
        assert "copy" in refusal(path) or "empty" in refusal(path) or length < 16, length


def test_a_damaged_byte_is_noticed(tmp_path: Path) -> None:
    path = write_capture(tmp_path / "a.lfp", SMALL, F01, random_raw(F01))
    data = bytearray(path.read_bytes())
    place = data.find(pack(random_raw(F01), 12)) + 500
    data[place] ^= 4
    path.write_bytes(data)
    assert "damaged between bytes" in refusal(path)


def picture(kind: str) -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (32, 32)).save(buffer, kind)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (picture("JPEG"), "a JPEG image"),
        (picture("PNG"), "a PNG image"),
        (b"", "an empty file"),
        (b"some text, long enough to be a head", "not a Lytro file"),
    ],
)
def test_other_files_are_named(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "picture.lfp"
    path.write_bytes(content)
    assert f"{path}: {says}" in refusal(path)


REFERENCES = {"imageRef": "sha1-0", "metadataRef": "sha1-1", "privateMetadataRef": "sha1-2"}


def processed(path: Path, kind: str, pictures: int, frame: bool) -> Path:
    """What Lytro Desktop made of a capture; `frame`: it refers to a sensor image elsewhere."""
    file = Container()
    images = [{"imageRef": file.add(picture("JPEG") + bytes([i]))} for i in range(pictures)]
    made: dict[str, object] = {"imageArray": images}
    if not pictures:
        made = {"depthLut": {"imageRef": file.add(bytes(400))}}
    acceleration = {"type": f"com.lytro.acceleration.{kind}", "vendorContent": made}
    contents = {"picture": {"accelerationArray": [acceleration]}}
    if frame:
        contents["picture"]["frameArray"] = [{"frame": REFERENCES}]  # type: ignore[assignment]
    return file.write(path, contents, contents_first=True)


@pytest.mark.parametrize("frame", [True, False])
@pytest.mark.parametrize(
    ("name", "kind", "pictures", "says"),
    [
        ("IMG_0001-stk.lfp", "refocusStack", 3, "a stack of refocused pictures (3 JPEG)"),
        ("renamed.lfp", "refocusStack", 3, "a stack of refocused pictures (3 JPEG)"),
        ("stacklq_filtered.lfp", "x", 2, "a stack of refocused pictures (2 JPEG)"),
        ("IMG_0001-dm.lfp", "x", 0, "a depth map"),
        ("dm.lfp", "x", 0, "a depth map"),
        ("renamed.lfp", "depthMap", 0, "a depth map"),
        ("IMG_0001_warped.lfp", "x", 1, "a warped picture (1 JPEG)"),
        ("compressed.lfp", "x", 1, "a compressed picture (1 JPEG)"),
        ("IMG_0001-export.LFP", "x", 1, "an exported picture (1 JPEG)"),
    ],
)
def test_processed_files_are_called_what_they_are(
    tmp_path: Path, name: str, kind: str, pictures: int, says: str, frame: bool
) -> None:
    path = processed(tmp_path / name, kind, pictures, frame)
    text = refusal(path)
    assert says in text and "no raw image of the sensor" in text
    assert "copy it again" not in text
    assert "such as IMG_0001.lfp or raw.lfp" in text
    if name.startswith("IMG"):
        write_capture(tmp_path / "IMG_0001.lfp", SMALL, F01, random_raw(F01))
        assert "give the file that the camera wrote, IMG_0001.lfp beside it" in refusal(path)


def test_a_capture_without_its_sensor_image_is_incomplete(tmp_path: Path) -> None:
    file = Container()
    file.add(frame_metadata(SMALL, F01))
    contents = {"picture": {"frameArray": [{"frame": REFERENCES}]}}
    path = file.write(tmp_path / "IMG_0001.lfp", contents, contents_first=True)
    assert "copy it again" in refusal(path)


def capture_with(path: Path, metadata: dict) -> Path:
    file = Container()
    frame = {
        "metadataRef": file.add(metadata),
        "imageRef": file.add(pack(random_raw(F01), 12)),
        "privateMetadataRef": file.add(private_metadata(F01)),
    }
    return file.write(path, {"picture": {"frameArray": [{"frame": frame}]}}, True)


def test_an_unknown_camera_is_named(tmp_path: Path) -> None:
    metadata = frame_metadata(SMALL, F01)
    metadata["camera"]["model"] = "R29"
    text = refusal(capture_with(tmp_path / "a.lfp", metadata))
    assert "'R29' is not known" in text and "ILLUM" in text


def test_all_that_is_missing_from_metadata_is_told_at_once(tmp_path: Path) -> None:
    metadata = frame_metadata(SMALL, F01)
    del metadata["devices"]["mla"]["lensPitch"]
    metadata["devices"]["lens"]["fNumber"] = "wide"
    metadata["image"]["rawDetails"]["mosaic"]["upperLeftPixel"] = "x"
    metadata["image"]["color"]["ccmRgbToSrgbArray"][4] = None
    text = refusal(capture_with(tmp_path / "a.lfp", metadata))
    for key in ("mla.lensPitch", "lens.fNumber", "mosaic.upperLeftPixel", "ccmRgbToSrgbArray"):
        assert key in text


def test_a_raw_image_of_another_length_is_refused(tmp_path: Path) -> None:
    metadata = frame_metadata(Optics(size=(64, 48)), F01)
    assert "cut off" in refusal(capture_with(tmp_path / "a.lfp", metadata))


def test_raw_pixels_alone_are_not_enough(tmp_path: Path) -> None:
    path = tmp_path / "IMG_0001.raw"
    path.write_bytes(pack(random_raw(F01), 12))
    assert "IMG_0001.json" in refusal(path)
    path.with_suffix(".json").write_text(json.dumps(frame_metadata(SMALL, F01)))
    np.testing.assert_array_equal(read_capture(path).raw, random_raw(F01))
    assert read_capture(path).frame.serial is None
    private = tmp_path / "IMG_0001_private_metadata.json"
    private.write_text(json.dumps(private_metadata(F01)))
    assert read_capture(path).frame.serial == F01.serial
