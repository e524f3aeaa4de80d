"""Where the methods stand beside the published ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.published import METRICS, PUBLISHED
from epinet.benchmark.scenes import BENCHMARK_SCENES, BENCHMARK_SIDE_PX
from epinet.metrics.disparity import BORDER_PX
from epinet.metrics.general import OF_ESTIMATES, RUNTIME


@dataclass(frozen=True)
class Row:
    """A method's figures of one metric."""

    method: str
    ours: bool
    """Scored here; otherwise published."""
    values: tuple[float | None, ...]
    """By scene, in the order of the ranking's."""
    mean: float
    rank: int
    """From 1; equal means share one."""


@dataclass(frozen=True)
class Ranking:
    """All methods by one metric, the best first."""

    metric: str
    """Its id."""
    scenes: tuple[str, ...]
    """Over which the mean is taken."""
    rows: tuple[Row, ...]
    unranked: tuple[str, ...] = ()
    """Methods without an estimate of all pixels, by a metric that passes over those."""


@dataclass(frozen=True)
class Point:
    """A method's mean accuracy and run time."""

    method: str
    ours: bool
    seconds: float
    value: float


def common_scenes(evaluation: Evaluation) -> tuple[str, ...]:
    """The scenes scored here that have published figures; told by name and size."""
    side = BENCHMARK_SIDE_PX
    here = {scene.name for scene in evaluation.scenes if scene.size == (side, side)}
    return tuple(name for name in BENCHMARK_SCENES if name in here)


def caveats(evaluation: Evaluation) -> list[str]:
    """Why scores here and published ones may differ for other reasons than the methods."""
    found = []
    if evaluation.border_px != BORDER_PX:
        found.append(
            f"The published figures leave out {BORDER_PX} px, these {evaluation.border_px} px."
        )
    unlike = {
        scene
        for (_, scene, metric), score in evaluation.scores.items()
        if metric in METRICS and not score.official
    }
    low = [scene for scene in common_scenes(evaluation) if scene in unlike]
    if low:
        found.append(
            f"On {', '.join(low)} the scores here are against truth of low resolution, for want of "
            "the high one: they come out lower than the official ones by that alone."
        )
    return found


def ranking(evaluation: Evaluation, metric: str) -> Ranking | None:
    """All methods on the common scenes, or the evaluation's own on all where none is common.

    None where there is nobody to compare with.
    """
    common = common_scenes(evaluation)
    scenes = common or tuple(scene.name for scene in evaluation.scenes)
    found: list[tuple[str, bool, tuple[float | None, ...], float]] = []
    unranked = unranked_methods(evaluation, metric, scenes)
    for method in evaluation.methods:
        if method.name in unranked:
            continue
        values = [evaluation.scores[method.name, scene, metric].value for scene in scenes]
        known = [value for value in values if value is not None]
        if len(known) == len(scenes):
            found.append((method.name, True, tuple(values), fmean(known)))
    for other in PUBLISHED if common else ():
        mean = other.mean(metric, scenes)
        if mean is not None:
            each = tuple(other.scores.get(scene, {}).get(metric) for scene in scenes)
            found.append((other.name, False, each, mean))
    if len(found) < 2:
        return None
    means = [mean for *_, mean in found]
    rows = [
        Row(name, ours, values, mean, 1 + sum(other < mean for other in means))
        for name, ours, values, mean in found
    ]
    return Ranking(metric, scenes, tuple(sorted(rows, key=lambda row: row.mean)), unranked)


def unranked_methods(
    evaluation: Evaluation, metric: str, scenes: Sequence[str] = ()
) -> tuple[str, ...]:
    """Methods that lack estimates which the metric passes over: what is left may be the easy part.

    Args:
        metric: its id.
        scenes: names of those that count; none means all.
    """
    if metric not in {of_estimates.id for of_estimates in OF_ESTIMATES}:
        return ()
    counted = [s for s in evaluation.scenes if not scenes or s.name in scenes]
    return tuple(m.name for m in evaluation.methods if not evaluation.is_complete(m, counted))


def rankings(evaluation: Evaluation) -> list[Ranking]:
    """By each metric that is scored here and has published figures."""
    found = (ranking(evaluation, metric) for metric in METRICS if evaluation.metric(metric))
    return [each for each in found if each is not None]


def accuracy_and_time(evaluation: Evaluation, metric: str) -> list[Point]:
    """Methods ranked by the metric whose run time is known: means over the common scenes.

    Where no scene is common, ours are over our scenes and the published over the site's twelve:
    two different things, to be told apart by whoever shows them. Empty where the metric or the
    run time was not asked for.
    """
    common = common_scenes(evaluation)
    scenes = [scene for scene in evaluation.scenes if not common or scene.name in common]
    accuracy, runtime = evaluation.metric(metric), evaluation.metric(RUNTIME.id)
    if accuracy is None or runtime is None:
        return []
    points = []
    unranked = unranked_methods(evaluation, metric, [scene.name for scene in scenes])
    for method in evaluation.methods:
        value, scored = evaluation.mean(method, accuracy, scenes)
        seconds, timed = evaluation.mean(method, runtime, scenes)
        whole = scored == timed == len(scenes) and method.name not in unranked
        if value is not None and seconds is not None and whole:
            points.append(Point(method.name, True, seconds, value))
    for other in PUBLISHED:
        published = other.mean(metric, common or BENCHMARK_SCENES)
        if published is not None and other.seconds is not None:
            points.append(Point(other.name, False, other.seconds, published))
    return points


def run_times(evaluation: Evaluation) -> list[tuple[str, bool, float]]:
    """(method, scored here, mean seconds a scene), the fastest first."""
    runtime = evaluation.metric(RUNTIME.id)
    times = [(other.name, False, other.seconds) for other in PUBLISHED]
    if runtime is not None:
        times += [
            (method.name, True, evaluation.mean(method, runtime)[0])
            for method in evaluation.methods
        ]
    known = ((name, ours, seconds) for name, ours, seconds in times if seconds is not None)
    return sorted(known, key=lambda each: each[2])
