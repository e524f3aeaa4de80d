"""What a set of rendered scenes is drawn from: ranges, surfaces, light and the camera's faults.

A strength of 0 turns a thing off, 1 is the default of training; what each strength bounds is
said where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from types import MappingProxyType
from typing import Any, ClassVar

from epinet.errors import InputError

RANGES_PX: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"narrow": (-1.0, 1.0), "hci": (-4.0, 4.0), "wide": (-25.0, 5.0)}
)
"""Disparities in px per adjacent view: a plenoptic camera, the HCI benchmark, a wide array."""


@dataclass(frozen=True)
class Faults:
    """Strengths of what a real camera does to the views."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}

    blur: float = 1.0
    defocus: float = 1.0
    noise: float = 1.0
    vignetting: float = 1.0
    exposure: float = 1.0
    """Differences of exposure and colour between the views."""
    gamma: float = 1.0
    misalignment: float = 1.0
    quantise: bool = True
    """Round to 8 bits."""
    full: bool = False
    """Every scene gets the whole strength; else it bounds what is drawn, which is mostly less."""

    @classmethod
    def none(cls) -> Faults:
        """A perfect camera."""
        return cls(
            blur=0,
            defocus=0,
            noise=0,
            vignetting=0,
            exposure=0,
            gamma=0,
            misalignment=0,
            quantise=False,
        )


SHARES = (
    "textureless",
    "thin",
    "reflective",
    "highlights",
    "near_lamps",
    "clutter",
    "floors",
)

MOST_SURFACES = 10_000

LATER = ("gloss", "near_lamps")
"""Options that data sets of rays-8 may not know: what they do not mention has its default."""


@dataclass(frozen=True)
class Options:
    """Everything but the seed that decides which scenes are drawn."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}

    size: tuple[int, int] = (512, 512)
    """(height, width) of a view in px."""
    disparity_px: tuple[float, float] = RANGES_PX["hci"]
    """Bounds of the surfaces' disparities, px per adjacent view."""
    views: int = 9
    """views x views viewpoints."""
    held_out: bool = False
    """Use the texture and shape families of validation, which no training scene has."""
    contrast: tuple[float, float] = (0.0, 1.0)
    """Bounds of a texture's contrast, as a share of the full one."""
    textureless: float = 0.06
    """Share of surfaces that are wholly flat in colour."""
    thin: float = 0.25
    """Share of cut-out surfaces that are wires, bars, fences, grids and the like."""
    reflective: float = 0.06
    """Share of surfaces that mirror, or let through, a second scene."""
    highlights: float = 0.25
    """Share of surfaces with a highlight that moves with the view."""
    gloss: tuple[float, float] = (6.0, 400.0)
    """Bounds of the highlights' exponents: small ones spread over all of a surface."""
    near_lamps: float = 0.0
    """Share of scenes whose lamp is near, so that its light falls off along surfaces."""
    surfaces: tuple[int, int] = (10, 40)
    """Fewest and most objects in front of the background."""
    clutter: float = 0.6
    """Share of scenes with up to three times as many more, small cut-outs."""
    floors: float = 0.0
    """Share of scenes where a floor or side wall, often a steep one, begins within the picture."""
    faults: Faults = field(default_factory=Faults)
    samples: int = 4
    """Rays per pixel and view."""

    def __post_init__(self) -> None:
        problems = []
        low, high = self.disparity_px
        if not low < high:
            problems.append(f"the disparity range {low:g}..{high:g} px is empty")
        if min(self.size) < 16:
            problems.append(f"views of {self.size[1]}x{self.size[0]} px are too small: 16 at least")
        if self.views < 3 or self.views % 2 == 0:
            problems.append(f"views must be odd and at least 3, not {self.views}")
        if not 0 <= self.surfaces[0] <= self.surfaces[1] or self.surfaces[1] < 1:
            problems.append(f"the number of surfaces {self.surfaces} is impossible")
        if self.surfaces[1] > MOST_SURFACES:
            problems.append(f"at most {MOST_SURFACES} surfaces, not {self.surfaces[1]}")
        if self.samples < 1 or self.samples != int(self.samples):
            problems.append(f"{self.samples} rays per pixel: a whole number, at least 1")
        for name in SHARES:
            if not 0 <= getattr(self, name) <= 1:
                problems.append(f"{name} is a share of 0..1, not {getattr(self, name):g}")
        if not 0 <= self.contrast[0] <= self.contrast[1] <= 1:
            problems.append(f"contrast is a range inside 0..1, not {self.contrast}")
        if not 1 <= self.gloss[0] <= self.gloss[1]:
            problems.append(f"gloss is a range from 1 on, not {self.gloss}")
        for f in fields(self.faults):
            if getattr(self.faults, f.name) < 0:
                problems.append(f"the strength of {f.name} must not be negative")
        if problems:
            raise InputError(problems)

    def as_dict(self) -> dict[str, Any]:
        """For a data set's record: without what is later than some and has its default."""
        values = asdict(self)
        usual = {name: getattr(Options, name) for name in LATER}
        return {k: v for k, v in values.items() if k not in usual or v != usual[k]}
