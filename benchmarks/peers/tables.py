"""The saved comparison as a table."""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.peers.methods import METHODS

SCORES = {
    "badpix_0.07": "BadPix(.07)",
    "badpix_0.03": "(.03)",
    "badpix_0.01": "(.01)",
    "mse_x100": "MSE x100",
}
COSTS = {"cpu_s": "CPU s", "peak_memory_mb": "peak MB"}


def mean(scenes: dict[str, Any], method: str, key: str) -> float | None:
    """Of a score or a cost over the scenes that have it."""
    reports = [scene["methods"][method] for scene in scenes.values()]
    values = [v for r in reports if (v := r.get("scores", {}).get(key, r.get(key))) is not None]
    return statistics.mean(values) if values else None


def markdown(report: dict[str, Any]) -> str:
    """One row for each set and method; means over the scenes of the set."""
    head = ["set", "method", *SCORES.values(), *COSTS.values()]
    rows = [head, ["---"] * len(head)]
    for name, scenes in report["sets"].items():
        for method in METHODS:
            values = [mean(scenes, method, key) for key in (*SCORES, *COSTS)]
            digits = [*[2] * len(SCORES), 2, 0]
            cells = [
                "-" if v is None else f"{v:.{n}f}" for v, n in zip(values, digits, strict=True)
            ]
            rows.append([f"{name} ({len(scenes)})", method, *cells])
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)
