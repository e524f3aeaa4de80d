"""Runs on disk: one JSON file each; what is there is not run again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from epinet.errors import InputError
from epinet.io.atomic import atomic_path


def saved_run(path: Path, settings: dict[str, Any], run: Callable[[], dict[str, Any]]) -> Any:
    """What a run gave: read, or run and saved with its settings.

    Raises:
        InputError: a run of other settings is saved there.
    """
    if path.exists():
        report = json.loads(path.read_text())
        if report["settings"] != json.loads(json.dumps(settings)):
            raise InputError(f"{path}: a run of other settings; remove it to run again")
        return report
    report = {"settings": settings} | run()
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(report, indent=1) + "\n")
    return report


def machines(reports: Iterable[dict[str, Any]]) -> str:
    """Where saved runs were made, and by how many threads."""
    made = {
        f"{report['machine']}, {report['threads']} thread{'s' * (report['threads'] != 1)}"
        for report in reports
    }
    return "; ".join(sorted(made))
