"""Options that several commands have, and what they print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PathsArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="PATH...",
        help="Light fields: folders of views or single files. "
        "A folder that holds several light fields, perhaps sorted into folders, stands for all of "
        "them.",
    ),
]
LayoutOption = Annotated[
    str | None,
    typer.Option(
        help="The layout on disk, where the guess is wrong: hci, rows_cols, numbered, eslf, "
        "hci_hdf5, lftoolbox, array or lytro_raw."
    ),
]
FlipRowsOption = Annotated[
    bool, typer.Option("--flip-rows", help="The views' rows are counted from the bottom.")
]
FlipColsOption = Annotated[
    bool, typer.Option("--flip-cols", help="The views' columns are counted from the right.")
]
TransposeOption = Annotated[
    bool, typer.Option("--transpose", help="The views' rows and columns are exchanged.")
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        help="Weights: a file, or shipped ones by name (epinet weights); default: those that fit."
    ),
]
ModelOption = Annotated[
    str | None,
    typer.Option(
        help="The network: sweepnet (the default), epinet, or one of your own, "
        "my_package.my_module:MyNet, whose code is run."
    ),
]
DeviceOption = Annotated[
    str | None, typer.Option(help="cpu, cuda, cuda:1, ...; default: the GPU if there is one.")
]


def result_line(name: str, run: dict[str, object], folder: Path, skipped: bool = False) -> str:
    """What `predict` says of a result, from its run.json."""
    span = run["disparity_px"]
    seconds = run["seconds"]
    scores = run["scores"]
    assert isinstance(span, dict) and isinstance(seconds, dict)
    text = f"{name}: disparity {span['percentile_1']:.2f}..{span['percentile_99']:.2f} px"
    if isinstance(scores, dict):
        text += f", BadPix(.07) {scores['badpix_0.07']:.2f} %, MSE x100 {scores['mse_x100']:.2f}"
    took = "done before" if skipped else f"{sum(seconds.values()):.1f} s"
    settings = run["settings"]
    assert isinstance(settings, dict)
    refined = ", refined" if settings["refine"] else ""
    weights = run["weights"]
    assert isinstance(weights, dict)
    return f"{text}, {Path(weights['file']).stem}{refined}, {took} -> {folder}"
