"""`epinet fade`: the centre view in mist."""

from __future__ import annotations

from typing import Annotated

import typer

from epinet.commands.camera import ResultArgument
from epinet.commands.refocus import PictureOption
from epinet.errors import InputError
from epinet.terminal import say


def fade(
    result: ResultArgument,
    output: PictureOption,
    colour: Annotated[
        str, typer.Option(help="What the distance fades to: a name or #rrggbb.")
    ] = "white",
    near: Annotated[
        float | None,
        typer.Option(help="Disparity down to which nothing fades; default: 99th percentile."),
    ] = None,
    far: Annotated[
        float | None,
        typer.Option(help="Disparity at which only the colour is left; default: 1st percentile."),
    ] = None,
) -> None:
    """Fade the centre view with distance, like things in mist or in the dark."""
    from PIL import ImageColor

    from epinet.effects.fade import fade as faded
    from epinet.effects.picture_files import check_suffix, write_picture
    from epinet.predict.stored import read_result

    check_suffix(output)
    try:
        red, green, blue = ImageColor.getrgb(colour)[:3]
    except ValueError as error:
        raise InputError(f"--colour {colour}: give a name such as white, or #rrggbb") from error
    stored = read_result(result)
    picture = faded(
        stored.centre_view, stored.disparity, (red, green, blue), near_px=near, far_px=far
    )
    write_picture(output, picture)
    say(f"-> {output}")
