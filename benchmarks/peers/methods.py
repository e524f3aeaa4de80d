"""The methods that run in this Python, by name: from a light field to a map and its time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import epinet
from benchmarks.peers import plane_sweep, structure_tensor
from epinet.lightfield import LightField
from epinet.predict.estimator import search_range

KERAS = "Keras EPINET"
OURS = {"SweepNet": "sweepnet", "EPINET": "epinet"}
CLASSICAL = {
    "structure tensor": structure_tensor.estimate,
    "plane sweep": plane_sweep.estimate,
}
METHODS = (*CLASSICAL, KERAS, *OURS)


@dataclass(frozen=True)
class Estimate:
    """A map and what it took, without reading the light field."""

    disparity: NDArray[np.float32]
    seconds: float
    """From the views in memory to the map, any search for the range of disparities included."""
    network_s: float | None = None
    """Of that, the network alone."""


def estimator(method: str) -> Callable[[LightField], Estimate]:
    """A method that is ready to run; its weights are loaded."""
    if method in OURS:
        model = epinet.load_model(model=OURS[method], device="cpu")

        def predict(lf: LightField) -> Estimate:
            result = model.predict(lf)
            prepare_s, network_s = result.seconds["prepare"], result.seconds["network"]
            return Estimate(result.disparity, prepare_s + network_s, network_s)

        return predict
    estimate = CLASSICAL[method]

    def timed(lf: LightField) -> Estimate:
        begun = time.perf_counter()
        disparity = estimate(lf, disparity_range(lf))
        return Estimate(disparity, time.perf_counter() - begun)

    return timed


def disparity_range(lf: LightField) -> tuple[float, float]:
    """What parameters.cfg states, as the benchmark gives it to everyone; else what views show."""
    camera = lf.camera
    if camera and camera.disparity_min_px is not None and camera.disparity_max_px is not None:
        return camera.disparity_min_px, camera.disparity_max_px
    return search_range(lf)
