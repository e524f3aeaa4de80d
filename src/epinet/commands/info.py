"""`epinet info`: what a light field is."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from epinet.commands.common import (
    FlipColsOption,
    FlipRowsOption,
    LayoutOption,
    PathsArgument,
    TransposeOption,
    WeightsOption,
)
from epinet.errors import InputError
from epinet.terminal import say, say_all


def info(
    paths: PathsArgument,
    layout: LayoutOption = None,
    flip_rows: FlipRowsOption = False,
    flip_cols: FlipColsOption = False,
    transpose: TransposeOption = False,
    weights: WeightsOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one line each.")] = False,
) -> None:
    """Say what a light field is, and measure whether its views stand in the right order."""
    from epinet.inspect.report import inspect, report_lines
    from epinet.networks.weights import load_weights
    from epinet.predict.batch import Reading, find_light_fields

    reading = Reading(layout, flip_rows, flip_cols, transpose)
    bounds = None if weights is None else load_weights(weights).disparity_range_px
    problems: list[str] = []
    for i, path in enumerate(find_light_fields(paths, layout)):
        try:
            report = inspect(reading.read(path), bounds)
        except InputError as error:
            problems += error.problems
            continue
        if as_json:
            say(json.dumps(report))
        else:
            say_all(([""] if i else []) + report_lines(report))
    if problems:
        raise InputError(problems)
