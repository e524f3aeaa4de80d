"""JSON and YAML documents: parsed within bounds and validated against pydantic models.

Whatever a document holds, what is wrong with it becomes an InputError that names its file and key.
YAML is read with the types of JSON: no dates, and no aliases, which make small texts huge. A name
that a mapping holds twice is refused, since only one of the values could be meant.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields, is_dataclass
from reprlib import Repr
from typing import Any, TypeVar, get_args, get_type_hints

import yaml
from pydantic import BaseModel, ValidationError

from epinet.errors import InputError
from epinet.texts import decoded

JSON_BYTES, YAML_BYTES = 8 * 2**20, 2**16
"""What documents may have; YAML is slow to parse."""
DEEPEST, MOST_VALUES, LARGEST_INT = 64, 2**20, 2**63

_PROBLEMS = 10
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60

Model = TypeVar("Model", bound=BaseModel)


def parse_json(data: bytes | str, where: object) -> Any:
    """Value of a JSON document.

    Raises:
        InputError: it is none, or beyond the bounds; names `where`.
    """
    return _parsed(data, where, "JSON", JSON_BYTES, _loads)


def parse_yaml(data: bytes | str, where: object) -> Any:
    """Value of a YAML document, of JSON's types.

    Raises:
        InputError: it is none, or beyond the bounds; names `where`.
    """
    return _parsed(data, where, "YAML", YAML_BYTES, lambda text: yaml.load(text, _Loader))


def validated(model: type[Model], value: Any, where: object) -> Model:
    """A value as the model, whose types and bounds it must have.

    Raises:
        InputError: each key that is missing or wrong.
    """
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise InputError(problems_of(error, where, model)) from error


def problems_of(error: ValidationError, where: object, model: Any) -> list[str]:
    """What a model refuses, a line each, with file and key; of an unknown key, those known."""
    errors = error.errors(include_url=False)
    lines = [f"{where}: {_text(e, model)}" for e in errors[:_PROBLEMS]]
    more = len(errors) - _PROBLEMS
    return [*lines, f"{where}: and {more} more problems"] if more > 0 else lines


def short(value: object) -> str:
    """A value in a message, at a bounded length."""
    return _SHORT.repr(value)


def _text(error: Any, model: Any) -> str:
    key = ".".join(short(part).strip("'") for part in error["loc"])
    if error["type"] == "missing":
        return f"{key} is missing"
    if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        known = ", ".join(_fields_at(model, error["loc"][:-1]))
        return f"{key} is not known; there are {known}"
    message = error["msg"].removeprefix("Value error, ")
    given = "" if isinstance(error["input"], dict) else f", not {short(error['input'])}"
    return f"{key}: {message}{given}" if key else f"{message}{given}"


def _fields_at(model: Any, keys: Sequence[Any]) -> list[str]:
    """The names of the fields that a model has at the end of a way of keys and indices."""
    for key in keys:
        model = _fields(model).get(key, model)
    return list(_fields(model))


def _fields(annotation: Any) -> dict[str, Any]:
    """The types of a model's fields by name; of a type as tuple[Model, ...], its model's."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {name: field.annotation for name, field in annotation.model_fields.items()}
    if is_dataclass(annotation):
        types = get_type_hints(annotation)
        return {field.name: types[field.name] for field in fields(annotation)}
    return next(filter(None, map(_fields, get_args(annotation))), {})


def _parsed(
    data: bytes | str, where: object, kind: str, most: int, parse: Callable[[str], Any]
) -> Any:
    if len(data) > most:
        raise InputError(f"{where}: {len(data)} bytes of {kind}; at most {most} are read")
    try:
        text = decoded(data) if isinstance(data, bytes) else data
        value = parse(text)
    except RecursionError as error:
        raise InputError(f"{where}: nested too deeply for {kind} of epinet") from error
    except Exception as error:  # parsers raise many kinds
        said = " ".join(str(error).split())[:200]
        raise InputError(f"{where}: cannot be read as {kind} ({said})") from error
    _check_bounds(value, where)
    return value


def _check_bounds(value: Any, where: object) -> None:
    """Deep nesting, many values and huge numbers break what handles a document later."""
    level, count = [value], 0
    for _ in range(DEEPEST):
        inner: list[Any] = []
        for item in level:
            if isinstance(item, int) and abs(item) >= LARGEST_INT:
                raise InputError(f"{where}: the number {short(item)} is too large")
            if not isinstance(item, dict | list):
                continue
            count += len(item)
            if count > MOST_VALUES:
                raise InputError(f"{where}: more than {MOST_VALUES} values")
            inner += [*item, *item.values()] if isinstance(item, dict) else item
        if not inner:
            return
        level = inner
    raise InputError(f"{where}: nested more than {DEEPEST} deep")


def _loads(text: str) -> Any:
    return json.loads(text, object_pairs_hook=_unique)


def _unique(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    """A mapping of pairs, none of them twice."""
    found: dict[Any, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"{short(key)} is given twice")
        found[key] = value
    return found


class _Loader(yaml.SafeLoader):
    """YAML of JSON's types."""

    yaml_implicit_resolvers = {  # noqa: RUF012 (as its base has it)
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    yaml_constructors = {  # noqa: RUF012
        tag: make
        for tag, make in yaml.SafeLoader.yaml_constructors.items()
        if tag is None
        or tag.rpartition(":")[2] in {"null", "bool", "int", "float", "str", "seq", "map"}
    }

    def fetch_flow_collection_start(self, token: Any) -> None:
        if self.flow_level >= DEEPEST:  # PyYAML takes quadratic time for the depth
            raise RecursionError
        super().fetch_flow_collection_start(token)

    def add_indent(self, column: int) -> bool:
        if len(self.indents) >= DEEPEST:
            raise RecursionError
        return bool(super().add_indent(column))

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise ValueError("aliases (*name) are not read; write the values out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        pairs = [(self.construct_object(key, deep=True), value) for key, value in node.value]
        _unique(pairs)
        return super().construct_mapping(node, deep=deep)
