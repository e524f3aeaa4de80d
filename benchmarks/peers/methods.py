"""The methods that run in this Python, by name: from a light field to a map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import epinet
from benchmarks.peers import plane_sweep, structure_tensor
from benchmarks.stated_ranges import kept
from epinet.inspect import estimate_range
from epinet.lightfield import LightField
from epinet.predict.estimator import search_range

KERAS = "Keras EPINET"
OURS = {"SweepNet": "sweepnet", "EPINET": "epinet"}
CLASSICAL = {
    "structure tensor": structure_tensor.estimate,
    "plane sweep": plane_sweep.estimate,
}
METHODS = (*CLASSICAL, KERAS, *OURS)
Estimate = tuple[NDArray[np.float32], bool | None]
"""A map, and of ours whether it was kept within the range that the scene states."""


def estimator(method: str) -> Callable[[LightField], Estimate]:
    """A method that is ready to run; its weights are loaded."""
    if method in OURS:
        model = epinet.load_model(model=OURS[method], device="cpu")

        def predict(lf: LightField) -> Estimate:
            result = model.predict(lf)
            return result.disparity, kept(result)

        return predict
    estimate = CLASSICAL[method]
    return lambda lf: (estimate(lf, disparity_range(lf)), None)


def disparity_range(lf: LightField) -> tuple[float, float]:
    """What parameters.cfg states, as the benchmark gives it to everyone; else what views show."""
    stated_px = lf.camera.disparity_range_px if lf.camera else None
    return stated_px or search_range(estimate_range(lf))
