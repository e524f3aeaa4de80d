"""Gathering everything wrong with an input, so that a user can mend it in one go."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from epinet.errors import InputError
from epinet.texts import POINTER, is_pointer


class Problems(list[str]):
    """What has been found wrong so far."""

    @contextmanager
    def gather(self) -> Iterator[None]:
        """Note the problems of an InputError raised inside, and go on after the block."""
        try:
            yield
        except InputError as error:
            self.extend(error.problems)

    def raise_any(self) -> None:
        """Raise one InputError with all that was gathered, if anything was."""
        if self:
            raise InputError(self)


@contextmanager
def parsing(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a file library raises about `path` into an InputError naming it."""
    try:
        yield
    except Exception as error:  # a damaged file makes parsers raise anything
        if is_pointer(path):
            raise InputError(f"{path}: {POINTER}") from error
        if isinstance(error, InputError):
            raise
        if isinstance(error, OSError) and error.errno is not None:  # the disk's, not the parser's
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        said = " ".join(str(error).split())
        raise InputError(
            f"{path}: cannot be read as {kind} ({said}); the file may be damaged or incomplete, "
            "copy or download it again"
        ) from error


def listed(names: list[str], limit: int = 10) -> str:
    """Names in a sentence, the tail of a long list as a count."""
    rest = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {rest} more" if rest > 0 else "")
