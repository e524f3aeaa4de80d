"""The report of an evaluation: one page, CSV and JSON."""

from __future__ import annotations

from pathlib import Path

from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.table import as_csv, as_json
from epinet.io.atomic import atomic_path


def write_report(evaluation: Evaluation, folder: Path) -> Path:
    """Write scores.csv and scores.json into a folder.

    Raises:
        InputError: they cannot be written.
    """
    for name, text in (("scores.csv", as_csv(evaluation)), ("scores.json", as_json(evaluation))):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return folder / "scores.csv"
