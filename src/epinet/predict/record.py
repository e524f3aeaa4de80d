"""run.json of a result: what is read back of it, which must be as `Result.describe` writes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from epinet.documents import JSON_BYTES, parse_json, validated
from epinet.errors import InputError
from epinet.io.problems import parsing
from epinet.reading import read_bytes

NAME = "run.json"

Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=10_000)]


class _Part(BaseModel):
    """A mapping that may hold more than is used."""

    model_config = ConfigDict(frozen=True, strict=True, extra="allow")


class Settings(_Part):
    """What a result was made with."""

    step: Count = 1
    row_spacing: Annotated[float, Field(gt=0.1, lt=10)] = 1.0
    refine: bool | None = None
    stated_px: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None


class Record(_Part):
    """What commands on a result need to know."""

    views_used: Annotated[list[Count], Field(min_length=2, max_length=2)]
    layout: str | None
    order: Annotated[list[bool], Field(min_length=3, max_length=3)]
    input: str | None = None
    camera: dict[str, Any] | None = None
    settings: Settings = Settings()


class Span(_Part):
    """Of the disparities, in px."""

    percentile_1: Number
    percentile_99: Number


class File(_Part):
    """Weights."""

    file: str


class Scores(_Part):
    """Against truth."""

    badpix: Annotated[float, Field(alias="badpix_0.07")]
    mse: Annotated[float, Field(alias="mse_x100")]


class Finished(Record):
    """What is said of a result, too."""

    request: dict[str, Any]
    disparity_px: Span
    seconds: dict[str, Annotated[float, Field(ge=0, le=1e9)]]
    settings: Settings
    weights: File
    scores: Scores | None
    notes: list[str]
    warnings: list[str]


class Timed(_Part):
    """What scoring needs of a result."""

    settings: Settings
    seconds: dict[str, Annotated[float, Field(ge=0, le=1e9)]]


def read_run(path: Path) -> dict[str, Any]:
    """The content of a run.json.

    Raises:
        InputError: it cannot be read, or is no JSON object.
    """
    with parsing(path, "a run's record"):
        run = parse_json(read_bytes(path, JSON_BYTES), path)
    if not isinstance(run, dict):
        raise InputError(_not_ours(path))
    return run


def read_record(path: Path) -> Record:
    """What commands on a result need of its run.json.

    Raises:
        InputError: it cannot be read, or keys are missing or hold what they cannot.
    """
    run = read_run(path)
    try:
        return validated(Record, run, path)
    except InputError as error:
        raise InputError([_not_ours(path), *error.problems]) from error


def _not_ours(path: Path) -> str:
    return f"{path}: not the record of this version of epinet predict; predict again"
