"""Recipes as readable YAML files, with what a command line changes of them.

A recipe may name another as its `base` and then holds only what differs:

    base: paper-9x9
    about: The reference code's patches, 25x25 to 3x3, and its constant rate.
    patch_px: 3
    learning_rate: 1.0e-4
    decay: constant
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from epinet.errors import InputError
from epinet.io.problems import parsing
from epinet.synth.options import RANGES_PX
from epinet.train.augment import AUGMENTATIONS
from epinet.train.recipe import Recipe

SUFFIX = ".yaml"


def shipped_recipes() -> dict[str, Path]:
    """The files of the recipes that come with the package, by name."""
    folder = Path(str(resources.files("epinet.train") / "recipes"))
    return {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}


def load_recipe(name: str, changes: Mapping[str, Any] | None = None) -> Recipe:
    """A shipped recipe by its name, or one's own by its path, with values changed.

    Raises:
        InputError: no such recipe, or every value that is unknown or impossible.
    """
    values = {"name": Path(name).stem} | _values(name, ()) | dict(changes or {})
    try:
        return Recipe.model_validate(values)
    except ValidationError as error:
        raise InputError([f"recipe {name}: {_text(e)}" for e in error.errors()]) from error


def parse_changes(texts: Sequence[str]) -> dict[str, Any]:
    """Values from "key=value" texts; values are YAML.

    Raises:
        InputError: a text that is no such pair.

    Example:
        >>> parse_changes(["batch=32", "decay=cosine", "augmentations=[rotation, flip]"])
        {'batch': 32, 'decay': 'cosine', 'augmentations': ['rotation', 'flip']}
    """
    changes = {}
    for text in texts:
        key, equals, value = text.partition("=")
        try:
            changes[key.strip()] = _number(yaml.safe_load(value))
        except yaml.YAMLError as error:
            raise InputError(f"--set {text}: the value cannot be read ({error})") from error
        if not equals or not key.strip():
            raise InputError(f"--set {text}: give KEY=VALUE, as in batch=32")
    return changes


def changed_recipe(
    name: str, changes: Sequence[str], data: Sequence[str], without: Sequence[str]
) -> Recipe:
    """A recipe with what a command line changes of it.

    Args:
        name: see `load_recipe`.
        changes: "key=value" texts.
        data: sources that replace the recipe's: folders, or ranges of rendered scenes.
        without: augmentations to leave out.

    Raises:
        InputError: every value that is unknown or impossible, or a name in `data` that is both a
            range and a folder.
    """
    values = parse_changes(changes)
    if data:
        values["data"] = [_source(d) for d in data]
    recipe = load_recipe(name, values)
    unknown = sorted(set(without) - set(AUGMENTATIONS))
    if unknown:
        raise InputError(
            f"--without {', '.join(unknown)}: no such augmentation; there are "
            f"{', '.join(AUGMENTATIONS)}"
        )
    if without:
        values["augmentations"] = [a for a in recipe.augmentations if a not in without]
        recipe = load_recipe(name, values)
    return recipe


def _source(name: str) -> dict[str, str]:
    if name not in RANGES_PX:
        return {"folder": name}
    if Path(name).exists():
        raise InputError(
            f"--data {name}: the range of rendered scenes, or the folder {name} that is here? Give "
            f"--data ./{name} for the folder, --set 'data=[{{generator: {name}}}]' for the range"
        )
    return {"generator": name}


def _number(value: Any) -> Any:
    """YAML takes 1e-4, without a point, for a text."""
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def _values(name: str, derived: tuple[str, ...]) -> dict[str, Any]:
    shipped = shipped_recipes()
    path = shipped.get(name, Path(name))
    if not path.is_file():
        raise InputError(
            f"recipe {name}: no such file, and none of the recipes {', '.join(shipped)}"
        )
    with parsing(path, "a recipe in YAML"):
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(values, dict):
        raise InputError(f"{path}: a recipe is a mapping of names to values")
    values = {key: _number(value) for key, value in values.items()}
    base = values.pop("base", None)
    if base is None:
        return values
    if base in derived:
        raise InputError(f"{path}: its base {base} is based on it")
    return _values(str(base), (*derived, name)) | values


def _text(error: Any) -> str:
    place = ".".join(str(part) for part in error["loc"])
    message = error["msg"].removeprefix("Value error, ")
    given = "" if isinstance(error["input"], dict) else f" (it is {error['input']!r})"
    return f"{place}: {message}{given}" if place else message
