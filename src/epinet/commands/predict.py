"""`epinet predict`: light fields to disparity maps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import (
    DeviceOption,
    FlipColsOption,
    FlipRowsOption,
    LayoutOption,
    ModelOption,
    PathsArgument,
    TransposeOption,
    WeightsOption,
    result_line,
)
from epinet.errors import InputError
from epinet.progress import progress
from epinet.terminal import remark, say


def predict(
    paths: PathsArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results: OUT/<name> for each.")
    ],
    name: Annotated[
        str | None,
        typer.Option("--name", help="Of one light field's result; default: the light field's."),
    ] = None,
    model: ModelOption = None,
    weights: WeightsOption = None,
    ensemble: Annotated[
        bool,
        typer.Option("--ensemble", help="Average over the 8 flips and rotations (8 times slower)."),
    ] = False,
    scale: Annotated[
        int,
        typer.Option(min=1, help="For large disparities: show the network views shrunk so much."),
    ] = 1,
    range_: Annotated[
        str | None,
        typer.Option(
            "--range",
            help="Disparities LOW,HIGH in px per view that the map stays within, and that SweepNet "
            "looks for; default: what the views show, within what the scene's parameters state.",
        ),
    ] = None,
    no_range: Annotated[
        bool,
        typer.Option(
            "--no-range",
            help="Do not keep the map within what the scene's parameters state; EPINET's is not "
            "anyway.",
        ),
    ] = False,
    step: Annotated[int, typer.Option(min=1, help="Take every so many views of a large grid.")] = 1,
    memory: Annotated[
        float, typer.Option(help="Bound on the network's memory in MB; smaller works in tiles.")
    ] = 1536,
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine",
            help="Put the views in place and expose them alike before, smooth the map along the "
            "picture's edges after; default: for what a camera took, not for rendered scenes.",
        ),
    ] = None,
    device: DeviceOption = None,
    layout: LayoutOption = None,
    flip_rows: FlipRowsOption = False,
    flip_cols: FlipColsOption = False,
    transpose: TransposeOption = False,
    force: Annotated[
        bool, typer.Option("--force", help="Compute again what is there already.")
    ] = False,
) -> None:
    """Turn light fields into disparity maps, each a folder of its own."""
    from epinet.allocator import keep_freed_memory
    from epinet.predict.batch import (
        Options,
        Reading,
        check_name,
        find_light_fields,
        predict_all,
    )
    from epinet.predict.estimator import load_model
    from epinet.synth.dataset import parse_range

    range_px = None if range_ is None else parse_range(range_)
    if range_px is not None and no_range:
        raise InputError(f"--range {range_} and --no-range exclude each other: give one of them")
    keep_freed_memory()
    if name is not None:
        check_name(name)
    found = find_light_fields(paths, layout)
    if name is not None and len(found) != 1:
        raise InputError(f"--name {name}: for one light field, not for {len(found)}")
    estimator = load_model(weights, device, model)
    outcomes = predict_all(
        estimator,
        found,
        output,
        reading=Reading(layout, flip_rows, flip_cols, transpose),
        options=Options(ensemble, scale, step, refine, range_px, False if no_range else None),
        names=() if name is None else (name,),
        memory_mb=memory,
        force=force,
        progress=progress,
    )
    problems: list[str] = []
    for outcome in outcomes:
        problems += outcome.problems
        if outcome.run is not None:
            say(result_line(outcome.name, outcome.run, outcome.folder, outcome.skipped))
            for note in outcome.run["notes"]:
                remark(f"note: {outcome.name}: {note}")
            for warning in outcome.run["warnings"]:
                remark(f"warning: {outcome.name}: {warning}")
    if problems:
        raise InputError(problems)
