"""Files are opened and decoded within bounds, whoever made them.

Only regular files are opened: a FIFO would block for ever, and a device has effects. What a file
decodes to must fit a limit before memory is taken for it: `LIMIT_BYTES`, or `RATIO` times what the
file takes on disk where that is more, so that a small file cannot fill the memory. The command line
sets another limit by `epinet --read-limit MB COMMAND`.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from epinet.errors import InputError

LIMIT_BYTES = 10**9
RATIO = 16
"""Measured: PNG of rendered views 2 to 8, JPEG of photographs 8 to 15."""

_BLOCK_BYTES = 512
"""Unit of `st_blocks`, whatever the file system's own blocks are."""

_limit_bytes = LIMIT_BYTES


def set_limit(megabytes: int) -> None:
    """Let files of this process decode to so many MB (of 10^6 bytes)."""
    global _limit_bytes
    _limit_bytes = megabytes * 10**6


def check_regular(path: str | Path) -> os.stat_result:
    """Refuse what is no regular file (after links are followed), for libraries that open a path.

    Raises:
        InputError: a FIFO, device or folder.
        OSError: there is nothing, or it may not be seen.
    """
    found = Path(path).stat()
    _check_mode(path, found.st_mode)
    return found


def open_regular(path: str | Path) -> BinaryIO:
    """Open a regular file to read bytes; never waits.

    Raises:
        InputError: a FIFO, device or folder.
        OSError: it cannot be opened.
    """
    check_regular(path)  # to open a device can have effects
    descriptor = os.open(
        path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    )
    try:
        _check_mode(path, os.fstat(descriptor).st_mode)  # it may have been exchanged
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_bytes(path: str | Path, most: int | None = None) -> bytes:
    """Content of a regular file.

    Args:
        path: of the file.
        most: bytes that a file of this kind may have; None takes the limit of decoded content.

    Raises:
        InputError: no regular file, or a larger one.
        OSError: it cannot be read.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if most is None:
            check_decoded(path, size, "its content")
        elif size > most:
            raise InputError(f"{path}: {size} bytes, where at most {most} are expected")
        return file.read(size)


def check_decoded(path: str | Path, needed: int, what: str) -> None:
    """Refuse content that would take more memory than the file may.

    Args:
        path: of the file.
        needed: bytes of memory.
        what: for the message, as in "its views".

    Raises:
        InputError: it is too much; says how to allow it.
        OSError: the file cannot be seen.
    """
    check_allowed(path, needed, stored_bytes(path), what)


def check_allowed(path: str | Path, needed: int, on_disk: int, what: str) -> None:
    """As `check_decoded`, where it is known what lies on disk.

    Raises:
        InputError: it is too much; says how to allow it.
    """
    if needed <= max(_limit_bytes, RATIO * on_disk):
        return
    megabytes = -(-needed // 1_000_000)
    raise InputError(
        f"{path}: {what} would take {megabytes} MB of memory, far more than on disk; "
        f"if it is meant to, allow it: epinet --read-limit {megabytes} COMMAND ..."
    )


def stored_bytes(path: str | Path) -> int:
    """What a file takes on disk, where holes count nothing.

    Raises:
        OSError: the file cannot be seen.
    """
    found = Path(path).stat()
    return min(found.st_size, _BLOCK_BYTES * getattr(found, "st_blocks", found.st_size))


def _check_mode(path: str | Path, mode: int) -> None:
    if stat.S_ISREG(mode):
        return
    kinds = {stat.S_IFIFO: "a FIFO", stat.S_IFDIR: "a folder", stat.S_IFSOCK: "a socket"}
    kind = kinds.get(stat.S_IFMT(mode), "a device")
    raise InputError(f"{path}: {kind}, where a file is expected")
