"""Which light field a result belongs to: its path as the user named it, and its content."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from epinet.errors import InputError
from epinet.io import lytro_raw
from epinet.io.names import named_path
from epinet.predict.record import read_run
from epinet.raw.white import BESIDE


def files_of(path: Path) -> list[Path]:
    """The files that a light field is read from; of white images beside it, their folder."""
    if path.is_dir():
        return [p for p in path.iterdir() if p.is_file()]
    if path.suffix.lower() not in lytro_raw.LAYOUT.suffixes:
        return [path]
    beside = (path.with_suffix(".json"), path.parent / BESIDE)
    return [path, *(p for p in beside if p.exists())]


def content_sha256(path: Path) -> str:
    """Of the light field's files and, in a folder, their names; white images do not count.

    Raises:
        InputError: a file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        for file in sorted(p for p in files_of(path) if p.is_file()):
            digest.update(file.name.encode(errors="surrogateescape") if path.is_dir() else b"")
            with file.open("rb") as content:
                digest.update(hashlib.file_digest(content, "sha256").digest())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    return digest.hexdigest()


def is_anothers(folder: Path, path: Path) -> bool:
    """Whether a result came from another light field: of another path and other content.

    Raises:
        InputError: the light field cannot be read.
    """
    run = stored_run(folder)
    owner = run.get("input")
    if not isinstance(owner, str) or named_path(Path(owner)) == named_path(path):
        return False
    return run.get("input_sha256") != content_sha256(path)  # else it was moved


def check_owner(folder: Path, path: Path) -> None:
    """Refuse to replace a result of another light field.

    Raises:
        InputError: naming that light field.
    """
    if is_anothers(folder, path):
        raise InputError(
            f"{folder}: holds the result of another light field, {stored_run(folder)['input']}; "
            "choose another output, or with epinet predict another --name, or --force to replace it"
        )


def stored_run(folder: Path) -> dict[str, Any]:
    """The content of a result's run.json; empty where there is none that can be read."""
    try:
        return read_run(folder / "run.json")
    except InputError:
        return {}
