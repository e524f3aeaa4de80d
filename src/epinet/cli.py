"""The command line: each command parses, calls the library and prints."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from epinet import __version__
from epinet.errors import InputError
from epinet.progress import progress

app = typer.Typer(
    name="epinet",
    help="Depth from light fields, from views on disk to a disparity map.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)

PathsArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="PATH...",
        help="Light fields: folders of views or single files. "
        "A folder that holds several light fields stands for all of them.",
    ),
]
LayoutOption = Annotated[
    str | None,
    typer.Option(
        help="The layout on disk, where the guess is wrong: hci, rows_cols, numbered, eslf, "
        "hci_hdf5, lftoolbox or array."
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
    str | None, typer.Option(help="The network: sweepnet (the default) or epinet.")
]
DeviceOption = Annotated[
    str | None, typer.Option(help="cpu, cuda, cuda:1, ...; default: the GPU if there is one.")
]
SheetOption = Annotated[
    bool, typer.Option("--sheet", help="Picture scenes (sheet.png) and measure all (statistics).")
]
StepOption = Annotated[int, typer.Option(min=1, help="Take every so many views of a large grid.")]


@app.command()
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
    from epinet.model.checkpoint import load_weights
    from epinet.predict.batch import Reading, find_light_fields

    reading = Reading(layout, flip_rows, flip_cols, transpose)
    bounds = None if weights is None else load_weights(weights).disparity_range_px
    problems: list[str] = []
    for i, path in enumerate(find_light_fields(paths, layout, _remark)):
        try:
            report = inspect(reading.read(path), bounds)
        except InputError as error:
            problems += error.problems
            continue
        if as_json:
            print(json.dumps(report))
        else:
            print(("\n" if i else "") + "\n".join(report_lines(report)), flush=True)
    if problems:
        raise InputError(problems)


@app.command()
def predict(
    paths: PathsArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results: OUT/<name> for each.")
    ],
    model: ModelOption = None,
    weights: WeightsOption = None,
    ensemble: Annotated[
        bool,
        typer.Option("--ensemble", help="Average over the 8 flips and rotations (8 times slower)."),
    ] = False,
    scale: Annotated[
        int,
        typer.Option(min=1, help="For large disparities: show the network views shrunk so much."),
    ] = 1,
    step: StepOption = 1,
    memory: Annotated[
        float, typer.Option(help="Bound on the network's memory in MB; smaller works in tiles.")
    ] = 1024,
    device: DeviceOption = None,
    layout: LayoutOption = None,
    flip_rows: FlipRowsOption = False,
    flip_cols: FlipColsOption = False,
    transpose: TransposeOption = False,
    force: Annotated[
        bool, typer.Option("--force", help="Compute again what is there already.")
    ] = False,
) -> None:
    """Turn light fields into disparity maps, each a folder of its own."""
    from epinet.allocator import keep_freed_memory
    from epinet.predict.batch import Options, Reading, find_light_fields, predict_all
    from epinet.predict.estimator import load_model

    keep_freed_memory()
    estimator = load_model(weights, device, model)
    outcomes = predict_all(
        estimator,
        find_light_fields(paths, layout, _remark),
        output,
        reading=Reading(layout, flip_rows, flip_cols, transpose),
        options=Options(ensemble, scale, step),
        memory_mb=memory,
        force=force,
        progress=progress,
    )
    problems: list[str] = []
    for outcome in outcomes:
        problems += outcome.problems
        if outcome.run is not None:
            print(_result_line(outcome.name, outcome.run, outcome.folder, outcome.skipped))
            for warning in outcome.run["warnings"]:
                print(f"warning: {outcome.name}: {warning}", file=sys.stderr)
    if problems:
        raise InputError(problems)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")] = Path(
        "epinet-demo"
    ),
    seed: Annotated[int, typer.Option(help="Another seed gives another scene.")] = 7,
) -> None:
    """Render a small scene with exact truth, predict it and score it. Needs no download."""
    from epinet.predict.demo import run_demo

    print(f"rendering a 9x9 light field of seed {seed} and predicting it ...", file=sys.stderr)
    with progress("predicting") as advance:
        run = run_demo(output, seed, advance)
    print(_result_line("demo", run, output))
    print(f"look at {output / 'result' / 'preview.png'}")


def _list_recipes(wanted: bool) -> None:
    from epinet.train.recipe import load_recipe, shipped_recipes

    if wanted:
        for name in shipped_recipes():
            print(f"{name:22}{load_recipe(name).about.strip()}")
        raise typer.Exit


@app.command()
def train(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the run.")],
    recipe: Annotated[
        str, typer.Option(help="Name of a shipped recipe (--list), or a YAML file.")
    ] = "fast-9x9",
    data: Annotated[
        list[str] | None,
        typer.Option(
            help="Instead of the recipe's scenes: a folder of scenes with truth, or the range "
            "(narrow, hci, wide) of rendered ones. May be given again for a mixture."
        ),
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="Leave out this augmentation. May be given again.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Change a value of the recipe. May be given again."
        ),
    ] = None,
    start: Annotated[
        str | None, typer.Option(help="Weights to start from: a file, or shipped ones by name.")
    ] = None,
    validation: Annotated[
        Path | None,
        typer.Option(help="Folder of scenes with truth; default: small rendered ones."),
    ] = None,
    textures: Annotated[
        Path | None, typer.Option(help="Folder of photographs for the rendered scenes, too.")
    ] = None,
    device: DeviceOption = None,
    list_: Annotated[
        bool,
        typer.Option("--list", is_eager=True, callback=_list_recipes, help="Show the recipes."),
    ] = False,
) -> None:
    """Train a network; the same command continues a run that was interrupted.

    Started by torchrun, its processes share the run (--set shards=N).
    """
    from epinet.predict.batch import find_light_fields
    from epinet.predict.estimator import choose_device
    from epinet.train.parallel import local_device, team
    from epinet.train.recipe import changed_recipe
    from epinet.train.run import Run, StoppedError
    from epinet.train.validation import Validation

    changes = [*(set_ or []), *([] if start is None else [f"start={start}"])]
    chosen = changed_recipe(recipe, changes, data or [], without or [])
    on = local_device(choose_device(device))
    scenes = None
    if validation is not None:
        trained_on = find_light_fields(chosen.folders)
        scenes = Validation.of_folders(
            find_light_fields([validation], say=_remark), chosen.views, trained_on
        )
    with team(on) as processes:
        run = Run(
            chosen,
            output,
            device=on,
            team=processes,
            textures=textures,
            validation=scenes,
            say=_remark if processes.leads else lambda line: None,
        )
        try:
            run.train()
        except StoppedError as stop:
            _remark(f"{stop}; the same command continues {output}" if stop.resumable else str(stop))
            raise typer.Exit(1) from stop
    if processes.leads:
        print(f"weights: {output / 'weights.safetensors'}")


weights_app = typer.Typer(help="List the weights that come with epinet, or import others.")
app.add_typer(weights_app, name="weights", invoke_without_command=True)


@weights_app.callback()
def _weights(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one line each.")] = False,
) -> None:
    from epinet.model.checkpoint import load_weights, shipped_weights

    if context.invoked_subcommand is not None:
        return
    for name in shipped_weights():
        weights = load_weights(name)
        if as_json:
            print(json.dumps({"name": name, "file": weights.source, **weights.metadata}))
        else:
            print("\n".join([name, *(f"  {line}" for line in weights.lines())]))


@weights_app.command("import")
def _import(
    file: Annotated[Path, typer.Argument(help="HDF5 file of the reference implementation.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File to write, NAME.safetensors.")
    ],
) -> None:
    """Turn Keras weights of the reference implementation into a file for --weights."""
    from epinet.model.checkpoint import save_weights
    from epinet.model.keras import read_keras

    weights = read_keras(file)
    save_weights(output, weights.net, weights.metadata, half=False)
    print("\n".join([*weights.lines()[:1], f"-> {output}"]))


@app.command()
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


@app.command()
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
        print("\n".join(statistics.lines()))
        print(f"look at {folder / 'sheet.png'}")
    print(f"{len(read_record(folder)['scenes'])} scenes -> {folder}")


def _remark(line: str) -> None:
    print(line, file=sys.stderr)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"epinet {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it and exit.")
    ] = False,
) -> None:
    pass


def _result_line(name: str, run: dict[str, object], folder: Path, skipped: bool = False) -> str:
    span = run["disparity_px"]
    seconds = run["seconds"]
    scores = run["scores"]
    assert isinstance(span, dict) and isinstance(seconds, dict)
    text = f"{name}: disparity {span['percentile_1']:.2f}..{span['percentile_99']:.2f} px"
    if isinstance(scores, dict):
        text += f", BadPix(.07) {scores['badpix_0.07']:.2f} %, MSE x100 {scores['mse_x100']:.2f}"
    took = "done before" if skipped else f"{sum(seconds.values()):.1f} s"
    return f"{text}, {took} -> {folder}"


def main() -> None:
    """Run the command line; bad input ends with one clear message and exit status 2."""
    try:
        app()
    except InputError as error:
        for problem in error.problems:
            print(f"error: {problem}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        print(f"error: {error.filename or 'input or output'}: {error.strerror}", file=sys.stderr)
        sys.exit(2)
