"""`epinet demo`: the main job on a scene rendered for it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import result_line
from epinet.progress import progress
from epinet.terminal import remark, say


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")] = Path(
        "epinet-demo"
    ),
    seed: Annotated[int, typer.Option(help="Another seed gives another scene.")] = 7,
) -> None:
    """Render a small scene with exact truth, predict it and score it. Needs no download."""
    from epinet.predict.demo import run_demo

    remark(f"rendering a 9x9 light field of seed {seed} and predicting it ...")
    with progress("predicting") as advance:
        run = run_demo(output, seed, advance)
    say(result_line("demo", run, output))
    say(f"look at {output / 'result' / 'preview.png'}")
