"""How far an estimate can be trusted.

SweepNet predicts its mean error b; the confidence is the probability that the error is at most
0.07 px, 1 / (1 + (b / even)^steepness), both fitted to the weights after training. How true that
is, is measured in docs/results.md. EPINET predicts no error; its confidence is how well the views
agree.

For each pixel of the centre view, the views of the star are sampled where the estimate says the
pixel is seen; r is the mean absolute difference to the centre (luma in 0..1, averaged over 3x3
pixels) over that half of the views which agrees best, since the other half may be occluded.

    confidence = 1 / (1 + (r / TOLERANCE)^2)

So 1 means that the views agree perfectly, 0.5 that they differ by TOLERANCE. It is
photo-consistency, not a probability: low where the estimate must be wrong (or the surface
mirrors, or the views are noisy), but high also on a textureless wall, where any disparity agrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from epinet.angular import star_positions
from epinet.lightfield import LightField
from epinet.model.checkpoint import EVENS_PX, STEEPEST
from epinet.shifts import sampled
from epinet.squares import box_mean

WITHIN_PX = 0.07
"""Errors up to this are what the benchmark calls good."""

AGREEMENT, PROBABILITY = "1: all views agree", f"probability of an error up to {WITHIN_PX} px"
"""What the two kinds of confidence mean."""

TOLERANCE = 0.02
"""Difference in luma (0..1) at which the confidence is one half: about 5 gray levels of 255."""

BAND_PX = 2**17
"""Pixels handled at once, to bound memory: some 200 MB with 32 views."""


@dataclass(frozen=True)
class Calibration:
    """How often an expected error means a good estimate."""

    even_px: float = WITHIN_PX
    """Of the expected error at which half of the estimates are good."""
    steepness: float = 2.0

    def confidence(self, expected_error_px: NDArray[np.float32]) -> NDArray[np.float32]:
        """Probability (...) in 0..1 of an error up to `WITHIN_PX`."""
        with np.errstate(
            over="ignore", divide="ignore"
        ):  # odds without bound are a confidence of 0
            odds = (expected_error_px / self.even_px) ** self.steepness
        return (1 / (1 + odds)).astype(np.float32)

    @classmethod
    def fitted(cls, expected_error_px: NDArray[Any], error_px: NDArray[Any]) -> Calibration:
        """The likeliest one: a logistic regression on the logarithm of the expected error.

        Args:
            expected_error_px: (N,) of estimates whose true error is known.
            error_px: (N,)
        """
        from scipy.optimize import minimize  # takes .6 s, which predictions need not wait for

        x = np.log(expected_error_px.astype(np.float64))
        middle, spread = x.mean(), x.std() + 1e-9
        x = (x - middle) / spread
        bad = (error_px > WITHIN_PX).astype(np.float64)

        def unlikely(parameters: NDArray[np.float64]) -> float:
            odds = parameters[0] + parameters[1] * x
            return float(np.mean(np.logaddexp(0, odds) - bad * odds))

        shift, slope = minimize(unlikely, np.array([0.0, 1.0])).x
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            fit = np.exp(middle - spread * shift / slope), slope / spread
        bounds = (*EVENS_PX, -STEEPEST, STEEPEST)
        even, steepness = np.nan_to_num(fit, nan=0.0).clip(bounds[::2], bounds[1::2])
        return cls(float(even), float(steepness))


@torch.inference_mode()
def photo_consistency(lf: LightField, disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Confidence (H, W) in 0..1 of a disparity map (H, W) of the centre view."""
    height, width = disparity.shape
    centre = lf.centre
    star = [p for p in star_positions(lf.grid[0]) if p != centre]
    views = torch.from_numpy(np.stack([lf.gray(*p) for p in star]))  # (P, H, W)
    reference = torch.from_numpy(np.ascontiguousarray(lf.gray(*centre)))
    moves = [(float(row - centre[0]), float(col - centre[1])) for row, col in star]
    d = torch.from_numpy(np.ascontiguousarray(disparity))
    rows = max(1, BAND_PX // width)
    residual = torch.cat(
        [
            _residual(views, reference[top : top + rows], d[top : top + rows], moves, top)
            for top in range(0, height, rows)
        ]
    )
    smooth = box_mean(residual, 3)
    return (1 / (1 + (smooth / TOLERANCE) ** 2)).numpy()


def _residual(
    views: Tensor, reference: Tensor, d: Tensor, moves: Sequence[tuple[float, float]], top: int
) -> Tensor:
    """(rows, W) mean difference over the better half of the views, for a band of rows."""
    difference = (sampled(views[None], d[None, None], moves, top)[0] - reference).abs()
    half = difference.shape[0] // 2
    return difference.topk(half, dim=0, largest=False).values.mean(0)
