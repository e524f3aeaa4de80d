"""`epinet refocus`: focus set afterwards."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epinet.commands.camera import ResultArgument
from epinet.errors import InputError
from epinet.progress import progress
from epinet.terminal import remark, say

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from epinet.predict.stored import StoredResult

ViewsOption = Annotated[
    Path | None,
    typer.Option("--views", help="Where the views are now, if not where they were predicted from."),
]
PictureOption = Annotated[
    Path,
    typer.Option("--output", "-o", help="Picture to write: .png, .jpg, .webp or .tiff."),
]


def refocus(
    result: ResultArgument,
    output: PictureOption,
    disparity: Annotated[
        float | None, typer.Option(help="Focus where the disparity is this many px.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Focus on what is seen at this pixel. Two or three of them tilt the plane of "
            "focus so that it goes through all.",
        ),
    ] = None,
    all_in_focus: Annotated[
        bool, typer.Option("--all-in-focus", help="Everything sharp, noise averaged out.")
    ] = False,
    aperture: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Radius of the lens in steps between views, 0 is the centre view alone; default: "
            "the whole grid.",
        ),
    ] = None,
    views: ViewsOption = None,
) -> None:
    """Refocus a light field after the fact, as a lens as wide as its grid would show it."""
    from epinet.effects.picture_files import check_suffix, write_picture
    from epinet.effects.refocus import all_in_focus as everything
    from epinet.effects.refocus import refocus as focused
    from epinet.predict.stored import read_result

    check_suffix(output)
    if sum([disparity is not None, bool(at), all_in_focus]) != 1:
        raise InputError("say what is to be sharp: one of --disparity, --at and --all-in-focus")
    if all_in_focus and aperture is not None:
        raise InputError("--aperture: nothing is blurred by --all-in-focus; give one of the two")
    stored = read_result(result)
    focus = _plane(stored, at) if at else float(disparity or 0)
    lf = stored.read_views(views)
    if not lf.present.all():
        remark(
            f"note: {int(lf.present.sum())} of {lf.present.size} views are there; "
            "blur takes the shape of where they stand"
        )
    with progress("refocusing") as advance:
        if all_in_focus:
            picture = everything(lf, stored.disparity, advance)
        else:
            picture = focused(lf, focus, stored.disparity, aperture, advance)
    write_picture(output, picture)
    say(f"-> {output}")


def _plane(stored: StoredResult, at: list[str]) -> NDArray[np.float32]:
    """The focal plane through the pixels named."""
    from epinet.effects.refocus import plane_through
    from epinet.geometry.pick import parse_pixel, pick

    pixels = [parse_pixel(text) for text in at]
    points = [(x, y, pick(stored.disparity, x, y).disparity_px) for x, y in pixels]
    return plane_through(points, stored.size)
