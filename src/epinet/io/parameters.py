"""parameters.cfg of the 4D Light Field Benchmark: the camera and the size of its grid."""

from __future__ import annotations

import configparser
import math
from dataclasses import dataclass
from pathlib import Path

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io.problems import Problems, parsing
from epinet.lightfield import LightField
from epinet.reading import read_bytes
from epinet.texts import decoded

_MOST_BYTES = 2**20
_INTRINSICS = (
    "focal_length_mm",
    "sensor_size_mm",
    "image_resolution_x_px",
    "image_resolution_y_px",
)
_EXTRINSICS = ("baseline_mm", "focus_distance_m")


@dataclass(frozen=True)
class Parameters:
    """What epinet takes from a parameters.cfg."""

    side: int | None = None
    """Rows and columns of the grid, where stated."""
    camera: Camera | None = None
    """None where the file says nothing about the camera."""
    captured: bool = False
    """Taken by a camera; the benchmark's own scenes are rendered."""


def read_parameters(path: Path) -> Parameters:
    """Read a parameters.cfg; lengths become mm.

    Raises:
        InputError: every value that is missing or no number, and a grid that is not square.
    """
    config = configparser.ConfigParser(interpolation=None)
    with parsing(path, "a parameters.cfg"):
        config.read_string(decoded(read_bytes(path, _MOST_BYTES)))
    problems = Problems()
    side: int | None = None
    camera: Camera | None = None
    captured = False
    with problems.gather():
        side = _side(path, config)
    with problems.gather():
        camera = _camera(path, config)
    with problems.gather():
        captured = _captured(path, config)
    problems.raise_any()
    return Parameters(side, camera, captured)


def write_parameters(path: Path, lf: LightField) -> None:
    """Write what `read_parameters` reads: grid, camera where known, whether it was captured."""
    side = str(lf.grid[0])
    sections = {"extrinsics": {"num_cams_x": side, "num_cams_y": side}}
    meta = {"captured": "true"} if lf.captured else {}
    if lf.camera is not None:
        c = lf.camera
        intrinsics = (c.focal_length_mm, c.sensor_size_mm, c.width_px, c.height_px)
        sections["intrinsics"] = dict(zip(_INTRINSICS, map(str, intrinsics), strict=True))
        sections["extrinsics"]["baseline_mm"] = str(c.baseline_mm)
        sections["extrinsics"]["focus_distance_m"] = str(c.focus_distance_mm / 1000)
        bounds = {"disp_min": c.disparity_min_px, "disp_max": c.disparity_max_px}
        meta |= {key: str(value) for key, value in bounds.items() if value is not None}
    sections["meta"] = meta
    config = configparser.ConfigParser(interpolation=None)
    config.read_dict(sections)
    with path.open("w", encoding="utf-8") as file:
        config.write(file)


def _side(path: Path, config: configparser.ConfigParser) -> int | None:
    texts = [config.get("extrinsics", f"num_cams_{axis}", fallback=None) for axis in "xy"]
    if texts == [None, None]:
        return None
    if texts[0] != texts[1]:
        raise InputError(
            f"{path}: num_cams_x = {texts[0]} and num_cams_y = {texts[1]}; "
            "the grid of views must be square"
        )
    if not str(texts[0]).isdecimal():
        raise InputError(f"{path}: num_cams_x = {texts[0]} must be a whole number")
    return int(str(texts[0]))


def _camera(path: Path, config: configparser.ConfigParser) -> Camera | None:
    wanted = dict.fromkeys(_INTRINSICS, "intrinsics") | dict.fromkeys(_EXTRINSICS, "extrinsics")
    if not any(config.has_option(section, key) for key, section in wanted.items()):
        return None
    problems = Problems()
    values: dict[str, float] = {}
    for key, section in wanted.items():
        with problems.gather():
            focus = key == "focus_distance_m"
            values[key] = _number(path, config, section, key, infinite=focus)
            if values[key] == 0 or (values[key] < 0 and not focus):
                raise InputError(f"{path}: {key} = {values[key]} must be greater than 0")
    bounds: dict[str, float | None] = {"disp_min": None, "disp_max": None}
    for key in bounds:
        if config.has_option("meta", key):
            with problems.gather():
                bounds[key] = _number(path, config, "meta", key)
    problems.raise_any()
    return Camera(
        focal_length_mm=values["focal_length_mm"],
        sensor_size_mm=values["sensor_size_mm"],
        baseline_mm=values["baseline_mm"],
        focus_distance_mm=values["focus_distance_m"] * 1000,
        width_px=round(values["image_resolution_x_px"]),
        height_px=round(values["image_resolution_y_px"]),
        disparity_min_px=bounds["disp_min"],
        disparity_max_px=bounds["disp_max"],
    )


def _captured(path: Path, config: configparser.ConfigParser) -> bool:
    try:
        return config.getboolean("meta", "captured", fallback=False)
    except ValueError as error:
        text = config.get("meta", "captured")
        raise InputError(f"{path}: captured = {text} must be true or false") from error


def _number(
    path: Path,
    config: configparser.ConfigParser,
    section: str,
    key: str,
    *,
    infinite: bool = False,
) -> float:
    text = config.get(section, key, fallback=None)
    if text is None:
        raise InputError(f"{path}: {key} is missing from section [{section}]")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) or (infinite and math.isinf(value))):
        raise InputError(f"{path}: {key} = {text} must be a number")
    return value
