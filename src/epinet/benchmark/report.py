"""The report of an evaluation: a page, CSV and JSON."""

from __future__ import annotations

from pathlib import Path

from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.page import render
from epinet.benchmark.table import as_csv, as_json
from epinet.io.atomic import atomic_path


def write_report(evaluation: Evaluation, folder: Path) -> Path:
    """Write report.html, scores.csv and scores.json into a folder; returns the page's path.

    Raises:
        InputError: a centre view cannot be read, or they cannot be written.
    """
    texts = {
        "scores.csv": as_csv(evaluation),
        "scores.json": as_json(evaluation),
        "report.html": render(evaluation),
    }
    for name, text in texts.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return folder / "report.html"
