"""`epinet synth` and `epinet validation`: scenes with exact truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import DeviceOption
from epinet.progress import progress
from epinet.terminal import say, say_all

SheetOption = Annotated[
    bool, typer.Option("--sheet", help="Picture scenes (sheet.png) and measure all (statistics).")
]


def synth(
    output: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of the data set.")],
    scenes: Annotated[int, typer.Option(help="How many; each becomes a folder.")],
    seed: Annotated[int, typer.Option(min=0, help="Another seed gives other scenes.")] = 1,
    range_: Annotated[
        str,
        typer.Option("--range", help="Disparities: narrow, hci, wide, or LOW,HIGH in px per view."),
    ] = "hci",
    size: Annotated[str, typer.Option(help="Of a view: WIDTHxHEIGHT in px.")] = "512x512",
    views: Annotated[int, typer.Option(help="Views per row and column, odd.")] = 9,
    star: Annotated[
        bool, typer.Option("--star", help="Only the views that the network sees.")
    ] = False,
    truths: Annotated[
        bool, typer.Option("--truths", help="Truth of the nine central views, for view shift.")
    ] = False,
    textures: Annotated[
        Path | None, typer.Option(help="Folder of photographs to take textures from, too.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Rays per pixel and view.")] = 4,
    no_faults: Annotated[
        bool, typer.Option("--no-faults", help="A perfect camera: no noise, blur and so on.")
    ] = False,
    device: DeviceOption = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Make what is missing of a data set begun before.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the data set that stands at OUT.")
    ] = False,
    sheet: SheetOption = False,
) -> None:
    """Render scenes with exact truth, in the layout of the 4D Light Field Benchmark."""
    from epinet.predict.estimator import choose_device
    from epinet.synth.dataset import existing_from, parse_range, parse_size, write_dataset
    from epinet.synth.options import Faults, Options

    options = Options(
        size=parse_size(size),
        disparity_px=parse_range(range_),
        views=views,
        samples=samples,
        faults=Faults.none() if no_faults else Faults(),
    )
    with progress("rendering") as advance:
        write_dataset(
            output,
            options,
            seed,
            scenes,
            star_only=star,
            truths=truths,
            textures=textures,
            device=str(choose_device(device)),
            existing=existing_from(resume, force),
            advance=advance,
        )
    _show_data_set(output, sheet)


def validation(
    output: Annotated[
        Path | None, typer.Argument(metavar="[OUT]", help="Folder; default: in the user's cache.")
    ] = None,
    device: DeviceOption = None,
    force: Annotated[bool, typer.Option("--force", help="Make all of it again.")] = False,
    sheet: SheetOption = False,
) -> None:
    """Render the 16 scenes that training is validated on; continues what was interrupted."""
    from epinet.predict.estimator import choose_device
    from epinet.synth.validation import make_validation

    with progress("rendering") as advance:
        folder = make_validation(
            output,
            device=str(choose_device(device)),
            existing="replace" if force else "resume",
            advance=advance,
        )
    _show_data_set(folder, sheet)


def _show_data_set(folder: Path, sheet: bool) -> None:
    from epinet.synth.dataset import read_record

    if sheet:
        from epinet.synth.overview import write_overview

        with progress("statistics") as advance:
            statistics = write_overview(folder, advance)
        say_all(statistics.lines())
        say(f"look at {folder / 'sheet.png'}")
    say(f"{len(read_record(folder)['scenes'])} scenes -> {folder}")
