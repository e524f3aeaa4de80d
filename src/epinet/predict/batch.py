"""Many light fields in one go: which ones, where each result goes, and what is done already."""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from epinet import __version__
from epinet.documents import validated
from epinet.errors import InputError
from epinet.io import LAYOUTS, is_light_field, is_stray, named_layout, read_light_field
from epinet.io.atomic import check_writable
from epinet.io.images import IMAGE_SUFFIXES
from epinet.io.names import is_shown, named_path
from epinet.io.problems import listed
from epinet.lightfield import LightField
from epinet.predict.estimator import DEFAULT_MEMORY_MB, Estimator
from epinet.predict.ownership import check_owner, content_sha256, files_of, is_anothers, stored_run
from epinet.predict.record import Finished
from epinet.predict.result import FILES, check_replaceable

FILE_SUFFIXES = {suffix for layout in LAYOUTS.values() for suffix in layout.suffixes}

FOLDERS_DEEP = 3
"""Light fields lie in the folder given or up to so many below: HCI's are sorted by category
in a folder of all."""

LOGGER = logging.getLogger(__name__)
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
    refine: bool | None = None
    range_px: tuple[float, float] | None = None
    bounded: bool | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of one light field."""

    name: str
    folder: Path
    run: dict[str, Any] | None = None
    """Content of its run.json; None if it failed."""
    skipped: bool = False
    problems: tuple[str, ...] = ()


def find_light_fields(
    paths: Sequence[Path],
    layout: str | None = None,
) -> list[Path]:
    """The light fields meant: a path that is none itself stands for those inside it.

    Those are files and folders directly inside, and folders up to `FOLDERS_DEEP` below, as the
    benchmark's archives sort their scenes. What holds no light field is left out, and named in
    the log. Of the files inside, images count only where their name ends in `_eslf`: other images
    are not lenslets.

    Raises:
        InputError: no such layout, or a folder cannot be listed.
    """
    recognises = is_light_field if layout is None else named_layout(layout).fits
    found = []
    for path in paths:
        inside: list[Path] = []
        try:
            if path.is_dir() and not recognises(path):
                inside = _inside(path, layout, recognises)
        except OSError as error:
            raise InputError(f"{path}: cannot be listed ({error.strerror})") from error
        found += inside or [path]
    return list({named_path(path): path for path in found}.values())


def _inside(
    folder: Path,
    layout: str | None,
    recognises: Callable[[Path], bool],
) -> list[Path]:
    """The light fields in a folder; where there is none, files that have their endings."""
    entries = sorted(filter(is_shown, folder.iterdir()))
    candidates = [p for p in entries if _may_be_one(p)]
    strays = [p for p in candidates if is_stray(p, layout)]
    notes: list[str] = []
    found = _among([p for p in candidates if p not in strays], recognises, notes.append)
    if not found:
        return strays
    for note in notes:
        LOGGER.info("%s", note)
    others = [p.name for p in entries if p in strays or p not in candidates]
    if others:
        LOGGER.info("left out: %s in %s (files that hold no light field)", listed(others), folder)
    return found


def _among(
    entries: Sequence[Path],
    recognises: Callable[[Path], bool],
    say: Callable[[str], None],
    deep: int = 1,
) -> list[Path]:
    """Those of a folder's entries that are light fields, and what lies in the other folders."""
    found, others = [], []
    for entry in entries:
        here = [entry] if recognises(entry) else []
        if not here and entry.is_dir() and deep < FOLDERS_DEEP:
            folders = sorted(p for p in entry.iterdir() if is_shown(p) and p.is_dir())
            here = _among(folders, recognises, say, deep + 1)
        found += here
        others += [] if here else [entry]
    if found:
        for entry in others:
            say(f"left out: {entry} (no light field recognised; --layout names one)")
    return found


def _may_be_one(path: Path) -> bool:
    if path.is_dir():
        return True
    if path.suffix.lower() in IMAGE_SUFFIXES:
        return path.stem.lower().endswith("_eslf")
    return path.suffix.lower() in FILE_SUFFIXES


def check_names(paths: Sequence[Path]) -> None:
    """Refuse light fields whose results would have the same name.

    Raises:
        InputError: naming all of them.
    """
    # Boxes and boxes are one folder on many systems.
    counts = Counter(result_name(p).casefold() for p in paths)
    clashes = [p for p in paths if counts[result_name(p).casefold()] > 1]
    if clashes:
        raise InputError(
            [f"{p}: another light field is also named {result_name(p)}" for p in clashes]
            + ["results of the same name would overwrite each other: run them apart"]
        )


def check_name(name: str) -> None:
    """Refuse a name that a user gives and that is none of a folder.

    Raises:
        InputError: it is empty, a path, or holds what is not printed.
    """
    if name in ("", ".", "..") or not name.isprintable() or set(name) & set("/\\"):
        raise InputError(f"--name {name!r}: give a name of a folder, without slashes")


def result_name(path: Path) -> str:
    """Name of a light field's result: as the user named the file or folder, be it a link."""
    named = named_path(path)
    return named.stem if named.is_file() else named.name


def _free_name(path: Path, out: Path, force: bool) -> str:
    """Its own, or its folder's and its own where another's result stands in `out`."""
    name = result_name(path)
    if force or not is_anothers(out / name, path):
        return name
    return f"{named_path(path).parent.name}_{name}"


def predict_all(
    estimator: Estimator,
    paths: Sequence[Path],
    out: Path,
    *,
    reading: Reading,
    options: Options,
    names: Sequence[str] = (),
    memory_mb: float = DEFAULT_MEMORY_MB,
    force: bool = False,
    progress: Progress,
) -> Iterator[Outcome]:
    """Predict each light field into out/<name>, skipping those whose result stands there.

    `names` are those of the results; without them, each light field's own, or where the result of
    another stands there, that of its folder before it.

    A result counts as done if it came from the same input with the same settings, weights and
    version, is complete, and is newer than the input. That of another input stays, unless `force`
    is given. One that fails does not stop the others.

    Raises:
        InputError: two inputs have the same name, or `out` cannot be written.
    """
    if not names:
        check_names(paths)
        names = [_free_name(path, out, force) for path in paths]
    check_writable(out)
    for path, name in zip(paths, names, strict=True):
        folder = out / name
        request = _request(path, estimator, reading, options)
        try:
            if not force and (run := _finished(folder, path, request)):
                yield Outcome(name, folder, run, skipped=True)
                continue
            check_replaceable(folder)
            if not force:
                check_owner(folder, path)
            with progress(name) as advance:
                result = estimator.predict(
                    reading.read(path), **asdict(options), memory_mb=memory_mb, progress=advance
                )
            result = replace(result, request=request, input_sha256=content_sha256(path))
            result.save(folder)
            yield Outcome(name, folder, result.describe())
        except InputError as error:
            yield Outcome(name, folder, problems=tuple(error.problems))
        except (MemoryError, RuntimeError) as error:
            if not _lacks_memory(error):
                raise
            problem = f"{path}: the memory does not suffice; let the network take less: --memory MB"
            yield Outcome(name, folder, problems=(problem,))


def _lacks_memory(error: MemoryError | RuntimeError) -> bool:
    """On a CPU, torch says so in the text of a RuntimeError only."""
    special = isinstance(error, MemoryError | torch.OutOfMemoryError)
    return special or "can't allocate memory" in str(error)


def _request(
    path: Path, estimator: Estimator, reading: Reading, options: Options
) -> dict[str, Any]:
    request: dict[str, Any] = {
        "epinet": __version__,
        "input": str(named_path(path)),
        "reading": asdict(reading),
        "options": asdict(options),
        "weights_sha256": estimator.sha256,
    }
    request = json.loads(json.dumps(request))  # as run.json has it: lists, no tuples
    return request


def _finished(folder: Path, path: Path, request: dict[str, Any]) -> dict[str, Any] | None:
    """run.json of a result that answers the request, or None."""
    run = stored_run(folder)
    if run.get("request") != request:
        return None
    try:
        validated(Finished, run, folder / "run.json")
        complete = {p.name for p in folder.iterdir()} >= FILES
        newest = max(p.stat().st_mtime for p in files_of(path))
        fresh = (folder / "run.json").stat().st_mtime >= newest
    except (OSError, InputError):
        return None
    return run if complete and fresh else None
