"""`epinet convert`: a light field of any layout, raw captures above all, in another one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import (
    FlipColsOption,
    FlipRowsOption,
    LayoutOption,
    TransposeOption,
)
from epinet.errors import InputError
from epinet.progress import progress
from epinet.terminal import remark, say


def convert(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A raw capture, or any other light field.")
    ],
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="What to make, by its ending: a folder in the layout of the 4D Light Field "
            "Benchmark (no ending), .png (ESLF), .h5, .mat, .npz or .npy.",
        ),
    ],
    white: Annotated[
        Path | None,
        typer.Option(
            help="White images of the camera that took the raw capture: a folder, a .tar, "
            "a data.C.0 or a .RAW."
        ),
    ] = None,
    views: Annotated[
        int | None,
        typer.Option(
            min=3, help="Views per row and column, odd; default: 9 of a raw capture, else all."
        ),
    ] = None,
    layout: LayoutOption = None,
    flip_rows: FlipRowsOption = False,
    flip_cols: FlipColsOption = False,
    transpose: TransposeOption = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the light field at OUT.")] = False,
) -> None:
    """Turn raw captures of plenoptic cameras, or any other light field, into views on disk."""
    from epinet.io import (
        check_target,
        layout_for,
        left_out,
        read_light_field,
        read_raw,
        write_light_field,
    )
    from epinet.io.lytro_raw import LAYOUT
    from epinet.raw import DEFAULT_VIEWS

    target = layout_for(output)
    if output.exists() and not force:
        raise InputError(f"{output}: already exists; remove it, choose another name or add --force")
    check_target(output)
    if layout == LAYOUT.name or (layout is None and path.is_file() and LAYOUT.recognises(path)):
        with progress("decoding") as advance:
            lf = read_raw(path, white, DEFAULT_VIEWS if views is None else views, advance)
    elif white is not None:
        raise InputError(f"{path}: --white is for raw captures ({', '.join(LAYOUT.suffixes)})")
    else:
        lf = read_light_field(path, layout)
        lf = lf if views is None else lf.central(views)
    lf = lf.reordered(flip_rows=flip_rows, flip_cols=flip_cols, transpose=transpose)
    write_light_field(output, lf, target, overwrite=force)
    for note in (*lf.notes, *left_out(output, lf, target)):
        remark(f"note: {note}")
    (rows, cols), (height, width) = lf.grid, lf.size
    say(f"{path}: {rows}x{cols} views of {width}x{height} px -> {output} ({target})")
