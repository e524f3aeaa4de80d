"""`epinet train`: a recipe to weights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.common import DeviceOption
from epinet.terminal import remark, say


def _list_recipes(wanted: bool) -> None:
    from epinet.train.recipe_files import load_recipe, shipped_recipes

    if wanted:
        for name in shipped_recipes():
            say(f"{name:22}{load_recipe(name).about.strip()}")
        raise typer.Exit


def train(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the run.")],
    recipe: Annotated[
        str, typer.Option(help="Name of a shipped recipe (--list), or a YAML file.")
    ] = "sweepnet",
    data: Annotated[
        list[str] | None,
        typer.Option(
            help="Instead of the recipe's scenes: a folder of scenes with truth, perhaps sorted "
            "into folders, or the range (narrow, hci, wide) of rendered ones; a folder of such a "
            "name is given as ./hci. May be given again for a mixture."
        ),
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="Leave out this augmentation. May be given again.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a value of the recipe, as in batch=32 or start=epinet_9x9. May be given "
            "again.",
        ),
    ] = None,
    validation: Annotated[
        list[Path] | None,
        typer.Option(
            help="Folder of scenes with truth, perhaps sorted into folders; default: small "
            "rendered ones. May be given again."
        ),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(help="Folder that keeps rendered scenes for other runs on the same ones."),
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
    from epinet.allocator import keep_freed_memory
    from epinet.predict.batch import find_light_fields
    from epinet.predict.estimator import choose_device
    from epinet.train.parallel import local_device, team
    from epinet.train.recipe_files import changed_recipe
    from epinet.train.run import Run, StoppedError
    from epinet.train.validation import Validation

    keep_freed_memory()
    chosen = changed_recipe(recipe, set_ or [], data or [], without or [])
    on = local_device(choose_device(device))
    scenes = None
    if validation:
        trained_on = find_light_fields(chosen.folders)
        scenes = Validation.of_folders(validation, chosen.views, trained_on)
    with team(on) as processes:
        run = Run(
            chosen,
            output,
            device=on,
            team=processes,
            validation=scenes,
            cache=cache,
        )
        try:
            run.train()
        except StoppedError as stop:
            remark(f"{stop}; the same command continues {output}" if stop.resumable else str(stop))
            raise typer.Exit(1) from stop
    if processes.leads:
        say(f"weights: {output / 'weights.safetensors'}")
