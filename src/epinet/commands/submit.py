"""`epinet submit`: the benchmark's zip, written or checked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import DeviceOption
from epinet.progress import progress
from epinet.terminal import say


def submit(
    method: Annotated[
        str | None,
        typer.Argument(
            metavar="MAPS_OR_MODEL",
            help="A folder with maps of the 12 scenes (SCENE.pfm, SCENE.npy, SCENE.mat, or "
            "results of epinet predict) and run times (runtimes/SCENE.txt), or sweepnet, epinet or "
            "a weights file.",
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The zip to write.")] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="For a model: the folder of the 12 scenes; their truth is not used."),
    ] = None,
    check: Annotated[
        Path | None, typer.Option(help="Check this zip, and list all that is wrong with it.")
    ] = None,
    device: DeviceOption = None,
) -> None:
    """Write a submission to the 4D Light Field Benchmark, or check one."""
    from epinet.allocator import keep_freed_memory
    from epinet.benchmark.methods import maps_to_submit
    from epinet.benchmark.submission import check_submission, write_submission
    from epinet.errors import InputError
    from epinet.io.atomic import scratch_folder

    if (method is None or output is None) if check is None else (method or output or data):
        raise InputError("give MAPS_OR_MODEL and -o FILE.zip to write one, or --check FILE.zip")
    if check is not None:
        check_submission(check)
        say(f"{check}: can be submitted")
        return
    assert method is not None and output is not None
    keep_freed_memory()
    with scratch_folder() as temporary:
        maps = maps_to_submit(method, data, temporary, output, device=device, progress=progress)
        write_submission(output, maps)
    say(f"12 scenes -> {output}")
