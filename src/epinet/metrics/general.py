"""The metrics that every scene with truth has: the benchmark's, and the paper's table 3."""

from __future__ import annotations

from math import nan

from epinet.metrics import disparity
from epinet.metrics.metric import Comparison, Metric

PAPER = "EPINET (Shin et al., CVPR 2018), table 3"


def badpix(threshold_px: float) -> Metric:
    """BadPix(t) of all pixels."""

    def compute(comparison: Comparison) -> float:
        return disparity.badpix(comparison.error(), threshold_px)

    return Metric(
        id=f"badpix_{threshold_px:g}",
        name=f"BadPix({threshold_text(threshold_px)})",
        unit="%",
        definition=f"Share of pixels with |estimate - truth| > {threshold_px:g} px or no estimate.",
        compute=compute,
        truth="scene",
    )


def threshold_text(threshold_px: float) -> str:
    """As the paper writes it.

    >>> threshold_text(0.07)
    '.07'
    """
    return f"{threshold_px:g}".removeprefix("0")


MSE = Metric(
    id="mse_x100",
    name="MSE x100",
    unit="px^2",
    definition="Mean squared error where there is an estimate, times 100.",
    compute=lambda comparison: disparity.mse_x100(comparison.error()),
    truth="scene",
)
Q25 = Metric(
    id="q25_x100",
    name="Q25 x100",
    unit="px",
    definition="25th percentile of |estimate - truth| where there is an estimate, times 100.",
    compute=lambda comparison: disparity.q25_x100(comparison.error()),
    truth="scene",
)
RMSE = Metric(
    id="rmse_px",
    name="RMSE",
    unit="px",
    definition="Root of the mean squared error where there is an estimate.",
    compute=lambda comparison: disparity.rmse_px(comparison.error()),
    truth="scene",
    source=PAPER,
)
MAE = Metric(
    id="mae_px",
    name="MAE",
    unit="px",
    definition="Mean of |estimate - truth| where there is an estimate.",
    compute=lambda comparison: disparity.mae_px(comparison.error()),
    truth="scene",
    source=PAPER,
)
MISSING = Metric(
    id="missing",
    name="Missing",
    unit="%",
    definition="Share of pixels without a finite estimate.",
    compute=lambda comparison: disparity.missing(comparison.error()),
    truth="scene",
    source="epinet",
)
RUNTIME = Metric(
    id="runtime",
    name="Runtime",
    unit="s",
    definition="Run time as stated by the method.",
    compute=lambda comparison: nan if comparison.seconds is None else comparison.seconds,
)
OF_ESTIMATES = (MSE, Q25, RMSE, MAE)
"""Those that pass over pixels without an estimate."""
