"""`epinet weights`: those that come with the package, and others imported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.once import OnceCommand, OnceGroup
from epinet.terminal import say, say_all

app = typer.Typer(cls=OnceGroup, help="List the weights that come with epinet, or import others.")


@app.callback(invoke_without_command=True)
def _weights(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one line each.")] = False,
) -> None:
    from epinet.networks.weights import load_weights, shipped_weights

    if context.invoked_subcommand is not None:
        return
    for name in shipped_weights():
        weights = load_weights(name)
        if as_json:
            say(json.dumps({"name": name, "file": weights.source, **weights.metadata}))
        else:
            say_all([name, *(f"  {line}" for line in weights.lines())])


@app.command("import", cls=OnceCommand)
def _import(
    file: Annotated[Path, typer.Argument(help="HDF5 file of the reference implementation.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File to write, NAME.safetensors.")
    ],
) -> None:
    """Turn Keras weights of the reference implementation into a file for --weights."""
    from epinet.networks.epinet.keras import read_keras
    from epinet.networks.weights import save_weights

    weights = read_keras(file)
    save_weights(output, weights.net, weights.metadata, half=False)
    say_all([*weights.lines()[:1], f"-> {output}"])
