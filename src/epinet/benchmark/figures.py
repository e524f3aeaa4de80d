"""The paper's figures of accuracy, rank and run time, as SVG to stand inside a page, or as PDF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from matplotlib.transforms import Bbox

from epinet.benchmark.standing import Point, Ranking
from epinet.benchmark.table import score_text
from epinet.predict.pictures import drawable


class Drawn(NamedTuple):
    """A figure in two formats."""

    svg: str
    """To stand inside a page."""
    pdf: bytes
    """A file of its own, for a paper."""


OURS, THEIRS = "#c2410c", "#64748b"
LETTER_PX = 6.4
"""About the width of a letter of the points' names, at 72 dots per inch."""
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "epinet",
    "font.family": "sans-serif",
    "font.sans-serif": ["Inter", "Segoe UI", "Helvetica", "Arial", "DejaVu Sans"],
    "font.size": 11,
    "figure.dpi": 72,
    "text.color": "#0f172a",
    "axes.labelcolor": "#475569",
    "xtick.color": "#475569",
    "ytick.color": "#475569",
    "axes.edgecolor": "#94a3b8",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "text.parse_math": False,
}


def accuracy_against_time(
    panels: Sequence[tuple[str, Sequence[Point]]], *, comparable: bool
) -> Drawn:
    """The paper's figure 1: a panel for each metric, run time on a logarithmic axis.

    Args:
        panels: the metric's name and the methods.
        comparable: whether ours and the published stand for the same scenes; published ones that
            do not are drawn hollow.
    """
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(4.15 * len(panels), 3.7), layout="constrained")
        row = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (name, points) in zip(row, panels, strict=True):
            for point in points:
                colour = OURS if point.ours else THEIRS
                axes.scatter(
                    point.seconds,
                    point.value,
                    s=64,
                    facecolor=colour if point.ours or comparable else "white",
                    edgecolor=colour,
                    linewidth=1.6,
                    zorder=3,
                )
            highest = max(point.value for point in points)
            axes.set_ylim(-0.08 * highest, 1.2 * highest)
            _seconds_axis(axes, [point.seconds for point in points])
            axes.set_xlabel("run time (s)")
            axes.set_title(name, loc="left")
            axes.grid(color="#e2e8f0", zorder=0)
        figure.draw_without_rendering()  # places the axes, which the names must not move
        figure.set_layout_engine("none")
        for axes, (_, points) in zip(row, panels, strict=True):
            _label_points(axes, points)
        return _drawn(figure)


def ranks(rankings: Sequence[Ranking], names: dict[str, str]) -> Drawn:
    """The paper's figure 7: the methods by their means, a panel for each metric.

    Args:
        rankings: one for each metric.
        names: of the metrics by their ids.
    """
    most = max(len(ranking.rows) for ranking in rankings)
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(12.9, 0.32 * most + 0.9), layout="constrained")
        panels = figure.subplots(1, len(rankings), squeeze=False)[0]
        for axes, ranking in zip(panels, rankings, strict=True):
            bars = [(row.method, row.ours, row.mean) for row in ranking.rows]
            _bars(axes, bars, most)
            axes.set_title(names[ranking.metric], loc="left")
        return _drawn(figure)


def run_time_bars(times: Sequence[tuple[str, bool, float]]) -> Drawn:
    """The paper's figure 8: (method, scored here, seconds) on a logarithmic axis."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(4.4, max(3.7, 0.3 * len(times) + 0.9)), layout="constrained")
        axes = figure.subplots()
        _bars(axes, times, len(times))
        _seconds_axis(axes, [seconds for *_, seconds in times])
        axes.set_xlabel("run time (s)")
        return _drawn(figure)


def _seconds_axis(axes: Axes, seconds: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(min(seconds) / 5, max(seconds) * 6)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _bars(axes: Axes, bars: Sequence[tuple[str, bool, float]], most: int) -> None:
    """Bars from the top, with room for `most`; names to the left, figures at their ends."""
    for i, (name, ours, value) in enumerate(bars):
        colour = OURS if ours else THEIRS
        axes.barh(i, value, color=colour, height=0.66)
        axes.annotate(
            score_text(value),
            (value, i),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=10,
        )
        axes.annotate(
            drawable(name),
            (0, i),
            (-6, 0),
            ("axes fraction", "data"),
            "offset points",
            parse_math=False,
            va="center",
            ha="right",
            color=colour,
            fontweight="bold" if ours else "normal",
        )
    axes.set_yticks([])
    axes.set_ylim(most - 0.4, -0.6)
    axes.margins(x=0.3)


def _label_points(axes: Axes, points: Sequence[Point]) -> None:
    """Names beside the points, on the first side where they cover no point and no other name."""
    places = [axes.transData.transform((point.seconds, point.value)) for point in points]
    taken = [Bbox.from_bounds(x - 5, y - 5, 10, 10) for x, y in places]
    ordered = sorted(zip(points, places, strict=True), key=lambda each: not each[0].ours)
    for point, (x, y) in ordered:
        width = LETTER_PX * len(point.method)
        choices = [
            (x + 8, y - 6),
            (x - width / 2, y + 8),
            (x - width / 2, y - 21),
            (x - width - 8, y - 6),
            (x + 8, y + 10),
            (x + 8, y - 22),
            (x - width / 2, y + 22),
        ]
        boxes = [Bbox.from_bounds(left, bottom, width, 12) for left, bottom in choices]
        inside = [box for box in boxes if box.x0 >= axes.bbox.x0 and box.x1 <= axes.bbox.x1]
        box = next((b for b in inside if not b.count_overlaps(taken)), boxes[0])
        taken.append(box)
        axes.annotate(
            drawable(point.method),
            (point.seconds, point.value),
            (box.x0 - x, box.y0 - y),
            parse_math=False,
            textcoords="offset points",
            va="bottom",
            fontsize=10,
            color=OURS if point.ours else "#334155",
            fontweight="bold" if point.ours else "normal",
        )


def _drawn(figure: Figure) -> Drawn:
    svg, pdf = io.StringIO(), io.BytesIO()
    figure.savefig(svg, format="svg", transparent=True, metadata={"Date": None})
    figure.savefig(pdf, format="pdf", transparent=True, metadata={"CreationDate": None})
    text = svg.getvalue()
    return Drawn(text[text.index("<svg") :], pdf.getvalue())
