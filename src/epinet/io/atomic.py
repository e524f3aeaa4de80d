"""Writing so that a reader finds the old result or the new one, never half of one."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from epinet.errors import InputError


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary name to write a file to; it becomes `path` if the block succeeds.

    It lies in the same folder (made if need be) and ends in the same suffix. After an error
    nothing is left of it, and a file that stood at `path` is untouched.

    Raises:
        InputError: the file cannot be written (any OSError inside the block).

    Example:
        >>> with atomic_path("map.txt") as temporary:  # doctest: +SKIP
        ...     temporary.write_text("0.5")
    """
    target = Path(path).resolve()
    temporary = _sibling(target)
    try:
        with writing(path):
            target.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            temporary.replace(target)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """An empty temporary folder to fill; it becomes `path` if the block succeeds.

    A folder that stood at `path` is replaced as a whole, whatever it held; after an error it is
    untouched.

    Raises:
        InputError: the folder cannot be written (any OSError inside the block).
    """
    target = Path(path).resolve()
    temporary = _sibling(target)
    try:
        with writing(path):
            temporary.mkdir(parents=True)
            yield temporary
            _swap_in(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Around what writes to `path`.

    Raises:
        InputError: it cannot be written (any OSError inside the block).
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror or error}); "
            "check the name, the permissions and the free space of its folder"
        ) from error


def check_writable(folder: Path) -> None:
    """Make the folder if need be, and find out before long work whether it takes files.

    Raises:
        InputError: it does not.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        probe = _sibling(folder.resolve() / "probe")
        probe.touch()
        probe.unlink()


def _swap_in(new: Path, target: Path) -> None:
    if not target.is_dir():
        new.rename(target)  # an OSError where a file stands there
        return
    old = _sibling(target)
    target.rename(old)
    try:
        new.rename(target)
    except OSError:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _sibling(path: Path) -> Path:
    return path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
