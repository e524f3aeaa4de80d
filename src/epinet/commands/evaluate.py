"""`epinet evaluate`: score methods against truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import DeviceOption
from epinet.progress import progress
from epinet.terminal import remark, say, say_all


def evaluate(
    methods: Annotated[
        list[str],
        typer.Argument(
            metavar="MAPS_OR_MODEL...",
            help="What to score: a folder of maps (SCENE.pfm, SCENE.npy, SCENE.mat, or results "
            "of epinet predict), or sweepnet, epinet or a weights file, which is run first. "
            "NAME=... names it in the report.",
        ),
    ],
    data: Annotated[
        Path,
        typer.Option(
            help="Scenes with truth, in the benchmark's layout: a folder of them, or one."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Folder for report.html, CSV, JSON and LaTeX tables, figures, and a model's maps.",
        ),
    ] = None,
    scene: Annotated[
        list[str] | None, typer.Option(help="Score only this scene. May be given again.")
    ] = None,
    border: Annotated[int, typer.Option(min=0, help="Border left out, in px.")] = 15,
    badpix: Annotated[
        list[float] | None,
        typer.Option(help="Threshold of BadPix in px; default: .07, .03 and .01. Again for more."),
    ] = None,
    device: DeviceOption = None,
) -> None:
    """Score disparity maps against truth by every metric of the HCI benchmark."""
    from epinet.allocator import keep_freed_memory
    from epinet.benchmark.evaluate import evaluate as score_all
    from epinet.benchmark.methods import prepare
    from epinet.benchmark.report import write_report
    from epinet.benchmark.signs import opposite_signs
    from epinet.benchmark.table import text_tables
    from epinet.io.atomic import check_writable, scratch_folder
    from epinet.io.problems import Problems
    from epinet.metrics.catalogue import benchmark_metrics
    from epinet.metrics.disparity import BADPIX_THRESHOLDS_PX
    from epinet.metrics.metric import Metric

    keep_freed_memory()
    problems = Problems()
    metrics: tuple[Metric, ...] = ()
    with problems.gather():
        metrics = benchmark_metrics(badpix or BADPIX_THRESHOLDS_PX)
    with problems.gather():
        prepared = prepare(methods, data, scene or (), metrics, border_px=border, device=device)
    problems.raise_any()
    if output is not None:
        check_writable(output)
    with scratch_folder() as temporary:
        folder = temporary if output is None else output / "maps"
        found = prepared.run(folder, progress=progress)
        with progress("scores") as advance:
            scored = score_all(found, prepared.scenes, metrics, border_px=border, advance=advance)
        hints = opposite_signs(scored)
    say_all(text_tables(scored))
    for hint in hints:
        remark(hint)
    if output is not None:
        say(f"-> {write_report(scored, output)}")
