"""The file that a run continues from: written whole or not at all, refused if it is another's."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from epinet.errors import InputError
from epinet.io.atomic import atomic_path

WHY_LENGTH = 200
"""Characters of what is said about a damaged checkpoint."""

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
    path: Path, recipe: Mapping[str, Any], validated_on: str, device: torch.device
) -> Iterator[State]:
    """A run's state; inside the block it is taken over.

    Args:
        path: of the checkpoint.
        recipe: all values of the recipe of the run that continues.
        validated_on: its validation scenes.
        device: to load tensors to.

    Raises:
        InputError: it is damaged, does not fit what takes it over, or is of another recipe or
            another validation.
    """
    try:
        state = torch.load(path, weights_only=True, map_location=device)
        if not isinstance(state, dict):
            raise TypeError(f"it holds a {type(state).__name__}")
        _check_same(path, state, recipe, validated_on)
        yield state
    except InputError:
        raise
    except Exception as error:  # a damaged file makes torch raise anything
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"{path}: not a checkpoint that can be continued "
            f"({textwrap.shorten(why, WHY_LENGTH)}); "
            "remove it to begin anew, or choose another folder"
        ) from error


def _check_same(path: Path, state: State, recipe: Mapping[str, Any], validated_on: str) -> None:
    theirs = dict(state["recipe"])
    differences = [
        f"{key} is {theirs.get(key)} there, {recipe.get(key)} here"
        for key in sorted(theirs.keys() | recipe.keys())
        if theirs.get(key) != recipe.get(key)
    ]
    if differences:
        raise InputError(
            f"{path}: belongs to another recipe ({'; '.join(differences)}); choose another folder"
        )
    if state["validated_on"] != validated_on:
        raise InputError(
            f"{path}: was validated on {state['validated_on']}, not on {validated_on}, so that "
            "scores do not compare; choose another folder"
        )
