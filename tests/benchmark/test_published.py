"""The published figures agree with themselves."""

import re

import pytest

from epinet.benchmark.published import METRICS, MISSING, PUBLISHED
from epinet.benchmark.scenes import BENCHMARK_SCENES


def complete():
    for method in PUBLISHED:
        for metric in METRICS:
            values = [method.scores.get(scene, {}).get(metric) for scene in BENCHMARK_SCENES]
            if None not in values:
                yield method, metric, values


@pytest.mark.parametrize(
    ("method", "metric", "values"),
    [pytest.param(*each, id=f"{each[0].name}-{each[1]}") for each in complete()],
)
def test_means_are_those_of_the_scenes(method, metric, values):
    """To the four digits that are published."""
    assert sum(values) / 12 == pytest.approx(method.means[metric], rel=3e-4)


def test_a_mean_needs_every_scene():
    fcn = next(method for method in PUBLISHED if method.name == "Epinet-fcn")
    assert fcn.mean("badpix_0.07", ("boxes", "cotton")) == pytest.approx((12.84 + 0.508) / 2)
    assert fcn.mean("badpix_0.07", ("boxes", "antinous")) is None
    assert fcn.mean("badpix_0.03", ("boxes",)) is None
    assert fcn.mean("badpix_0.03", BENCHMARK_SCENES) == 10.745


def test_what_is_not_at_hand_is_named():
    """Methods without scores or run time; the page says so beside the table."""
    scores, times = MISSING.split(", the scores of ")[1].split(", and the run times of ")
    assert {m.name for m in PUBLISHED if not m.means} == set(re.split(", | and ", scores))
    assert {m.name for m in PUBLISHED if m.seconds is None} == set(times.rstrip(".").split(" and "))
