"""The one error a user's input can cause."""

from __future__ import annotations

from collections.abc import Iterable


class InputError(ValueError):
    """Something given to epinet cannot be used.

    Holds everything found wrong at once, each problem naming the file, what was expected and
    what would help. The commands print it and exit with status 2.
    """

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = [problems] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(self.problems))
