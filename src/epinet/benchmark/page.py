"""An evaluation as one page that needs no network."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from string import Template

from epinet import __version__
from epinet.benchmark import figures, scene_cards
from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.html_table import html_table, lowest
from epinet.benchmark.published import CLAIM, METRICS, MISSING, PUBLISHED
from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.benchmark.standing import (
    Ranking,
    accuracy_and_time,
    caveats,
    common_scenes,
    rankings,
    run_times,
    unranked_methods,
)
from epinet.benchmark.table import (
    ABSENT,
    mean_text,
    partial_means,
    ranges_used,
    score_tables,
    score_text,
    truths_used,
)
from epinet.metrics.metric import Metric

OFFICIAL = (
    "Published figures are those of the benchmark's site, against official truth (of ten times the "
    "resolution on backgammon, dots and stripes); run times are their authors', each on their own "
    "machine."
)


def render(evaluation: Evaluation, drawn: Mapping[str, figures.Drawn] | None = None) -> str:
    """The whole page, pictures and all.

    Args:
        evaluation: what to show.
        drawn: its figures, where they are drawn already.

    Raises:
        InputError: a scene's centre view cannot be read.
    """
    drawn = drawn_figures(evaluation) if drawn is None else drawn
    sections = {
        "Means": ("means", _means(evaluation)),
        "Accuracy and run time": ("time", _accuracy_and_time(evaluation, drawn)),
        "Ranking": ("ranking", _ranking(evaluation, drawn)),
        "Maps side by side": ("overview", scene_cards.overview(evaluation)),
        "Scenes": ("scenes", scene_cards.legend(evaluation)),
        "All scores": ("scores", _all_scores(evaluation)),
        "Metrics": ("metrics", _metrics(evaluation.metrics)),
    }
    body = []
    for name, (anchor, content) in sections.items():
        body.append(f'<section id="{anchor}"><h2>{name}</h2>{content}</section>')
        if anchor == "scenes":
            body += [scene_cards.card(evaluation, scene) for scene in evaluation.scenes]
    links = (f'<a href="#{anchor}">{name}</a>' for name, (anchor, _) in sections.items())
    template = (resources.files("epinet.benchmark") / "report.html").read_text(encoding="utf-8")
    return Template(template).substitute(
        title="Disparity maps against truth",
        summary=_summary(evaluation),
        navigation="".join(links),
        body="\n".join(body),
        footer=f"epinet {__version__}. Scores as of the 4D Light Field Benchmark "
        "(Honauer, Johannsen, Kondermann, Goldluecke, ACCV 2016), implemented afresh.",
    )


def _summary(evaluation: Evaluation) -> str:
    methods = ", ".join(
        f"<b>{escape(method.name)}</b> ({escape(method.source)})" for method in evaluation.methods
    )
    scenes = _count(len(evaluation.scenes), "scene")
    return (
        f"{methods} on {scenes}. A border of {evaluation.border_px} px is left out; lower is "
        f"better everywhere. {escape(truths_used(evaluation))} {escape(ranges_used(evaluation))}"
    )


def _means(evaluation: Evaluation) -> str:
    metrics = [metric for table in score_tables(evaluation)[:1] for metric in table.metrics]
    methods = evaluation.methods
    rows = [
        [method.name, *(mean_text(evaluation, method, m) for m in metrics)] for method in methods
    ]
    comparable = [_comparable_means(evaluation, metric) for metric in metrics]
    header = ["method", *(f"{metric.name} ({metric.unit})" for metric in metrics)]
    table = html_table(
        header, rows, ours={(i, 0) for i in range(len(rows))}, best=lowest(comparable, 1)
    )
    over = f"Over {_count(len(evaluation.scenes), 'scene')}.{partial_means(evaluation)}"
    return f"<p>{over}</p>{table}"


def _comparable_means(evaluation: Evaluation, metric: Metric) -> list[float | None]:
    """Of the methods scored on the most scenes, without missing pixels that the metric ignores."""
    means = {method.name: evaluation.mean(method, metric) for method in evaluation.methods}
    most = max(count for _, count in means.values())
    left_out = unranked_methods(evaluation, metric.id)
    return [
        mean if count == most and name not in left_out else None
        for name, (mean, count) in means.items()
    ]


def drawn_figures(evaluation: Evaluation) -> dict[str, figures.Drawn]:
    """The paper's figures 1, 7 and 8, as far as there is something to draw, by name."""
    panels = [
        (f"{metric.name} ({metric.unit})", accuracy_and_time(evaluation, metric.id))
        for metric in map(evaluation.metric, ("badpix_0.07", "mse_x100"))
        if metric is not None
    ]
    panels = [(name, points) for name, points in panels if points]
    drawn = {"run_times": figures.run_time_bars(run_times(evaluation))}
    if panels:
        comparable = bool(common_scenes(evaluation))
        drawn["accuracy"] = figures.accuracy_against_time(panels, comparable=comparable)
    if found := rankings(evaluation):
        names = {metric.id: metric.name for metric in evaluation.metrics}
        drawn["ranks"] = figures.ranks(found, names)
    return drawn


def _accuracy_and_time(evaluation: Evaluation, drawn: Mapping[str, figures.Drawn]) -> str:
    common = common_scenes(evaluation)
    if common:
        over = f"Means over {', '.join(common)}."
    else:
        over = (
            f"Ours (filled): means over the {_count(len(evaluation.scenes), 'scene')} scored here. "
            "Published (hollow): means over the benchmark's 12 scenes. These are different scenes: "
            "heights compare only among the filled or among the hollow."
        )
    over += " Methods without an estimate of all pixels, or a run time of all scenes, are left out."
    first = drawn["accuracy"].svg if "accuracy" in drawn else ""
    second = drawn["run_times"].svg
    return (
        f'<p>{OFFICIAL}</p><div class="figures"><figure>{first}</figure>'
        f"<figure>{second}</figure></div><p>Left, accuracy against run time (the paper's figure "
        f"1). {over} Right, run times (its figure 8). {CLAIM}</p>"
    )


def _ranking(evaluation: Evaluation, drawn: Mapping[str, figures.Drawn]) -> str:
    found = rankings(evaluation)
    common = common_scenes(evaluation)
    names = {metric.id: metric.name for metric in evaluation.metrics}
    parts = []
    if common:
        parts.append(
            f"<p>On {_listed(common)}: the scenes scored here that have published figures. "
            f"{' '.join([OFFICIAL, *caveats(evaluation)])}</p>"
        )
    else:
        rest = (
            "the methods are ranked among themselves" if found else "there is nothing to rank with"
        )
        parts.append(
            "<p>None of these scenes has published figures (only the benchmark's twelve do), so "
            f"{rest}.</p>"
        )
    if found:
        parts.append(f"<figure>{drawn['ranks'].svg}")
        parts.append("<figcaption>Ranking (the paper's figure 7), means.</figcaption></figure>")
    if common:
        tables = [_ranking_table(each, names[each.metric]) for each in found]
        parts.append(f'<div class="figures">{"".join(tables)}</div>')
    parts.append(_published_means())
    return "".join(parts)


def _ranking_table(ranking: Ranking, name: str) -> str:
    rows = [
        [str(row.rank), row.method, score_text(row.mean), *map(score_text, row.values)]
        for row in ranking.rows
    ]
    columns = [[row.values[i] for row in ranking.rows] for i in range(len(ranking.scenes))]
    ours = {(i, 1) for i, row in enumerate(ranking.rows) if row.ours}
    header = ["rank", "method", "mean", *ranking.scenes]
    table = html_table(header, rows, left=2, ours=ours, best=lowest(columns, 3))
    note = ""
    if ranking.unranked:
        note = (
            f"<p>Not ranked: {escape(', '.join(ranking.unranked))}, without an estimate of all "
            f"pixels; {escape(name)} passes over the missing ones.</p>"
        )
    return f"<div><h3>{escape(name)}</h3>{table}{note}</div>"


def _published_means() -> str:
    scores = ["BadPix(.07)", "BadPix(.03)", "BadPix(.01)", "MSE x100", "run time (s)"]
    rows = []
    for other in PUBLISHED:
        known = [*(other.mean(metric, BENCHMARK_SCENES) for metric in METRICS), other.seconds]
        rows.append([other.name, other.source, *(ABSENT if f is None else f"{f:g}" for f in known)])
    table = html_table(["method", "source", *scores], rows, left=2)
    title = "<h3>Published means of the benchmark's 12 scenes</h3>"
    return f"{title}{table}<p>{CLAIM} {MISSING}</p>"


def _all_scores(evaluation: Evaluation) -> str:
    parts = [f"<p>{escape(truths_used(evaluation))} {escape(ranges_used(evaluation))}</p>"]
    for table in score_tables(evaluation):
        scenes = [row[0] for row in table.rows]
        parted = {i for i in range(1, len(scenes)) if scenes[i] != scenes[i - 1]}
        parts.append(html_table(table.header, table.rows, left=2, parted=parted))
    return "".join(parts)


def _metrics(metrics: Sequence[Metric]) -> str:
    rows = [
        (m.id, m.name, m.unit, m.definition, ", ".join(m.masks) or ABSENT, m.source)
        for m in metrics
    ]
    return html_table(["id", "metric", "unit", "definition", "masks", "source"], rows, left=6)


def _listed(names: Sequence[str]) -> str:
    return re.sub(r", ([^,]*)$", r" and \1", ", ".join(names))


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
