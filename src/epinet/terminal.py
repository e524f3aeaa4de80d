"""What commands print. A name of a file may hold any character; a terminal obeys some of them.

Everything that is printed goes through here, a line at a time. What would clear the screen, set the
terminal's title, begin a line of its own or reverse the direction of text is shown as an escape, as
are characters that the stream's encoding lacks and bytes that are no text.
"""

from __future__ import annotations

import logging
import sys
import unicodedata
from collections.abc import Iterable
from typing import TextIO

_CATEGORIES = frozenset({"Cc", "Cs", "Zl", "Zp"})
"""Control characters, bytes that are no text, separators of lines and of paragraphs."""
_DIRECTIONS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def printable(text: str) -> str:
    r"""One line of text, characters that act on a terminal as escapes.

    Example:
        >>> printable("a\x1b[2Jb\nerror: forged")
        'a\\x1b[2Jb\\nerror: forged'
    """
    return "".join(_escaped(c) if _acts(c) else c for c in text)


def say(line: str) -> None:
    """Print a line to standard output."""
    _print(line, sys.stdout)


def say_all(lines: Iterable[str]) -> None:
    """Print lines to standard output."""
    for line in lines:
        say(line)


def remark(line: str) -> None:
    """Print a line to standard error, where it is not in the way of results."""
    _print(line, sys.stderr)


class RemarkHandler(logging.Handler):
    """Prints what the library logs as remarks: a warning says that it is one."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record, and the traceback that it may carry, a line at a time."""
        text = self.format(record)
        if record.levelno >= logging.WARNING:
            text = f"{record.levelname.lower()}: {text}"
        for line in text.splitlines():
            remark(line)


def _print(line: str, stream: TextIO) -> None:
    encoding = stream.encoding or "utf-8"
    print(printable(line).encode(encoding, "backslashreplace").decode(encoding), file=stream)
    stream.flush()


def _acts(character: str) -> bool:
    return unicodedata.category(character) in _CATEGORIES or character in _DIRECTIONS


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
