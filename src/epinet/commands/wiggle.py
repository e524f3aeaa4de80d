"""`epinet wiggle`: a film from view to view."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.camera import ResultArgument
from epinet.commands.refocus import ViewsOption
from epinet.terminal import say


def wiggle(
    result: ResultArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="Film to write: .gif or .mp4.")],
    disparity: Annotated[
        float | None,
        typer.Option(help="What has this disparity stands still; default: the median."),
    ] = None,
    fps: Annotated[float, typer.Option(min=1, max=50, help="Frames per second.")] = 12,
    views: ViewsOption = None,
) -> None:
    """Move from view to view and back, in an endless loop that shows depth on a flat screen."""
    import numpy as np

    from epinet.effects.wiggle import check_suffix, wiggle_frames, write_film
    from epinet.predict.stored import read_result

    check_suffix(output)
    stored = read_result(result)
    still = float(np.nanmedian(stored.disparity)) if disparity is None else disparity
    frames = wiggle_frames(stored.read_views(views), still)
    write_film(output, frames, fps)
    height, width = frames[0].shape[:2]
    say(f"{len(frames)} frames of {width}x{height} px, still at {still:.2f} px -> {output}")
