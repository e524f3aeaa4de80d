"""An evaluation as tables of a paper, in LaTeX: one for each metric."""

from __future__ import annotations

import re
from collections.abc import Sequence

from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.table import (
    HIGH_TRUTH,
    OTHER_TRUTH,
    marked,
    mean_text,
    scored_metrics,
    truths_used,
)
from epinet.metrics.metric import Metric

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "±": r"$\pm$",
} | {character: rf"\{character}" for character in "%_&#${}"}
_MARKS = {HIGH_TRUTH: r"$^{\wedge}$", OTHER_TRUTH: "$^{*}$"}


def escaped(text: str) -> str:
    r"""Text as LaTeX shows it; what stands between backquotes is set as code.

    >>> escaped("50 % of `--scale`")
    '50 \\% of \\texttt{-{}-scale}'
    """
    parts = [
        "".join(_SPECIAL.get(character, character) for character in part)
        for part in re.split("`([^`]*)`", text)
    ]
    parts[1::2] = [rf"\texttt{{{part.replace('--', '-{}-')}}}" for part in parts[1::2]]
    return "".join(parts)


def table(caption: str, rows: Sequence[Sequence[str]]) -> str:
    """A table of cells that are LaTeX already; the first row is its head."""
    lines = [" & ".join(row) + r" \\" for row in rows]
    return "\n".join(
        [
            r"\begin{table}",
            rf"\caption{{{escaped(caption)}}}",
            rf"\begin{{tabular}}{{l{'r' * (len(rows[0]) - 1)}}}",
            r"\hline",
            lines[0],
            r"\hline",
            *lines[1:],
            r"\hline",
            r"\end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def as_latex(evaluation: Evaluation) -> str:
    """A table for each metric that has a score: methods by scenes, and their means. The lowest
    score of a scene is bold; marks of the truth are those of the other tables."""
    metrics = scored_metrics(evaluation)
    head = f"% {truths_used(evaluation)}"
    return "\n".join([head, *(_of_metric(evaluation, metric) for metric in metrics)])


def _of_metric(evaluation: Evaluation, metric: Metric) -> str:
    scenes = [
        scene
        for scene in evaluation.scenes
        if any(evaluation.value(method, scene, metric) is not None for method in evaluation.methods)
    ]
    rows = [["", *(escaped(scene.name) for scene in scenes)]]
    rows += [[escaped(method.name)] for method in evaluation.methods]
    for scene in scenes:
        values = [evaluation.value(method, scene, metric) for method in evaluation.methods]
        lowest = min(value for value in values if value is not None)
        for row, method, value in zip(rows[1:], evaluation.methods, values, strict=True):
            cell = _cell(marked(evaluation.scores[method.name, scene.name, metric.id]))
            row.append(rf"\textbf{{{cell}}}" if value == lowest else cell)
    if len(scenes) > 1:
        rows[0].append("mean")
        for row, method in zip(rows[1:], evaluation.methods, strict=True):
            row.append(_cell(mean_text(evaluation, method, metric)))
    border = f"a border of {evaluation.border_px} px is left out"
    return table(f"{metric.name} ({metric.unit}); lower is better, {border}.", rows)


def _cell(text: str) -> str:
    return "".join(_MARKS.get(character, character) for character in text)
