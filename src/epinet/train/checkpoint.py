"""The file that a run continues from: written whole or not at all, refused if it is another's."""

from __future__ import annotations

import io
import textwrap
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from epinet.documents import problems_of
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.reading import check_decoded, check_regular
from epinet.train.recipe import Recipe

WHY_LENGTH = 200
"""Characters of what is said about a damaged checkpoint."""


class _Validated(BaseModel):
    model_config = ConfigDict(strict=True)
    step: Annotated[int, Field(ge=0)]
    scores: dict[str, float]


class _Written(BaseModel):
    """What is relied on of a state; the networks and optimisers check the rest."""

    model_config = ConfigDict(strict=True)
    recipe: dict[str, Any]
    validated_on: str
    started_from: dict[str, Any] | None
    step: Annotated[int, Field(ge=0)]
    seconds: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    best: float
    losses: list[float]
    history: list[_Validated]


State = dict[str, Any]
"""With "recipe" and "validated_on", which must be those of the run that continues."""


def write_checkpoint(path: Path, state: State) -> None:
    """Write a run's state.

    Raises:
        InputError: it cannot be written; the one before is kept.
    """
    packed = io.BytesIO()
    torch.save(state, packed)
    with atomic_path(path) as temporary:
        temporary.write_bytes(packed.getbuffer())


@contextmanager
def continuing(
    path: Path, recipe: Recipe, validated_on: str, device: torch.device
) -> Iterator[State]:
    """A run's state; inside the block it is taken over.

    Args:
        path: of the checkpoint.
        recipe: of the run that continues; it may have other steps where none before depends on
            how many there will be.
        validated_on: its validation scenes.
        device: to load tensors to.

    Raises:
        InputError: it is damaged, does not fit what takes it over, or is of another recipe or
            another validation.
    """
    try:
        check_regular(path)
        _check_size(path)
        state = torch.load(path, weights_only=True, map_location=device)
        _Written.model_validate(state)
        _check_tensors(state, path)
        _check_same(path, state, recipe, validated_on)
        yield state
    except InputError:
        raise
    except Exception as error:  # a damaged file makes torch raise anything
        said = str(error)
        if isinstance(error, ValidationError):
            said = problems_of(error, "it", _Written)[0]
        why = " ".join(said.split()) or type(error).__name__
        raise InputError(
            f"{path}: not a checkpoint that can be continued "
            f"({textwrap.shorten(why, WHY_LENGTH)}); "
            "remove it to begin anew, or choose another folder"
        ) from error


def _check_size(path: Path) -> None:
    """Refuse a file that unpacks to far more than it takes on disk."""
    with zipfile.ZipFile(path) as archive:
        check_decoded(path, sum(entry.file_size for entry in archive.infolist()), "its tensors")


def _check_tensors(value: Any, path: Path) -> None:
    """Refuse tensors, in dictionaries and lists of any depth, that no run writes."""
    if isinstance(value, torch.Tensor):
        if value.is_complex() or not torch.isfinite(value).all():
            raise InputError(
                f"{path}: holds values that are not finite, so that its run cannot go on; remove "
                "it to begin anew, or choose another folder"
            )
    elif isinstance(value, dict | list | tuple):
        for each in value.values() if isinstance(value, dict) else value:
            _check_tensors(each, path)


def _check_same(path: Path, state: State, recipe: Recipe, validated_on: str) -> None:
    ours = recipe.as_dict()
    theirs = state["recipe"]
    defaults = Recipe.of({"model": recipe.model}).as_dict()  # of values younger than the file
    differences = [
        f"{key} is {theirs.get(key, defaults[key])} there, {ours[key]} here"
        for key in sorted(ours.keys() - {"steps"})
        if theirs.get(key, defaults[key]) != ours[key]
    ]
    if differences:
        raise InputError(
            f"{path}: belongs to another recipe ({'; '.join(differences)}); choose another folder"
        )
    _check_steps(path, state, recipe)
    if state["validated_on"] != validated_on:
        raise InputError(
            f"{path}: was validated on {state['validated_on']}, not on {validated_on}, so that "
            "scores do not compare; choose another folder"
        )


def _check_steps(path: Path, state: State, recipe: Recipe) -> None:
    planned, done = state["recipe"]["steps"], state["step"]
    if recipe.steps < done:
        raise InputError(f"{path}: has made {done} steps already, more than steps={recipe.steps}")
    if recipe.steps != planned and recipe.paced_by_steps:
        values = recipe.as_dict()
        paced = ", ".join(f"{name}={values[name]}" for name in recipe.paced_by_steps)
        raise InputError(
            f"{path}: was begun for {planned} steps, and a run of {recipe.steps} would have begun "
            f"otherwise, since its pace follows from the number of steps ({paced}); go on with "
            f"--set steps={planned}, or begin another run from its weights in another folder: "
            f"--set start={path.parent / 'weights.safetensors'}"
        )
