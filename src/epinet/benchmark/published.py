"""Published figures of other methods on the benchmark's scenes.

Scores are the official site's (lightfield-analysis.uni-konstanz.de), as the methods' papers and
the site state them, against official truth: that of 10 times the resolution on backgammon, dots
and stripes. Run times are the authors' own, each on their own machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from epinet.benchmark.scenes import BENCHMARK_SCENES

METRICS = ("badpix_0.07", "badpix_0.03", "badpix_0.01", "mse_x100")
"""Ids of the metrics whose figures are known, in the order of the tables below."""


@dataclass(frozen=True)
class Published:
    """A method's published figures; what is not known is not there."""

    name: str
    source: str
    scores: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """By scene, then by the metric's id."""
    means: Mapping[str, float] = field(default_factory=dict)
    """Of the 12 scenes, by the metric's id."""
    seconds: float | None = None
    """Run time for one scene of 9x9 views of 512x512 px."""

    def mean(self, metric: str, scenes: tuple[str, ...]) -> float | None:
        """Mean over these scenes; None where one of them is not known."""
        if set(scenes) == set(BENCHMARK_SCENES) and metric in self.means:
            return self.means[metric]
        values = [self.scores.get(scene, {}).get(metric) for scene in scenes]
        known = [value for value in values if value is not None]
        return sum(known) / len(known) if known and len(known) == len(scenes) else None


def _table(rows: str, metrics: tuple[str, ...] = METRICS) -> dict[str, dict[str, float]]:
    """Lines of a scene and its figures."""
    lines = [line.split() for line in rows.strip().splitlines()]
    return {name: dict(zip(metrics, map(float, figures), strict=True)) for name, *figures in lines}


def _means(*figures: float) -> dict[str, float]:
    return dict(zip(METRICS, figures, strict=True))


_EPINET = "Shin et al., EPINET, CVPR 2018, and its entry on the benchmark's site"

PUBLISHED = (
    Published(
        "Epinet-fcn",
        _EPINET,
        _table(
            """
            backgammon 3.580 3.629
            dots       3.183 1.635
            pyramids    .192  .008
            stripes    2.462  .950
            boxes     12.84  6.240
            cotton      .508  .191
            dino       1.286  .167
            sideboard  4.801  .827
            bedroom    2.403  .213
            bicycle    9.896 4.682
            herbs     12.10  9.700
            origami    5.918 1.466
            """,
            ("badpix_0.07", "mse_x100"),
        ),
        _means(4.931, 10.745, 34.99, 2.476),
        2.0,
    ),
    Published(
        "Epinet-fcn9x9",
        _EPINET,
        _table(
            """
            backgammon 3.287  4.482 15.39  3.909
            dots       4.030 18.70  44.64  1.980
            pyramids    .147   .604  8.913  .007
            stripes    2.413  2.876 14.75   .915
            boxes     12.25  18.66  45.73  6.036
            cotton      .464  2.217 25.27   .223
            dino       1.263  3.221 23.44   .151
            sideboard  4.783 11.82  40.49   .806
            bedroom    2.287  6.291 31.23   .231
            bicycle    9.853 17.19  43.85  4.929
            herbs     17.75  34.54  59.86  9.423
            origami    6.339 13.92  42.17  1.646
            """
        ),
        _means(5.405, 11.21, 32.98, 2.521),
        2.0,
    ),
    Published(
        "Epinet-fcn-m",
        _EPINET,
        _table(
            """
            backgammon 3.501  5.563 19.43  3.705
            dots       2.490  9.117 35.61  1.475
            pyramids    .159   .874 11.42   .007
            stripes    2.457  2.711 11.77   .932
            boxes     12.34  18.11  46.09  5.968
            cotton      .447  2.076 25.72   .197
            dino       1.207  3.105 19.39   .157
            sideboard  4.462 10.86  36.49   .798
            bedroom    2.299  6.345 31.82   .204
            bicycle    9.614 16.83  42.83  4.603
            herbs     10.96  25.85  59.93  9.491
            origami    5.807 13.00  42.21  1.478
            """
        ),
        _means(4.645, 9.537, 31.89, 2.418),
        10.65,
    ),
    Published(
        "LFattNet",
        "Tsai et al., LFattNet, AAAI 2020, and its entry on the benchmark's site",
        _table(
            """
            backgammon 3.126  3.985 11.58  3.648
            dots       1.432  3.012 15.05  1.425
            pyramids    .195   .488  2.063  .004
            stripes    2.933  5.417 18.21   .892
            boxes     11.04  18.97  37.04  3.996
            cotton      .271   .697  3.644  .209
            dino        .848  2.339 12.22   .093
            sideboard  2.869  7.243 20.73   .530
            bedroom    2.792  5.318 13.33   .366
            bicycle    9.511 15.99  31.35  3.350
            herbs      5.219  9.483 19.27  6.605
            origami    4.824  8.925 22.19  1.733
            """
        ),
        _means(3.755, 6.822, 17.22, 1.904),
        5.5,
    ),
    Published(
        "OccCasNet",
        "Chao et al., OccCasNet",
        means=_means(2.859, 5.238, 13.523, 1.554),
    ),
    Published(
        "SubFocal-L",
        "Chao et al., SubFocal",
        means=_means(2.735, 4.697, 12.845, 1.581),
    ),
    Published("FastLFnet", "Huang et al., FastLFnet, ICCV 2021", seconds=0.62),
    Published("SPO", "Zhang et al., spinning parallelogram operator, CVIU 2016", seconds=2140.0),
    Published("PS_RF", "the benchmark's site", seconds=1413.0),
)

CLAIM = (
    "EPINET's paper calls it first on 3 of its 4 measures, and 85 times faster than the runner-up, "
    "OBER-cross+ANP."
)
MISSING = (
    "Not at hand, and so not shown, are the figures of OBER-cross+ANP and of most other rivals in "
    "the paper's figures 1, 7 and 8, the scores of FastLFnet, SPO and PS_RF, and the run times of "
    "OccCasNet and SubFocal-L."
)
