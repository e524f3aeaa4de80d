"""What a metric is, and what it looks at."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from epinet.camera import Camera
from epinet.metrics.disparity import BORDER_PX

Mask = NDArray[np.bool_] | NDArray[np.integer[Any]]
Resolution = Literal["low", "high"]

BENCHMARK = "4D Light Field Benchmark (Honauer et al., ACCV 2016)"


@dataclass(frozen=True)
class Comparison:
    """A method's map beside the truth of one scene, at one resolution.

    Example:
        >>> truth = np.zeros((40, 40))
        >>> Comparison(truth + 0.1, truth).error().shape  # 10x10 px inside the border
        (100,)
    """

    estimate: NDArray[Any]
    """(H, W) in px per adjacent view; not finite where the method has no estimate."""
    truth: NDArray[Any]
    """(H, W) in px per adjacent view; NaN where unknown."""
    masks: Mapping[str, Mask] = field(default_factory=dict)
    """(H, W) regions by name; of some, such as "boxes", the numbers of the parts."""
    border_px: int = BORDER_PX
    """Left out on each side, in pixels of the light field."""
    scale: int = 1
    """Pixels of truth, along a side, to a pixel of the light field."""
    camera: Camera | None = None
    seconds: float | None = None
    """The method's run time on the scene."""

    def __post_init__(self) -> None:
        for name, image in {"estimate": self.estimate, **self.masks}.items():
            if image.shape != self.truth.shape:
                raise ValueError(f"{name} {image.shape} and truth {self.truth.shape} differ")

    @cached_property
    def scored(self) -> NDArray[np.bool_]:
        """(H, W): inside the border and with truth."""
        scored: NDArray[np.bool_] = np.isfinite(self.truth)
        border = self.border_px * self.scale
        if border:
            scored[:border] = scored[-border:] = False
            scored[:, :border] = scored[:, -border:] = False
        return scored

    @cached_property
    def difference(self) -> NDArray[np.float64]:
        """(H, W) estimate - truth; NaN where either is missing."""
        present = np.where(np.isfinite(self.estimate), self.estimate, np.nan)
        return np.asarray(present - self.truth.astype(np.float64))

    def region(self, *masks: str) -> NDArray[np.bool_]:
        """(H, W): the pixels scored of any of these masks; without a name, all."""
        if not masks:
            return self.scored
        inside = np.any([self.masks[name] > 0 for name in masks], axis=0)
        return np.asarray(self.scored & inside)

    def error(self, *masks: str) -> NDArray[np.float64]:
        """(N,) |estimate - truth| at the pixels of a region."""
        return np.abs(self.difference[self.region(*masks)])


@dataclass(frozen=True)
class Metric:
    """A score with all that is to be known about it.

    Example:
        >>> from epinet.metrics.catalogue import benchmark_metrics
        >>> metric = benchmark_metrics()[0]
        >>> metric.name, metric.unit
        ('BadPix(.07)', '%')
        >>> metric.score(Comparison(np.full((40, 40), 0.1), np.zeros((40, 40))))
        100.0
    """

    id: str
    name: str
    unit: str
    definition: str
    compute: Callable[[Comparison], float] = field(repr=False)
    """NaN where there is nothing to measure."""
    masks: tuple[str, ...] = ()
    """Masks that it needs, by name."""
    truth: Resolution | Literal["scene"] = "low"
    """Resolution of the truth that the benchmark scores it against; "scene" leaves it to that."""
    scene: str | None = None
    """The only scene that it is meant for."""
    needs_camera: bool = False
    source: str = BENCHMARK

    def score(self, comparison: Comparison) -> float | None:
        """The score, always the lower the better; None where it cannot be had: a mask, the camera
        or the run time is not known, or no pixel is left to score.
        """
        lacks_camera = self.needs_camera and comparison.camera is None
        if lacks_camera or not set(self.masks) <= set(comparison.masks):
            return None
        value = self.compute(comparison)
        return value if isfinite(value) else None
