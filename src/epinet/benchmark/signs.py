"""Maps that look as if their sign were the opposite one."""

from __future__ import annotations

import numpy as np

from epinet.benchmark.evaluate import Evaluation, Method
from epinet.benchmark.scenes import Scene
from epinet.io.problems import listed
from epinet.metrics.disparity import BADPIX_THRESHOLDS_PX
from epinet.metrics.metric import Comparison

_SHARE = 0.5
"""The opposite sign is suspected where it takes the median error below this share of what it is."""


def opposite_signs(evaluation: Evaluation) -> list[str]:
    """A line for each method of whose maps most come much nearer to the truth as their negatives.

    Raises:
        InputError: a map cannot be read any more.
    """
    hints = []
    for method in evaluation.methods:
        scenes = [s.name for s in evaluation.scenes if _is_opposite(evaluation, method, s)]
        if 2 * len(scenes) > len(evaluation.scenes):
            hints.append(
                f"hint: the maps of {method.name} seem to have the opposite sign: multiplied by "
                f"-1, those of {listed(scenes, 12)} come much nearer to the truth; positive is "
                "nearer to the camera"
            )
    return hints


def _is_opposite(evaluation: Evaluation, method: Method, scene: Scene) -> bool:
    """By the medians of the errors at the pixels that are scored and have an estimate."""
    estimate = evaluation.estimate(method, scene)
    here = Comparison(estimate, scene.truth, border_px=evaluation.border_px).scored
    here = here & np.isfinite(estimate)
    if not here.any():
        return False
    estimates, truths = estimate[here].astype(np.float64), scene.truth[here].astype(np.float64)
    error = float(np.median(np.abs(estimates - truths)))
    opposite = float(np.median(np.abs(estimates + truths)))
    return error > max(BADPIX_THRESHOLDS_PX) and opposite < _SHARE * error
