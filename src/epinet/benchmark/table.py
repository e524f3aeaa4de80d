"""An evaluation as a table for the terminal, as CSV and as JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from epinet import __version__
from epinet.benchmark.evaluate import Evaluation, Method, Score
from epinet.metrics.metric import Metric

COLUMNS = 9
"""Metrics side by side; more go into a table below."""
WIDEST = 100
"""Characters of a line on a terminal, as long as names leave room for one metric."""
OTHER_TRUTH = "*"
"""Marks a score whose truth is of another resolution than the benchmark's."""
HIGH_TRUTH = "^"
"""Marks a score whose truth is of the high resolution."""
ABSENT = "-"


@dataclass(frozen=True)
class Table:
    """Some metrics' scores as text; each row begins with scene and method."""

    metrics: tuple[Metric, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def header(self) -> tuple[str, ...]:
        """Names of the columns."""
        return "scene", "method", *(metric.name for metric in self.metrics)


def score_tables(evaluation: Evaluation) -> list[Table]:
    """Every score that there is, by scene and method, and the means over scenes."""
    metrics = scored_metrics(evaluation)
    chunks = [tuple(metrics[i : i + COLUMNS]) for i in range(0, len(metrics), COLUMNS)]
    return [Table(chunk, tuple(_rows(evaluation, chunk))) for chunk in chunks]


def text_tables(evaluation: Evaluation) -> list[str]:
    """The tables as lines that are never cut, as many metrics in each as fit into `WIDEST`."""
    lines: list[str] = []
    metrics = tuple(scored_metrics(evaluation))
    while metrics:
        for count in range(min(COLUMNS, len(metrics)), 0, -1):
            table = Table(metrics[:count], tuple(_rows(evaluation, metrics[:count])))
            units = ("", "", *(metric.unit for metric in table.metrics))
            text = _aligned([table.header, units, *table.rows])
            if max(map(len, text)) <= WIDEST:
                break
        lines += [*text, ""]
        metrics = metrics[count:]
    remark = (
        f"Border left out: {evaluation.border_px} px. Lower is better. {truths_used(evaluation)} "
        f"{ranges_used(evaluation)}{partial_means(evaluation)}"
    )
    return [*lines, *wrap(remark, WIDEST, break_long_words=False)]


def partial_means(evaluation: Evaluation) -> str:
    """What a number behind a mean says; nothing where there is none."""
    means = [
        evaluation.mean(m, metric) for m in evaluation.methods for metric in evaluation.metrics
    ]
    number = len(evaluation.scenes)
    if all(count in (0, number) for _, count in means):
        return ""
    return f" A mean with a number, as in 1.00 (2), is over so many of the {number} scenes."


def truths_used(evaluation: Evaluation) -> str:
    """Which truth the scores stand against, in words."""
    known = [
        score
        for score in evaluation.scores.values()
        if score.value is not None and score.truth is not None
    ]
    high = sum(score.truth == "high" for score in known)
    text = (
        f"{high} of the {len(known)} scores, marked {HIGH_TRUTH}, are against truth of high "
        "resolution."
        if high
        else "All scores are against truth of low resolution."
    )
    if not all(score.official for score in known):
        text += f" {OTHER_TRUTH}: the benchmark's site takes the high one there."
    return text


def ranges_used(evaluation: Evaluation) -> str:
    """Which methods' maps were kept within the range of disparities that is stated, in words."""
    maps = {m.name: [m.maps[s.name].bounded for s in evaluation.scenes] for m in evaluation.methods}
    return ranges_text(maps)


def ranges_text(bounded: Mapping[str, Sequence[bool | None]]) -> str:
    """The same of any maps.

    Args:
        bounded: by method, of each of its maps; None where it is not recorded.

    >>> ranges_text({"ours": [True, False], "theirs": [None, None]})
    'Maps kept within the stated range of disparities: 1 of 2 of ours, not recorded of theirs.'
    """
    parts = []
    for method, each in bounded.items():
        kept = each.count(True)
        if None in each:
            count = "not recorded"
        elif kept in (0, len(each)):
            count = "all" if kept else "none"
        else:
            count = f"{kept} of {len(each)}"
        parts.append(f"{count} of {method}")
    return f"Maps kept within the stated range of disparities: {', '.join(parts)}."


def as_csv(evaluation: Evaluation) -> str:
    """One line a score: method, scene, metric, value, unit, truth, why there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["method", "scene", "metric", "value", "unit", "truth", "border_px", "absent"])
    units = {metric.id: metric.unit for metric in evaluation.metrics}
    for (method, scene, metric), score in sorted(evaluation.scores.items()):
        value = "" if score.value is None else repr(score.value)
        truth = score.truth or ""
        border = evaluation.border_px
        writer.writerow([method, scene, metric, value, units[metric], truth, border, score.absent])
    return out.getvalue()


def as_json(evaluation: Evaluation) -> str:
    """Everything: the metrics' definitions, the scenes, the methods, their scores and means."""
    return json.dumps(_document(evaluation), indent=1, allow_nan=False) + "\n"


def score_text(value: float | None) -> str:
    """With at least two decimals, and three digits of a small value.

    >>> score_text(12.345), score_text(0.00712), score_text(None)
    ('12.35', '0.00712', '-')
    """
    if value is None:
        return ABSENT
    if value == 0 or abs(value) >= 1:
        return f"{value:.2f}"
    return f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.5f}"


def scored_metrics(evaluation: Evaluation) -> list[Metric]:
    """The metrics that there is any score of."""
    scored = {id_ for (*_, id_), score in evaluation.scores.items() if score.value is not None}
    return [metric for metric in evaluation.metrics if metric.id in scored]


def _rows(evaluation: Evaluation, metrics: Sequence[Metric]) -> list[tuple[str, ...]]:
    """Scenes that have none of the metrics are left out."""
    rows: list[tuple[str, ...]] = []
    for scene in evaluation.scenes:
        for method in evaluation.methods:
            scores = [evaluation.scores[method.name, scene.name, m.id] for m in metrics]
            if any(score.value is not None for score in scores):
                rows.append((scene.name, method.name, *map(marked, scores)))
    if len({scene for scene, *_ in rows}) > 1:
        for method in evaluation.methods:
            means = [mean_text(evaluation, method, metric) for metric in metrics]
            rows.append(("mean", method.name, *means))
    return rows


def mean_text(evaluation: Evaluation, method: Method, metric: Metric) -> str:
    """A mean over scenes, marked where it is not over all or not against the site's truth."""
    mean, count = evaluation.mean(method, metric)
    mark = "" if mean is None or evaluation.is_official(method, metric) else OTHER_TRUTH
    over = "" if count in (0, len(evaluation.scenes)) else f" ({count})"
    return score_text(mean) + mark + over


def marked(score: Score) -> str:
    """A score, marked where its truth is of high resolution, or not of the site's."""
    if score.value is None:
        return ABSENT
    mark = HIGH_TRUTH if score.truth == "high" else "" if score.official else OTHER_TRUTH
    return score_text(score.value) + mark


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines: names to the left, figures to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if i < 2 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def _document(evaluation: Evaluation) -> dict[str, Any]:
    scores: dict[str, dict[str, dict[str, Any]]] = {}
    for (method, scene, metric), score in evaluation.scores.items():
        entry: dict[str, Any] = {"value": score.value}
        if score.value is None:
            entry["absent"] = score.absent
        elif score.truth is not None:
            entry |= {"truth": score.truth, "truth_as_on_the_site": score.official}
        scores.setdefault(method, {}).setdefault(scene, {})[metric] = entry
    return {
        "epinet": __version__,
        "border_px": evaluation.border_px,
        "metrics": {m.id: _metric(m) for m in evaluation.metrics},
        "scenes": {
            scene.name: {
                "folder": str(scene.folder.resolve()),
                "size_px": {"height": scene.size[0], "width": scene.size[1]},
            }
            for scene in evaluation.scenes
        },
        "methods": {method.name: method.source for method in evaluation.methods},
        "kept_within_stated_range": {
            method.name: {
                scene.name: method.maps[scene.name].bounded for scene in evaluation.scenes
            }
            for method in evaluation.methods
        },
        "scores": scores,
        "means": {method.name: _means(evaluation, method) for method in evaluation.methods},
    }


def _means(evaluation: Evaluation, method: Method) -> dict[str, dict[str, float | None]]:
    means = {metric.id: evaluation.mean(method, metric) for metric in evaluation.metrics}
    return {id_: {"value": mean, "scenes": count} for id_, (mean, count) in means.items() if count}


def _metric(metric: Metric) -> dict[str, Any]:
    return {
        "name": metric.name,
        "unit": metric.unit,
        "definition": metric.definition,
        "source": metric.source,
        "masks": list(metric.masks),
    }
