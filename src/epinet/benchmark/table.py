"""An evaluation as a table for the terminal, as CSV and as JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

from epinet import __version__
from epinet.benchmark.evaluate import Evaluation
from epinet.metrics.general import RUNTIME
from epinet.metrics.metric import Metric

COLUMNS = 9
"""Metrics side by side; more go into a table below."""
OTHER_TRUTH = "*"
"""Marks a score whose truth is of another resolution than the benchmark's."""
ABSENT = "-"


def text_tables(evaluation: Evaluation) -> str:
    """Every score that there is, by scene and method, as lines that are never cut."""
    metrics = [m for m in evaluation.metrics if _any_value(evaluation, m)]
    chunks = [metrics[i : i + COLUMNS] for i in range(0, len(metrics), COLUMNS)]
    tables = ["\n".join(_aligned(_rows(evaluation, chunk))) for chunk in chunks]
    return "\n\n".join([*tables, "\n".join(_remarks(evaluation))])


def as_csv(evaluation: Evaluation) -> str:
    """One line a score: method, scene, metric, value, unit, truth, why there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["method", "scene", "metric", "value", "unit", "truth", "border_px", "absent"])
    units = {metric.id: metric.unit for metric in evaluation.metrics}
    for (method, scene, metric), score in sorted(evaluation.scores.items()):
        value = "" if score.value is None else repr(score.value)
        writer.writerow(
            [
                *(method, scene, metric, value, units[metric], score.truth or ""),
                *(evaluation.border_px, score.absent),
            ]
        )
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


def _any_value(evaluation: Evaluation, metric: Metric) -> bool:
    return any(
        score.value is not None
        for (*_, id_), score in evaluation.scores.items()
        if id_ == metric.id
    )


def _rows(evaluation: Evaluation, metrics: Sequence[Metric]) -> list[list[str]]:
    """A table of some metrics; scenes that have none of them are left out."""
    rows = [["scene", "method", *(metric.name for metric in metrics)]]
    scenes = 0
    for scene in evaluation.scenes:
        block = []
        for method in evaluation.methods:
            scores = [evaluation.scores[method.name, scene.name, m.id] for m in metrics]
            marks = ["" if s.official else OTHER_TRUTH for s in scores]
            texts = [
                score_text(s.value) + (mark if s.value is not None else "")
                for s, mark in zip(scores, marks, strict=True)
            ]
            if any(s.value is not None for s in scores):
                block.append([scene.name, method.name, *texts])
        rows += block
        scenes += bool(block)
    if scenes > 1:
        for method in evaluation.methods:
            means = [evaluation.mean(method, metric)[0] for metric in metrics]
            rows.append(["mean", method.name, *map(score_text, means)])
    return rows


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


def _remarks(evaluation: Evaluation) -> list[str]:
    remarks = [f"Border left out: {evaluation.border_px} px. Lower is better."]
    truths = {(s.truth, s.official) for s in evaluation.scores.values() if s.value is not None}
    if any(resolution == "high" for resolution, _ in truths):
        remarks.append("Truth of high resolution was used for some scores: see CSV or JSON.")
    if any(not official for _, official in truths):
        remarks.append(
            f"{OTHER_TRUTH} against the low-resolution truth, where the benchmark's site takes the "
            "high one."
        )
    return remarks


def _document(evaluation: Evaluation) -> dict[str, Any]:
    scores: dict[str, dict[str, dict[str, Any]]] = {}
    for (method, scene, metric), score in evaluation.scores.items():
        entry: dict[str, Any] = {"value": score.value}
        if score.value is None:
            entry["absent"] = score.absent
        elif metric != RUNTIME.id:
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
        "scores": scores,
        "means": {
            method.name: {
                metric.id: dict(
                    zip(("value", "scenes"), evaluation.mean(method, metric), strict=True)
                )
                for metric in evaluation.metrics
                if evaluation.mean(method, metric)[1]
            }
            for method in evaluation.methods
        },
    }


def _metric(metric: Metric) -> dict[str, Any]:
    return {
        "name": metric.name,
        "unit": metric.unit,
        "definition": metric.definition,
        "source": metric.source,
        "masks": list(metric.masks),
    }
