"""The paper's own figures (Shin et al., CVPR 2018, tables 1 to 3; the benchmark's site)."""

from __future__ import annotations

BAD, MSE = "badpix_0.07", "mse_x100"


def _scores(mse: float, bad: float) -> dict[str, float]:
    return {BAD: bad, MSE: mse}


STREAMS = {
    "paper-1-stream": _scores(2.165, 7.61),
    "paper-2-streams": _scores(1.729, 5.94),
    "paper-9x9": _scores(1.393, 3.87),
}
"""Table 1."""

VIEWS = {
    "paper-3x3": _scores(1.568, 8.63),
    "paper-5x5": _scores(1.475, 4.96),
    "paper-7x7": _scores(1.434, 3.94),
    "paper-9x9": _scores(1.461, 3.91),
    "paper-7x7-colour": _scores(2.799, 6.67),
    "paper-7x7-view-shift": _scores(2.564, 6.29),
    "paper-7x7-rotation": _scores(1.685, 5.54),
    "paper-7x7-scale": _scores(2.33, 5.69),
}
"""Table 2."""

WIDE = {
    "EPINET": {"rmse_px": 0.14, "mae_px": 0.036, "gpu_s": 0.93},
    "the paper's first rival": {"rmse_px": 1.87, "mae_px": 1.13, "gpu_s": 35},
    "the paper's second rival": {"rmse_px": 0.83, "mae_px": 0.34, "gpu_s": 0.8},
}
"""Table 3, on the original set."""

ENSEMBLE = {"EPINET 7x7": _scores(2.476, 4.931), "EPINET 7x7, ensemble": _scores(2.418, 4.645)}
"""Epinet-fcn and Epinet-fcn-m, means of the benchmark's twelve scenes."""
