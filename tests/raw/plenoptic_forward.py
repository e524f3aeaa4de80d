"""A plenoptic camera in numpy: scene -> lenslet sensor image -> Bayer raw -> Lytro file.

The truth that the decoder is held against; it shares no code with it. The scene is a slanted plane
with a texture of sinusoids, so the colour seen at any point of any view is a closed formula.
Lengths and points are in sensor pixels, x to the right and y down, pixel centres at whole numbers.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A plane whose image moves by `slope` px for each px that the viewpoint moves.

    slope(x, y) = slope0 + slope_x * x + slope_y * y where (x, y) is measured from `middle` in the
    view from the lenslets' centres.
    """

    slope0: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    middle: tuple[float, float] = (0.0, 0.0)
    finest_px: float = 60.0
    """Shortest wavelength of the texture."""
    colourfulness: float = 0.4
    """0 is a gray texture, 1 has independent colour channels."""
    contrast: float = 0.35
    seed: int = 0

    def slope(self, x: Floats, y: Floats, dx: Floats | float = 0, dy: Floats | float = 0) -> Floats:
        """Slope of the point seen at (x, y) by the viewpoint (dx, dy)."""
        x, y = x - self.middle[0], y - self.middle[1]
        top = self.slope0 + self.slope_x * x + self.slope_y * y
        return np.asarray(top / (1 - self.slope_x * dx - self.slope_y * dy))

    def colour(self, x: Floats, y: Floats, dx: Floats | float, dy: Floats | float) -> Floats:
        """Linear sRGB (..., 3) in about .1 to .9 seen at (x, y) by the viewpoint (dx, dy).

        The point lies at (x + slope * dx, y + slope * dy) in the central view.
        """
        slope = self.slope(x, y, dx, dy)
        return self._texture(x + slope * dx, y + slope * dy)

    def _texture(self, x: Floats, y: Floats) -> Floats:
        rng = np.random.default_rng(self.seed)
        luma = self._waves(x, y, rng)
        chroma = np.stack([self._waves(x, y, rng) for _ in range(3)], axis=-1)
        mixed = (1 - self.colourfulness) * luma[..., None] + self.colourfulness * chroma
        return 0.5 + self.contrast * np.tanh(mixed)

    def _waves(self, x: Floats, y: Floats, rng: np.random.Generator, count: int = 12) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for _ in range(count):
            length = self.finest_px * rng.uniform(1, 4)
            angle, phase = rng.uniform(0, 2 * np.pi, 2)
            wave = (x * np.cos(angle) + y * np.sin(angle)) / length
            total += np.cos(2 * np.pi * wave + phase)
        return total / np.sqrt(count / 2)


@dataclass(frozen=True)
class Optics:
    """The lenslets over the sensor, a hexagonal grid of horizontal rows."""

    size: tuple[int, int] = (480, 560)
    """(height, width) of the sensor."""
    pitch: float = 2.0e-5 / 1.4e-6
    rotation: float = -0.0005426
    """Of the rows, radians, from the x axis to the y axis."""
    scale_y: float = 1.00034
    centre: tuple[float, float] = (281.3, 238.6)
    """(x, y) of one lenslet."""

    def lenslet_of(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The centre (x, y) of the lenslet nearest to each point, found by trying them."""
        cos, sin = np.cos(self.rotation), np.sin(self.rotation)
        along = (x - self.centre[0]) * cos + (y - self.centre[1]) * sin
        across = (y - self.centre[1]) * cos - (x - self.centre[0]) * sin
        height = self.pitch * np.sqrt(3) / 2 * self.scale_y
        best = [np.full(x.shape, np.inf), np.zeros(x.shape), np.zeros(x.shape)]
        for shift in (-1, 0, 1):
            row = np.round(across / height) + shift
            offset = (row % 2) / 2
            column = np.round(along / self.pitch - offset) + offset
            a, b = column * self.pitch, row * height
            distance = np.hypot(along - a, across - b)
            for kept, new in zip(best[1:], (a, b), strict=True):
                np.copyto(kept, new, where=distance < best[0])
            np.minimum(best[0], distance, out=best[0])
        _, a, b = best
        return self.centre[0] + a * cos - b * sin, self.centre[1] + a * sin + b * cos

    def vignetting(self, dx: Floats, dy: Floats) -> Floats:
        """Share of the light that arrives (dx, dy) from a lenslet's centre."""
        rho = 2 * np.hypot(dx, dy) / self.pitch
        edge = 1 / (1 + np.exp((rho - 1.02) / 0.035))
        return 0.02 + 0.98 * (1 - 0.35 * rho**2).clip(0) * edge


@dataclass(frozen=True)
class Body:
    """What one camera model does with the light, and how it writes it down."""

    model: str
    bits: int
    black: int
    upper_left: str
    """Colour of the first pixel: b, or gr (a green one in a row with red)."""
    gains: tuple[float, float, float]
    matrix: tuple[float, ...]
    """Camera RGB to sRGB, by rows."""
    sensitivity: tuple[float, float, float]
    """Response of the sensor's colours to white light through the diffuser."""
    exposure_bias: float = 0.0
    serial: str = "A303134643"
    zoom_step: int = 943
    focus_step: int = 672

    @property
    def white(self) -> int:
        return 2**self.bits - 1

    def colour_at(self, x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int64]:
        """Index (0 R, 1 G, 2 B) of the filter over pixels."""
        pattern = {"b": [[2, 1], [1, 0]], "gr": [[1, 0], [2, 1]]}[self.upper_left]
        return np.array(pattern)[y % 2, x % 2]


F01 = Body(
    model="F01",
    bits=12,
    black=168,
    upper_left="b",
    gains=(1.0, 1.0, 1.2578125),
    matrix=(
        *(3.1115827560424805, -1.9393929243087769, -0.172189861536026),
        *(-0.3629055917263031, 1.6408803462982178, -0.27797481417655945),
        *(0.07896701246500015, -1.1558042764663696, 2.0768373012542725),
    ),
    sensitivity=(0.9, 1.0, 0.8),
    exposure_bias=-1.1139298677444458,
)
ILLUM = Body(
    model="ILLUM",
    bits=10,
    black=64,
    upper_left="gr",
    gains=(1.378859281539917, 1.0, 1.1484659910202026),
    matrix=(
        *(2.2271547317504883, -1.055293321609497, -0.1718614399433136),
        *(-0.4269128441810608, 1.7458617687225342, -0.3189488351345062),
        *(-0.20497213304042816, -0.7469924688339233, 1.9519646167755127),
    ),
    sensitivity=(0.7761663198471069, 1.0, 0.7344976663589478),
    exposure_bias=0.2689966559410095,
    serial="B5143909630",
    zoom_step=-297,
    focus_step=309,
)


def srgb(linear: Floats) -> Floats:
    """The sRGB transfer curve (IEC 61966-2-1) of values in 0..1."""
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def camera_rgb(body: Body, colour: Floats) -> Floats:
    """What the sensor records of linear sRGB where nothing is vignetted: white is 1, 1, 1."""
    matrix = np.array(body.matrix).reshape(3, 3)
    bias = body.exposure_bias + (1 if body.model == "F01" else 0)
    return np.asarray(colour @ np.linalg.inv(matrix).T / np.array(body.gains) / 2**bias)


def expose(
    optics: Optics,
    body: Body,
    light: Callable[[Floats, Floats, Floats, Floats], Floats],
    noise: float = 0.0,
    seed: int = 0,
    strip: int = 256,
) -> NDArray[np.uint16]:
    """(H, W) Bayer raw of light(lenslet x, lenslet y, dx, dy) -> camera RGB (..., 3).

    Args:
        noise: standard deviation in shares of the white level.
    """
    height, width = optics.size
    raw = np.empty((height, width), np.uint16)
    rng = np.random.default_rng(seed)
    for top in range(0, height, strip):
        y, x = np.mgrid[top : min(top + strip, height), :width]
        centre_x, centre_y = optics.lenslet_of(x.astype(float), y.astype(float))
        dx, dy = x - centre_x, y - centre_y
        rgb = light(centre_x, centre_y, dx, dy)
        one = np.take_along_axis(rgb, body.colour_at(x, y)[..., None], axis=-1)[..., 0]
        level = one * optics.vignetting(dx, dy) + rng.normal(0, noise, x.shape)
        counts = body.black + (body.white - body.black) * level
        raw[top : top + strip] = np.clip(np.round(counts), 0, body.white)
    return raw


def photograph(optics: Optics, body: Body, scene: Scene, noise: float = 0.0) -> NDArray[np.uint16]:
    """Raw image of a scene."""
    return expose(
        optics,
        body,
        lambda x, y, dx, dy: camera_rgb(body, scene.colour(x, y, dx, dy)),
        noise,
    )


def white_image(optics: Optics, body: Body, noise: float = 0.0) -> NDArray[np.uint16]:
    """Raw image through a diffuser, as the factory takes it."""
    level = 0.8 * np.array(body.sensitivity)
    return expose(
        optics, body, lambda x, y, dx, dy: np.broadcast_to(level, (*x.shape, 3)), noise, seed=1
    )


def pack(raw: NDArray[np.uint16], bits: int) -> bytes:
    """The bits of pixels as the cameras write them, one pixel after another.

    12 bit (big endian): two pixels in three bytes, each high bits first. 10 bit: the high 8 bits
    of four pixels, then a byte of their low 2 bits, the first pixel lowest.
    """
    pixels = raw.reshape(-1).astype(np.uint32)
    if bits == 12:
        joined = (pixels[0::2] << 12) | pixels[1::2]
        return np.stack([joined >> 16, joined >> 8 & 255, joined & 255], 1).astype("u1").tobytes()
    four = pixels.reshape(-1, 4)
    low = sum((four[:, i] & 3) << (2 * i) for i in range(4))
    return np.column_stack([four >> 2, low]).astype("u1").tobytes()


def frame_metadata(optics: Optics, body: Body, white: bool = False) -> dict[str, Any]:
    """Metadata of a frame in the structure that this camera writes; lengths in m.

    White images of both models, and captures of the F01, keep the raw's details one level deeper
    than captures of the Illum.
    """
    height, width = optics.size
    levels = {name: dict.fromkeys(("r", "gr", "gb", "b"), value)
              for name, value in (("black", body.black), ("white", body.white))}  # fmt: skip
    details = {
        "pixelFormat": {"rightShift": 0, **levels},
        "pixelPacking": {
            "endianness": "big" if body.bits == 12 else "little",
            "bitsPerPixel": body.bits,
        },
        "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": body.upper_left},
    }
    deep = white or body.model == "F01"
    r, g, b = body.gains
    image = {
        "width": width,
        "height": height,
        "orientation": 1,
        "modulationExposureBias": body.exposure_bias,
        "color": {
            "ccmRgbToSrgbArray" if deep else "ccm": list(body.matrix),
            "whiteBalanceGain": {"r": r, "gr": g, "gb": g, "b": b},
            **({"gamma": 0.41666001081466675} if deep else {}),
        },
        **({"rawDetails": details, "representation": "rawPacked"} if deep else details),
    }
    small = body.model == "F01"
    pixel_m = 1.4e-6
    lens = (
        {"infinityLambda": 18.033, "focalLength": 0.00684, "fNumber": 1.92}
        if small
        else {"infinityLambda": 33.8902, "focalLength": 0.0241995, "fNumber": 2.19978}
    )
    return {
        "image": image,
        "devices": {
            "sensor": {"pixelPitch": pixel_m, "bitsPerPixel": body.bits},
            "lens": {**lens, "zoomStep": body.zoom_step, "focusStep": body.focus_step},
            "mla": {
                "tiling": "hexUniformRowMajor",
                "lensPitch": optics.pitch * pixel_m,
                "rotation": optics.rotation,
                "scaleFactor": {"x": 1, "y": optics.scale_y},
                "sensorOffset": {"x": 0.0, "y": 0.0, "z": 2.5e-5 if small else 3.7e-5},
            },
            "shutter": {"frameExposureDuration": 0.0166},
        },
        "camera": {
            "make": "Lytro, Inc.",
            "model": "B01" if white and not small else body.model,
            "firmware": "1.1.1 (23)",
        },
    }


def private_metadata(body: Body) -> dict[str, Any]:
    return {"camera": {"serialNumber": body.serial}}


@dataclass
class Container:
    """A Lytro file being put together: a table of contents and sections named by their hash."""

    sections: list[tuple[bytes, str]] = field(default_factory=list)

    def add(self, data: bytes | dict[str, Any]) -> str:
        """Add a section; returns the reference to it."""
        if isinstance(data, dict):
            data = json.dumps(data).encode()
        name = "sha1-" + hashlib.sha1(data).hexdigest()
        self.sections.append((data, name))
        return name

    def write(self, path: Path, contents: dict[str, Any], contents_first: bool) -> Path:
        """Write; an F01 puts its table of contents first, an Illum last."""
        table = json.dumps(contents).encode()
        table += b" " * ((11 - len(table)) % 16)  # imageio's reader wants 5 bytes of padding
        head = b"\x89LFM\r\n\x1a\n\0\0\0\0", table, "sha1-" + hashlib.sha1(table).hexdigest()
        parts = [(b"\x89LFC\r\n\x1a\n\0\0\0\0", *section) for section in self.sections]
        parts.insert(0 if contents_first else len(parts), head)
        with path.open("wb") as file:
            file.write(b"\x89LFP\r\n\x1a\n\0\0\0\1" + bytes(4))
            for magic, data, name in parts:
                file.write(magic + len(data).to_bytes(4, "big") + name.encode() + bytes(35))
                file.write(data + bytes(-len(data) % 16))
        return path


def write_capture(
    path: Path,
    optics: Optics,
    body: Body,
    raw: NDArray[np.uint16] | bytes,
    embedded_white: NDArray[np.uint16] | None = None,
) -> Path:
    """A .lfp of the F01 or .lfr of the Illum, as the camera's own software writes it.

    Args:
        raw: (H, W) pixels, or packed ones.
    """
    file = Container()
    frame = {
        "metadataRef": file.add(frame_metadata(optics, body)),
        "imageRef": file.add(raw if isinstance(raw, bytes) else pack(raw, body.bits)),
        "privateMetadataRef": file.add(private_metadata(body)),
    }
    if body.model == "F01":
        return file.write(path, {"picture": {"frameArray": [{"frame": frame}]}}, True)
    if embedded_white is not None:
        frame["modulationDataRef"] = file.add(pack(embedded_white, body.bits))
    while len(file.sections) < 11:  # as many as imageio's reader expects of an Illum
        file.add({"filler": len(file.sections)})
    contents = {"frames": [{"frame": frame}], "thumbnails": []}
    return file.write(path, contents, False)


def write_white(
    folder: Path, optics: Optics, body: Body, raw: NDArray[np.uint16], name: str = "MOD_0000"
) -> Path:
    """A white image of the calibration data: NAME.RAW with NAME.TXT."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.RAW").write_bytes(pack(raw, body.bits))
    metadata = {
        "master": {
            "picture": {
                "frameArray": [
                    {
                        "frame": {
                            "metadata": frame_metadata(optics, body, white=True),
                            "privateMetadata": private_metadata(body),
                        }
                    }
                ]
            }
        }
    }
    (folder / f"{name}.TXT").write_text(json.dumps(metadata))
    return folder / f"{name}.RAW"
