"""Logs of a run: log.jsonl always, TensorBoard's where it is installed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from epinet.documents import parse_json, validated
from epinet.errors import InputError
from epinet.io.atomic import atomic_path, writing
from epinet.io.images import read_image
from epinet.io.names import is_shown
from epinet.io.problems import parsing
from epinet.reading import check_decoded, open_regular

_LONGEST_LINE = 2**20
"""Bytes; ours have some hundred."""


class Log:
    """Appends to the logs of a run's folder.

    Args:
        folder: of the run.
        step: entries after this step were written by a part of the run that is done again: they
            go.
    """

    def __init__(self, folder: Path, step: int) -> None:
        self.path = folder / "log.jsonl"
        if self.path.exists():
            self._keep_until(step)
        self._board: Any = None
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:  # the extra "train" is not installed
            return
        self._board = SummaryWriter(self._board_folder, purge_step=step + 1)

    def _keep_until(self, step: int) -> None:
        with parsing(self.path, "a log"), open_regular(self.path) as old:
            check_decoded(self.path, self.path.stat().st_size, "its entries")
            with atomic_path(self.path) as temporary, temporary.open("wb") as new:
                while line := old.readline(_LONGEST_LINE):
                    if line.endswith(b"\n") and _step(line) <= step:
                        new.write(line)

    @property
    def _board_folder(self) -> Path:
        return self.path.with_name("tensorboard")

    def write(self, step: int, values: Mapping[str, Any]) -> None:
        """One entry: numbers, or mappings of numbers, by name.

        Raises:
            InputError: it cannot be written.
        """
        with writing(self.path), self.path.open("a") as file:
            file.write(json.dumps({"step": step, **values}) + "\n")
        if self._board is not None:
            with writing(self._board_folder):
                for name, value in values.items():
                    each = value if isinstance(value, Mapping) else {"": value}
                    for part, number in each.items():
                        self._board.add_scalar(f"{name}/{part}" if part else name, number, step)

    def show(self, step: int, folder: Path) -> None:
        """The PNG pictures of a folder."""
        if self._board is None:
            return
        with writing(self._board_folder):
            for path in sorted(filter(is_shown, folder.glob("*.png"))):
                image = np.asarray(read_image(path))
                self._board.add_image(path.stem, image, step, dataformats="HWC")
            self._board.flush()

    def __enter__(self) -> Log:
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if self._board is None:
            return
        # An error that is under way says more than that of a board that cannot be closed.
        with writing(self._board_folder) if error is None else suppress(OSError):
            self._board.close()


class _Entry(BaseModel):
    """What is read of a line; it holds more."""

    step: Annotated[float, Field(strict=True, ge=0)]


def _step(line: bytes) -> float:
    """Step of an entry; a line that a killed process left unfinished goes."""
    try:
        return validated(_Entry, parse_json(line.decode("utf-8"), "line"), "line").step
    except (InputError, UnicodeDecodeError):
        return float("inf")
