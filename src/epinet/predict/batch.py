"""Many light fields in one go: which ones, where each result goes, and what is done already."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from epinet.errors import InputError
from epinet.io import is_light_field, read_light_field
from epinet.lightfield import LightField
from epinet.predict.estimator import DEFAULT_MEMORY_MB, Estimator
from epinet.predict.result import Result, check_replaceable

Progress = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@dataclass(frozen=True)
class Reading:
    """How to read a light field."""

    layout: str | None = None
    """Name of the layout; None guesses."""
    flip_rows: bool = False
    flip_cols: bool = False
    transpose: bool = False

    def read(self, path: Path) -> LightField:
        """Read and put the views in order."""
        return read_light_field(path, self.layout).reordered(
            flip_rows=self.flip_rows, flip_cols=self.flip_cols, transpose=self.transpose
        )


@dataclass(frozen=True)
class Options:
    """What changes a result; see `Estimator.predict`."""

    ensemble: bool = False
    scale: int = 1
    step: int = 1


@dataclass(frozen=True)
class Outcome:
    """What became of one light field."""

    name: str
    folder: Path
    run: dict[str, Any] | None = None
    """Content of its run.json; None if it failed."""
    skipped: bool = False
    problems: tuple[str, ...] = ()


def find_light_fields(paths: Sequence[Path], layout: str | None = None) -> list[Path]:
    """The light fields meant: a path that is none itself stands for those directly inside it.

    Raises:
        InputError: two of them have the same name, so their results would collide.
    """
    found = []
    for path in paths:
        inside: list[Path] = []
        if layout is None and path.is_dir() and not is_light_field(path):
            inside = [p for p in sorted(path.iterdir()) if is_light_field(p)]
        found += inside or [path]
    counts = Counter(result_name(p) for p in found)
    clashes = [p for p in found if counts[result_name(p)] > 1]
    if clashes:
        raise InputError(
            [f"{p}: another light field is also named {result_name(p)}" for p in clashes]
            + ["results of the same name would overwrite each other: run them apart"]
        )
    return found


def result_name(path: Path) -> str:
    """Name of the result folder of a light field."""
    resolved = path.resolve()
    return resolved.stem if resolved.is_file() else resolved.name


def predict_all(
    estimator: Estimator,
    paths: Sequence[Path],
    out: Path,
    *,
    reading: Reading,
    options: Options,
    memory_mb: float = DEFAULT_MEMORY_MB,
    force: bool = False,
    progress: Progress,
) -> Iterator[Outcome]:
    """Predict each light field into out/<name>, skipping those whose result stands there.

    A result counts as done if it came from the same input with the same settings and weights
    and is newer than the input. One that fails does not stop the others.
    """
    for path in paths:
        name = result_name(path)
        folder = out / name
        request = _request(path, estimator, reading, options)
        try:
            check_replaceable(folder)
            if not force and (run := _finished(folder, path, request)):
                yield Outcome(name, folder, run, skipped=True)
                continue
            result = _predict(estimator, path, reading, options, memory_mb, progress)
            result.request.update(request)
            result.save(folder)
            yield Outcome(name, folder, result.describe())
        except InputError as error:
            yield Outcome(name, folder, problems=tuple(error.problems))


def _predict(
    estimator: Estimator,
    path: Path,
    reading: Reading,
    options: Options,
    memory_mb: float,
    progress: Progress,
) -> Result:
    with progress(result_name(path)) as advance:
        return estimator.predict(
            reading.read(path), **asdict(options), memory_mb=memory_mb, progress=advance
        )


def _request(
    path: Path, estimator: Estimator, reading: Reading, options: Options
) -> dict[str, Any]:
    return {
        "input": str(path.resolve()),
        "reading": asdict(reading),
        "options": asdict(options),
        "weights_sha256": estimator.weights.sha256,
    }


def _finished(folder: Path, path: Path, request: dict[str, Any]) -> dict[str, Any] | None:
    """run.json of a result that answers the request, or None."""
    record = folder / "run.json"
    try:
        run: dict[str, Any] = json.loads(record.read_text())
        newest = max(p.stat().st_mtime for p in [path, *(path.iterdir() if path.is_dir() else [])])
        fresh = record.stat().st_mtime >= newest
    except (OSError, ValueError):
        return None
    return run if fresh and run.get("request") == request else None
