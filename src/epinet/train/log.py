"""Logs of a run: log.jsonl always, TensorBoard's where it is installed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from epinet.io.atomic import atomic_path, writing
from epinet.io.images import read_image


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
            kept = [line for line in self.path.read_text().splitlines() if _step(line) <= step]
            with atomic_path(self.path) as temporary:
                temporary.write_text("".join(line + "\n" for line in kept))
        self._board: Any = None
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:  # the extra "train" is not installed
            return
        self._board = SummaryWriter(self._board_folder, purge_step=step + 1)

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
            for path in sorted(folder.glob("*.png")):
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


def _step(line: str) -> float:
    """Step of an entry; a line that a killed process left unfinished goes."""
    try:
        return float(json.loads(line)["step"])
    except (ValueError, KeyError, TypeError):
        return float("inf")
