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

from pydantic import ValidationError

from epinet.documents import YAML_BYTES, parse_yaml, problems_of, short
from epinet.errors import InputError
from epinet.io.problems import parsing
from epinet.reading import read_bytes
from epinet.synth.options import RANGES_PX
from epinet.train.augment import AUGMENTATIONS
from epinet.train.recipe import PAPER, Recipe, recipe_type

SUFFIX = ".yaml"
_MOST_BASES = 16


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
        return Recipe.of(values)
    except ValidationError as error:
        model = values.get("model", PAPER)
        known = recipe_type(model if isinstance(model, str) else PAPER)
        raise InputError(problems_of(error, f"recipe {name}", known)) from error


def parse_changes(texts: Sequence[str]) -> dict[str, Any]:
    """Values from "key=value" texts; values are YAML.

    Raises:
        InputError: a text that is no such pair, or a key that is given twice.

    Example:
        >>> parse_changes(["batch=32", "decay=cosine", "augmentations=[rotation, flip]"])
        {'batch': 32, 'decay': 'cosine', 'augmentations': ['rotation', 'flip']}
    """
    changes: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        key = key.strip()
        if not equals or not key:
            raise InputError(f"--set {short(text)}: give KEY=VALUE, as in batch=32")
        if key in changes:
            raise InputError(f"--set {key}: given twice; which value is meant?")
        changes[key] = _number(parse_yaml(value, f"--set {key}"))
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
        if "data" in values:
            raise InputError("--data and --set data=...: both say what to learn from; give one")
        values["data"] = [_source(d) for d in data]
        if any("folder" in source for source in values["data"]):
            values.setdefault("mirror_weight", 0.0)  # of folders' mirrors nothing can be learned
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
    if not _is_file(path):
        raise InputError(
            f"recipe {short(name)}: no such file, and none of the recipes {', '.join(shipped)}"
        )
    with parsing(path, "a recipe in YAML"):
        values = parse_yaml(read_bytes(path, YAML_BYTES), path)
    if not isinstance(values, dict):
        raise InputError(f"{path}: a recipe is a mapping of names to values")
    values = {key: _number(value) for key, value in values.items()}
    base = values.pop("base", None)
    if base is None:
        return values
    if not isinstance(base, str):
        raise InputError(f"{path}: base: the name of a recipe or its file, not {short(base)}")
    if base in derived or base == name:
        raise InputError(f"{path}: its base {base} is based on it")
    if len(derived) >= _MOST_BASES:
        raise InputError(f"{path}: the {_MOST_BASES}th base in a row; write out what they say")
    return _values(base, (*derived, name)) | values


def _is_file(path: Path) -> bool:
    """Also of a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
