"""Small text files as editors of any system save them, and what stands in a file's place."""

from __future__ import annotations

import codecs
from pathlib import Path

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # begins as that of UTF-16 does
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_PROBED_BYTES = 64

_POINTER_BEGINS = b"version https://git-lfs.github.com/spec/v"
POINTER = (
    "a pointer of Git LFS, not the file itself; fetch it by `git lfs pull` in its repository, "
    "or download the file from the repository's page"
)
"""What to say of a file that `is_pointer`."""


def decoded(data: bytes) -> str:
    r"""Text from bytes in UTF-8, UTF-16 or UTF-32, failing these in Latin-1; lines end in \n.

    A byte-order mark decides, and goes; UTF-16 without one is known by its zeros. Latin-1 takes any
    bytes, so that a comment in it does not make the rest unreadable.

    Example:
        >>> decoded(b"\xef\xbb\xbfa = 1\r\n"), decoded("4\xb0".encode("latin-1"))
        ('a = 1\n', '4°')
    """
    return _decoded(data).replace("\r\n", "\n").replace("\r", "\n")


def is_pointer(path: Path) -> bool:
    """Whether a pointer of Git LFS stands where the file should be."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(_POINTER_BEGINS)) == _POINTER_BEGINS
    except OSError:
        return False


def _decoded(data: bytes) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data.decode(encoding, errors="replace")
    probe = data[:_PROBED_BYTES]
    for encoding, zeros in (("utf-16-le", probe[1::2]), ("utf-16-be", probe[::2])):
        if zeros and not any(zeros) and any(probe):
            return data.decode(encoding, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")
