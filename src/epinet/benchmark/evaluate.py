"""Scoring methods' maps on scenes with truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from epinet.benchmark.maps import MapFile
from epinet.benchmark.scenes import Scene
from epinet.io.problems import Problems
from epinet.metrics.disparity import BORDER_PX
from epinet.metrics.general import MISSING, RUNTIME
from epinet.metrics.metric import Comparison, Metric, Resolution


@dataclass(frozen=True)
class Method:
    """A method to be scored."""

    name: str
    source: str
    """Where its maps come from, for people."""
    maps: Mapping[str, MapFile]
    """By the name of the scene."""


@dataclass(frozen=True)
class Score:
    """A metric's value for one method on one scene."""

    value: float | None
    """None where there is none."""
    truth: Resolution | None = None
    """Resolution of the truth that was used; None for the run time, which needs none."""
    official: bool = True
    """Whether that is the resolution that the benchmark's site uses."""
    absent: str = ""
    """Why there is no value."""


@dataclass(frozen=True)
class Evaluation:
    """Scores of methods on scenes."""

    metrics: tuple[Metric, ...]
    scenes: tuple[Scene, ...]
    methods: tuple[Method, ...]
    scores: Mapping[tuple[str, str, str], Score]
    """By the names of method and scene and the metric's id."""
    border_px: int = BORDER_PX

    def metric(self, id_: str) -> Metric | None:
        """The metric of that id; None where it was not asked for."""
        return next((metric for metric in self.metrics if metric.id == id_), None)

    def value(self, method: Method, scene: Scene, metric: Metric) -> float | None:
        """A score, None where there is none."""
        return self.scores[method.name, scene.name, metric.id].value

    def is_official(self, method: Method, metric: Metric) -> bool:
        """Whether all its scores stand against truth of the resolution that the site uses."""
        found = (self.scores[method.name, scene.name, metric.id] for scene in self.scenes)
        return all(score.official for score in found if score.value is not None)

    def is_complete(self, method: Method, scenes: Sequence[Scene] = ()) -> bool:
        """Whether it has an estimate of every pixel that is scored."""
        found = (self.scores.get((method.name, s.name, MISSING.id)) for s in scenes or self.scenes)
        return not any(score and score.value for score in found)

    def mean(
        self, method: Method, metric: Metric, scenes: Sequence[Scene] = ()
    ) -> tuple[float | None, int]:
        """Mean over those of the scenes (none: all) that have the score, and how many they are."""
        values = [self.value(method, scene, metric) for scene in scenes or self.scenes]
        known = [value for value in values if value is not None]
        return (fmean(known) if known else None), len(known)

    def estimate(self, method: Method, scene: Scene) -> NDArray[np.float32]:
        """(H, W) the method's map."""
        return method.maps[scene.name].read(scene.size)


def evaluate(
    methods: Sequence[Method],
    scenes: Sequence[Scene],
    metrics: Sequence[Metric],
    *,
    border_px: int = BORDER_PX,
    advance: Callable[[float], None] = lambda share: None,
) -> Evaluation:
    """Score every method on every scene by every metric that the scene has the masks for.

    Args:
        methods: each with a map of each scene.
        scenes: with truth.
        metrics: see `epinet.metrics.catalogue`.
        border_px: left out on each side.
        advance: called with the share of the work done since the last call.

    Raises:
        InputError: all maps, truths and masks that cannot be used.
    """
    problems = Problems()
    scores: dict[tuple[str, str, str], Score] = {}
    for scene in scenes:
        with problems.gather():
            scores |= _score_scene(methods, scene, metrics, border_px)
        advance(1 / len(scenes))
    problems.raise_any()
    return Evaluation(tuple(metrics), tuple(scenes), tuple(methods), scores, border_px)


def _score_scene(
    methods: Sequence[Method], scene: Scene, metrics: Sequence[Metric], border_px: int
) -> dict[tuple[str, str, str], Score]:
    scores: dict[tuple[str, str, str], Score] = {}
    by_resolution: dict[Resolution, list[Metric]] = {}
    for metric in metrics:
        resolution = scene.resolution(metric)
        if resolution is not None:
            by_resolution.setdefault(resolution, []).append(metric)
            continue
        absent = Score(None, absent=_why_not(scene, metric))
        scores |= {(method.name, scene.name, metric.id): absent for method in methods}
    for resolution, wanted in by_resolution.items():
        truth = scene.truth_of(resolution)
        scale = truth.shape[0] // scene.size[0]
        names = {name for metric in wanted for name in metric.masks}
        masks = scene.masks_of(names, resolution, truth.shape)
        for method in methods:
            file = method.maps[scene.name]
            estimate = enlarge(file.read(scene.size), scale)
            comparison = Comparison(
                estimate, truth, masks, border_px, scale, scene.camera, file.seconds
            )
            for metric in wanted:
                value = metric.score(comparison)
                official = resolution == scene.benchmark_resolution(metric)
                why = "" if value is not None else _why_none(scene, metric)
                used = None if metric is RUNTIME else resolution
                scores[method.name, scene.name, metric.id] = Score(value, used, official, why)
    return scores


def enlarge(map_: NDArray[np.float32], scale: int) -> NDArray[np.float32]:
    """A map with every pixel as a block of scale x scale: nearest neighbour.

    >>> enlarge(np.array([[1, 2]], np.float32), 2).tolist()
    [[1.0, 1.0, 2.0, 2.0], [1.0, 1.0, 2.0, 2.0]]
    """
    return map_ if scale == 1 else map_.repeat(scale, axis=0).repeat(scale, axis=1)


def _why_not(scene: Scene, metric: Metric) -> str:
    if metric.scene not in (None, scene.name):
        return f"only for the scene {metric.scene}"
    return f"no {' or '.join(scene.missing_masks(metric, 'low'))}"


def _why_none(scene: Scene, metric: Metric) -> str:
    if metric.id == "runtime":
        return "no run time is stated"
    if metric.needs_camera and scene.camera is None:
        return "the camera is not known (no parameters.cfg)"
    return "no pixel to measure"
