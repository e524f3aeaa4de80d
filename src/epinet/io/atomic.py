"""Writing so that a reader finds the old result or the new one, never half of one.

What is being written has a hidden name, `.NAME.epinet-PLACE-PID-START-RANDOM.SUFFIX`, which no
reader takes: PLACE stands for the machine (and its container), START for when the process began, so
that a number given to another process later is not taken for it. A process that is killed leaves
such names; the next one that writes into the folder removes those of processes that are gone. Of
another machine nothing is known: its names go once they are `OLD_S` old.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from epinet.errors import InputError

OLD_S = 7 * 24 * 3600.0
"""Nothing takes so long to write."""

_TEMPORARY = re.compile(
    r"\.(?P<name>.*)\.epinet(?P<replaced>-old)?-(?P<place>[0-9a-f]{8})-(?P<pid>\d{1,10})"
    r"-(?P<start>\d{1,20})-[0-9a-f]{8}(\.[^.]*)?"
)
_LONGEST_NAME = 255
"""Bytes of a file's name."""


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
            remove_leftovers(target.parent)
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
            remove_leftovers(target.parent)
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
        remove_leftovers(folder)
        probe = _sibling(folder.resolve() / "probe")
        probe.touch()
        probe.unlink()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """An empty folder where the system keeps temporary ones; it goes with the block.

    Raises:
        InputError: it cannot be made.
    """
    place = Path(tempfile.gettempdir())
    folder = _sibling(place / "scratch")
    try:
        with writing(folder):
            folder.mkdir(mode=0o700)
        remove_leftovers(place)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers(folder: Path) -> None:
    """Remove what killed processes were writing into a folder; what one was replacing comes back.

    What cannot be removed stays: it is in nobody's way.
    """
    with suppress(OSError):
        found = [(p, m) for p in folder.iterdir() if (m := _TEMPORARY.fullmatch(p.name))]
        for path, match in found:
            if _may_be_written(path, match):
                continue
            if match["replaced"] and not folder.joinpath(match["name"]).exists():
                with suppress(OSError):
                    path.rename(folder / match["name"])
            elif path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.unlink(missing_ok=True)


def _may_be_written(path: Path, match: re.Match[str]) -> bool:
    """Whether the process that made a temporary name may still be there."""
    if match["place"] == _place():
        begun = _start(int(match["pid"]))
        return begun is not None and (begun == int(match["start"]) or begun == 0)
    return time.time() - path.lstat().st_mtime < OLD_S


@cache
def _place() -> str:
    """Where numbers of processes mean what they mean here: a machine since it started, and of its
    containers one."""
    parts = [platform.node()]
    for told in ("/proc/sys/kernel/random/boot_id", "/proc/self/ns/pid"):
        with suppress(OSError):
            link = Path(told)
            parts.append(str(link.readlink()) if link.is_symlink() else link.read_text())
    return hashlib.sha256("|".join(parts).encode()).hexdigest()[:8]


def _start(pid: int) -> int | None:
    """When a process began, in its system's ticks: None if there is none, 0 if it is not known."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(errors="replace")
        return int(stat.rpartition(")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        pass
    if Path("/proc/self/stat").exists():
        return None
    try:  # a system without /proc
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except (OSError, OverflowError):
        pass
    return 0


def _swap_in(new: Path, target: Path) -> None:
    if not target.is_dir():
        new.rename(target)  # an OSError where a file stands there
        return
    old = _sibling(target, "-old")
    target.rename(old)
    try:
        new.rename(target)
    except OSError:
        old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _sibling(path: Path, replaced: str = "") -> Path:
    """A hidden name beside `path`, with its suffix; of this process, and of no other."""
    pid = os.getpid()
    name, suffix = (path.name, "") if replaced else (path.stem, path.suffix)
    mark = f".epinet{replaced}-{_place()}-{pid}-{_start(pid) or 0}-{uuid.uuid4().hex[:8]}"
    room = _LONGEST_NAME - len(os.fsencode(f".{mark}{suffix}"))
    if len(os.fsencode(name)) > room:
        name, mark = "long", mark.replace("-old", "")  # it cannot come back by its name
    return path.with_name(f".{name}{mark}{suffix}")
