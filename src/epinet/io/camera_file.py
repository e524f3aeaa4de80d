"""What is known of a camera, in a small JSON or YAML file, and how several sources complete it.

    focal_length_mm: 100        # or, instead of it and the sensor's size, fov_deg: 19.85
    sensor_size_mm: 35          # the longer side
    baseline_mm: 11             # or, from a calibration, baseline_focal_mm_px: 16091
    focus_distance_mm: 2300

Any part may be missing: depth needs no field of view where baseline times focal length is known,
and flags of a command may give the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from epinet.camera import Camera
from epinet.documents import JSON_BYTES, parse_json, parse_yaml, validated
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.parameters import read_parameters
from epinet.io.problems import parsing
from epinet.reading import read_bytes


def _not_tiny(length: float) -> float:
    if length < 1e-9:
        raise ValueError("Input should be at least 1e-9")
    return length


_Length = Annotated[float, Field(gt=0, le=1e12), AfterValidator(_not_tiny)]
"""Of anything that a camera could be; other numbers overflow where they are multiplied."""
_Pixels = Annotated[int, Field(gt=0, le=2**20)]

_CAMERA_FIELDS = tuple(field.name for field in fields(Camera))
_JSON, _YAML, _CFG = ".json", (".yaml", ".yml"), ".cfg"


class CameraFacts(BaseModel):
    """What is known of a camera; any of it may be missing."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")

    focal_length_mm: _Length | None = None
    sensor_size_mm: _Length | None = None
    """The sensor's longer side."""
    fov_deg: Annotated[float, Field(ge=1e-3, lt=180)] | None = None
    """Field of view across the picture's longer side; instead of focal length and sensor."""
    baseline_mm: _Length | None = None
    """Distance between adjacent views."""
    baseline_focal_mm_px: _Length | None = None
    """Baseline times focal length in pixels; instead of the baseline."""
    focus_distance_mm: float | None = None
    """Distance of disparity 0: inf for parallel cameras, negative beyond infinity."""
    width_px: _Pixels | None = None
    height_px: _Pixels | None = None
    """Size of the views that this holds for, where stated."""

    @model_validator(mode="after")
    def _say_each_thing_once(self) -> CameraFacts:
        lengths = self.focal_length_mm is not None or self.sensor_size_mm is not None
        if self.fov_deg is not None and lengths:
            raise ValueError("give either the field of view or focal length and sensor size")
        if self.baseline_mm is not None and self.baseline_focal_mm_px is not None:
            raise ValueError("give either baseline_mm or baseline_focal_mm_px")
        focus = self.focus_distance_mm
        if focus is not None and not abs(focus) >= 1e-9:
            raise ValueError("the focus distance must be a number other than 0, or inf")
        return self

    def known(self) -> dict[str, float]:
        """The facts that there are, by name."""
        return self.model_dump(exclude_none=True)

    def as_json(self) -> str:
        """The known facts; an infinite distance is the text Infinity: JSON has no such number."""
        return self.model_dump_json(exclude_none=True, indent=1)

    def completed_by(self, other: CameraFacts) -> CameraFacts:
        """These facts with those of `other`, which win; another way to say the same goes.

        Example:
            >>> base = CameraFacts(fov_deg=40, focus_distance_mm=900)
            >>> base.completed_by(CameraFacts(focal_length_mm=50, sensor_size_mm=36)).known()
            {'focal_length_mm': 50.0, 'sensor_size_mm': 36.0, 'focus_distance_mm': 900.0}
        """
        mine, theirs = self.known(), other.known()
        for ours, replaced_by in (
            ("fov_deg", ("focal_length_mm", "sensor_size_mm")),
            ("focal_length_mm", ("fov_deg",)),
            ("sensor_size_mm", ("fov_deg",)),
            ("baseline_mm", ("baseline_focal_mm_px",)),
            ("baseline_focal_mm_px", ("baseline_mm",)),
        ):
            if any(name in theirs for name in replaced_by):
                mine.pop(ours, None)
        return camera_facts(mine | theirs, "camera")

    def of_every(self, step: float) -> CameraFacts:
        """Those of every `step`-th view, which stand so much farther apart.

        Example:
            >>> CameraFacts(baseline_mm=10).of_every(2).baseline_mm
            20.0
        """
        lengths = {
            "baseline_mm": self.baseline_mm,
            "baseline_focal_mm_px": self.baseline_focal_mm_px,
        }
        changed = {name: step * mm for name, mm in lengths.items() if mm is not None}
        return self.model_copy(update=changed)

    @property
    def has_view(self) -> bool:
        """Whether the field of view is known, which says how wide things are."""
        return self._focal_per_size is not None

    def camera(self, size: tuple[int, int], *, metric_depth_only: bool = False) -> Camera:
        """The camera of views of `size` = (height, width).

        Args:
            size: of the disparity map it is for.
            metric_depth_only: only `Camera.depth_mm` will be asked: where the field of view is
                unknown but not needed for that, any will do.

        Raises:
            InputError: everything that is missing, or views of another size.
        """
        height, width = size
        focal_per_size = self._focal_per_size
        if focal_per_size is None and metric_depth_only and self.baseline_focal_mm_px is not None:
            focal_per_size = 1.0
        problems = [*self._missing(focal_per_size), *self._another_size(size)]
        if problems:
            raise InputError(problems)
        assert focal_per_size is not None and self.focus_distance_mm is not None
        sensor_mm = self.sensor_size_mm or 1.0
        baseline_mm = self.baseline_mm
        if baseline_mm is None:
            assert self.baseline_focal_mm_px is not None
            baseline_mm = self.baseline_focal_mm_px / (focal_per_size * max(size))
        return Camera(
            focal_length_mm=focal_per_size * sensor_mm,
            sensor_size_mm=sensor_mm,
            baseline_mm=baseline_mm,
            focus_distance_mm=self.focus_distance_mm,
            width_px=width,
            height_px=height,
        )

    @property
    def _focal_per_size(self) -> float | None:
        """Focal length over the sensor's longer side."""
        if self.fov_deg is not None:
            return 0.5 / math.tan(math.radians(self.fov_deg) / 2)
        if self.focal_length_mm is None or self.sensor_size_mm is None:
            return None
        return self.focal_length_mm / self.sensor_size_mm

    def _missing(self, focal_per_size: float | None) -> list[str]:
        problems = []
        if self.focus_distance_mm is None:
            problems.append("the distance of disparity 0 (--focus-mm)")
        if self.baseline_mm is None and self.baseline_focal_mm_px is None:
            problems.append("the distance between adjacent views (--baseline-mm)")
        if focal_per_size is None:
            problems.append("the field of view (--fov, or --focal-length-mm and --sensor-mm)")
        if not problems:
            return []
        return [
            f"the camera is not known well enough; missing: {'; '.join(problems)}. Give them, or a "
            "file that holds them (--camera); epinet calibrate makes one from known distances"
        ]

    def _another_size(self, size: tuple[int, int]) -> list[str]:
        height, width = size
        if (self.width_px or width, self.height_px or height) == (width, height):
            return []
        return [
            f"the camera is that of views of {self.width_px}x{self.height_px} px, the disparity "
            f"map has {width}x{height} px; give the --camera of these views"
        ]


def facts_of(camera: Camera) -> CameraFacts:
    """All that a camera says."""
    known = {name: getattr(camera, name) for name in _CAMERA_FIELDS}
    return camera_facts({k: v for k, v in known.items() if k in CameraFacts.model_fields}, "camera")


def camera_facts(values: Mapping[str, Any], origin: object) -> CameraFacts:
    """Facts from names and values.

    Raises:
        InputError: each value that cannot be, naming `origin`.
    """
    return validated(CameraFacts, values, origin)


def read_camera(path: str | Path) -> CameraFacts:
    """Read a camera file: JSON, YAML or a benchmark scene's parameters.cfg, by its ending.

    Raises:
        InputError: no such file, another ending, or values that cannot be.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == _CFG:
        camera = read_parameters(path).camera
        if camera is None:
            raise InputError(f"{path}: says nothing about the camera")
        return facts_of(camera)
    if suffix not in (_JSON, *_YAML):
        raise InputError(f"{path}: a camera file ends in .json, .yaml, .yml or .cfg")
    with parsing(path, "a camera file"):
        data = read_bytes(path, JSON_BYTES)
        values = parse_json(data, path) if suffix == _JSON else parse_yaml(data, path)
    if not isinstance(values, dict):
        raise InputError(f"{path}: a camera file holds names and values, such as baseline_mm: 11")
    return camera_facts(values, path)


def write_camera(path: str | Path, facts: CameraFacts) -> None:
    """Write a camera file, JSON or YAML by its ending.

    Raises:
        InputError: another ending, or an unwritable path.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (_JSON, *_YAML):
        raise InputError(f"{path}: a camera file to write ends in .json, .yaml or .yml")
    if suffix in _YAML:
        text = yaml.safe_dump(facts.known(), sort_keys=False)
    else:
        text = facts.as_json() + "\n"
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
