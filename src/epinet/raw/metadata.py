"""What a camera notes about a raw frame, as far as it is needed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from epinet.documents import short
from epinet.errors import InputError
from epinet.raw.bayer import BITS, UPPER_LEFT_PIXELS

CHANNELS = ("r", "gr", "gb", "b")

EXPOSURE_OFFSETS = {"F01": 1.0, "ILLUM": 0.0, "B01": 0.0}
"""Known models (B01 is the Illum in its calibration data), and the stops that are added to the
stated exposure bias, as the Light Field Toolbox does."""

_PITCHES_PX = (4.0, 64.0)
"""Of lenslets: 10 in the F01, 14 in the Illum."""
_MOST_STOPS = 20.0
_LONGEST_SERIAL = 100

_PACKING_ENDIANNESS = {10: "little", 12: "big"}


@dataclass(frozen=True)
class Frame:
    """A raw frame's metadata. Lengths in mm but for those in pixels."""

    where: str
    """What messages call it."""
    model: str
    serial: str | None
    """Of the camera; None where it is not told."""
    size: tuple[int, int]
    """(height, width) of the sensor in pixels."""
    bits: int
    upper_left: str
    """The mosaic's first pixel, one of UPPER_LEFT_PIXELS."""
    black: dict[str, float]
    white: dict[str, float]
    """Levels by channel (r, gr, gb, b)."""
    gains: tuple[float, float, float]
    """White balance of R, G, B."""
    matrix: tuple[float, ...]
    """Camera RGB to linear sRGB, 9 numbers by rows."""
    exposure_bias: float
    """Stops to be added to the picture."""
    pixel_pitch_mm: float
    lens_pitch_mm: float
    """Of the lenslets, along their rows."""
    focal_length_mm: float
    f_number: float
    infinity_lambda: float | None
    """Defocus of infinity: the blur's diameter in lenslet pitches."""
    zoom_step: int
    focus_step: int
    exposure_s: float

    @property
    def pitch_px(self) -> float:
        """Nominal distance of lenslets in pixels."""
        return self.lens_pitch_mm / self.pixel_pitch_mm


def parse_frame(metadata: Any, private: Any, where: str) -> Frame:
    """Read the metadata of a frame as either camera writes them.

    Captures of the Illum keep the raw's details in `image`, all others in `image.rawDetails`.

    Args:
        metadata: of the frame.
        private: the part with the serial numbers; may be empty.
        where: how messages call it, beginning with the file.

    Raises:
        InputError: an unknown camera, or all that is missing or out of range.
    """
    reader = _Reader(metadata, where)
    model = reader.text("camera.model")
    if model not in EXPOSURE_OFFSETS:
        raise InputError(
            f"{where}: camera model {short(model)} is not known; the raw files of the Lytro F01 "
            "and the Lytro ILLUM can be read. Other cameras: convert with their own software to "
            "views"
        )
    details = "image.rawDetails" if reader.has("image.rawDetails") else "image"
    matrix_key = "ccm" if reader.has("image.color.ccm") else "ccmRgbToSrgbArray"
    gains = {c: reader.length(f"image.color.whiteBalanceGain.{c}") for c in CHANNELS}
    has_lambda = reader.has("devices.lens.infinityLambda")
    frame = Frame(
        where=where,
        model=model,
        serial=_serial(private),
        size=(reader.count("image.height"), reader.count("image.width")),
        bits=reader.count(f"{details}.pixelPacking.bitsPerPixel"),
        upper_left=reader.text(f"{details}.mosaic.upperLeftPixel"),
        black={c: reader.number(f"{details}.pixelFormat.black.{c}") for c in CHANNELS},
        white={c: reader.number(f"{details}.pixelFormat.white.{c}") for c in CHANNELS},
        gains=(gains["r"], (gains["gr"] + gains["gb"]) / 2, gains["b"]),
        matrix=reader.numbers(f"image.color.{matrix_key}", 9),
        exposure_bias=EXPOSURE_OFFSETS[model] + reader.number("image.modulationExposureBias"),
        pixel_pitch_mm=1000 * reader.length("devices.sensor.pixelPitch"),
        lens_pitch_mm=1000 * reader.length("devices.mla.lensPitch"),
        focal_length_mm=1000 * reader.length("devices.lens.focalLength"),
        f_number=reader.length("devices.lens.fNumber"),
        infinity_lambda=reader.number("devices.lens.infinityLambda") if has_lambda else None,
        zoom_step=int(reader.number("devices.lens.zoomStep")),
        focus_step=int(reader.number("devices.lens.focusStep")),
        exposure_s=reader.number("devices.shutter.frameExposureDuration"),
    )
    _check_pixels(reader, frame, details)
    _check_optics(reader, frame)
    reader.raise_any()
    return frame


def _serial(private: Any) -> str | None:
    camera = private.get("camera") if isinstance(private, dict) else None
    serial = camera.get("serialNumber") if isinstance(camera, dict) else None
    return None if serial is None else str(serial)[:_LONGEST_SERIAL]


def _check_pixels(reader: _Reader, frame: Frame, details: str) -> None:
    """Note what cannot be unpacked; `details` is where the metadata tell it."""
    packing = f"{details}.pixelPacking"
    reader.check(frame.bits in BITS, f"{packing}.bitsPerPixel", f"one of {BITS}", frame.bits)
    endianness = reader.text(f"{packing}.endianness")
    due = _PACKING_ENDIANNESS.get(frame.bits, endianness)
    reader.check(endianness == due, f"{packing}.endianness", due, endianness)
    first, known = frame.upper_left, UPPER_LEFT_PIXELS
    reader.check(first in known, f"{details}.mosaic.upperLeftPixel", f"one of {known}", first)
    contrasts = [frame.white[c] - frame.black[c] for c in CHANNELS]
    due_contrast = "white levels above the black ones"
    reader.check(min(contrasts) >= 1, f"{details}.pixelFormat", due_contrast, contrasts)
    height, width = frame.size
    reader.check(height % 2 == width % 4 == 0, "image.width", "a multiple of 4", frame.size)


def _check_optics(reader: _Reader, frame: Frame) -> None:
    """Note what no lens and no exposure can have, and what arithmetic cannot take."""
    for key, value, (low, high) in (
        ("devices.mla.lensPitch", frame.pitch_px, _PITCHES_PX),
        ("image.modulationExposureBias", frame.exposure_bias, (-_MOST_STOPS, _MOST_STOPS)),
        ("devices.lens.focalLength", frame.focal_length_mm, (1e-2, 1e5)),
        ("devices.lens.fNumber", frame.f_number, (1e-2, 1e4)),
        ("devices.lens.infinityLambda", frame.infinity_lambda or 0.0, (-1e6, 1e6)),
        ("image.color", max(map(abs, (*frame.gains, *frame.matrix))), (0.0, 1e3)),
        ("devices.lens.zoomStep", frame.zoom_step, (-1e9, 1e9)),
        ("devices.lens.focusStep", frame.focus_step, (-1e9, 1e9)),
        ("image.width", max(frame.size), (4, 2**17)),
    ):
        reader.check(low <= value <= high, key, f"within {low:g}..{high:g}", short(value))


class _Reader:
    """Takes values out of nested metadata, and notes what is not there."""

    def __init__(self, metadata: dict[str, Any], where: str) -> None:
        self._metadata, self._where = metadata, where
        self._problems: list[str] = []

    def has(self, key: str) -> bool:
        return self._value(key) is not None

    def number(self, key: str) -> float:
        value = self._value(key)
        return float(value) if _is_number(value) else self._missing(key, value)

    def length(self, key: str) -> float:
        value = self.number(key)
        self.check(value > 0, key, "above 0", value)
        return value

    def count(self, key: str) -> int:
        value = self.number(key)
        self.check(value >= 1 and value == int(value), key, "a whole number above 0", value)
        return int(value)

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        values = self._value(key)
        if not isinstance(values, list) or len(values) != count or not all(map(_is_number, values)):
            self._missing(key, values)
            return (1.0,) * count
        return tuple(float(value) for value in values)

    def text(self, key: str) -> str:
        value = self._value(key)
        if not isinstance(value, str):
            self._missing(key, value)
            return ""
        return value

    def check(self, good: bool, key: str, due: object, found: object) -> None:
        if not good and not any(key in problem for problem in self._problems):
            self._problems.append(f"{self._where}: {key} should be {due}, it is {short(found)}")

    def raise_any(self) -> None:
        if self._problems:
            raise InputError(self._problems)

    def _value(self, key: str) -> Any:
        value: Any = self._metadata
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                return None
            value = value[part]
        return value

    def _missing(self, key: str, found: object) -> float:
        what = "is missing" if found is None else f"cannot be {short(found)}"
        self._problems.append(f"{self._where}: {key} {what} in the frame's metadata")
        return 1.0


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) < 1e15
