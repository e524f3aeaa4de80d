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
mirrors, or the views are noisy). On a textureless wall any disparity agrees; so it is multiplied by

    1 / (1 + (deviation / 0.07 px)^2)

where the deviation is that of the best estimate (its Cramer-Rao bound) from the texture along the
epipolar lines against the noise, over a window (`observability`). Texture is what the straight and
the diagonal views show alike under the estimate; noise, which differs from view to view, is none.

Both kinds are lowered where the picture has texture and yet the views agree no better under the
estimate than under wrong disparities (`support`): there the views stand elsewhere, or the true
disparity was not looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from epinet.angular import star_positions
from epinet.inspect.disparity_range import LONGER_SIDE_PX
from epinet.inspect.information import disparity_deviation
from epinet.inspect.sweep import load_star, match_of_map
from epinet.lightfield import LightField
from epinet.networks.weights import EVENS_PX, STEEPEST
from epinet.shifts import sampled
from epinet.squares import box_mean
from epinet.synth.faults import ROUNDING

WITHIN_PX = 0.07
"""Errors up to this are what the benchmark calls good."""

AGREEMENT, PROBABILITY = "1: all views agree", f"probability of an error up to {WITHIN_PX} px"
"""What the two kinds of confidence mean."""
WITHHELD = "0 everywhere, as the views stand in the wrong order: see the warnings"

TOLERANCE = 0.02
"""Difference in luma (0..1) at which the confidence is one half: about 5 gray levels of 255."""

WINDOW_PX = 9
"""A disparity is taken to be the same over this square."""

SUPPORT_PX = 15
"""Support is judged over this square of a small picture."""
ELSEWHERE_PX = 8.0
"""Wrong disparities to compare with move the outermost views by this."""
NO_FIT, FIT = 1.1, 1.5
"""What wrong disparities leave over what the estimate leaves: none of the confidence remains, all
remains; it is 3 and more where views match."""

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
        with np.errstate(over="ignore", divide="ignore"):  # infinite odds: a confidence of 0
            odds = (expected_error_px.astype(np.float64) / self.even_px) ** self.steepness
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
def agreement(
    lf: LightField, disparity: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Photo-consistency of a map, and that times its observability; (H, W) each, in 0..1."""
    differences, *halves = _differences(lf, disparity)
    consistent = 1 / (1 + (differences / TOLERANCE) ** 2)
    seen = observability(lf, 2 * differences, *halves)
    return consistent.numpy(), (consistent * seen).numpy()


def observability(lf: LightField, noise: Tensor, straight: Tensor, diagonal: Tensor) -> Tensor:
    """(H, W) in 0..1: how well the views tell a disparity.

    Args:
        noise: (H, W) standard deviation of the views' noise, of samples in 0..1.
        straight: (H, W) mean of the views in the centre row and column, moved onto the centre view.
        diagonal: (H, W) that of the views of the diagonals.
    """
    row, col = lf.centre
    offsets = [(r - row, c - col) for r, c in star_positions(lf.grid[0])]
    gray = torch.from_numpy(np.ascontiguousarray(lf.gray(row, col)))
    noise = noise.square().add(ROUNDING**2).sqrt()
    deviation = disparity_deviation(
        gray[None, None],
        noise[None, None],
        offsets,
        window_px=WINDOW_PX,
        halves=(straight[None, None], diagonal[None, None]),
    )
    seen: Tensor = 1 / (1 + (deviation[0, 0] / WITHIN_PX) ** 2)
    return seen


@torch.inference_mode()
def support(lf: LightField, disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) in 0..1: 0 where the picture has texture, and yet the views agree no better under the
    map than under disparities that are surely wrong; 1 where they do, or where nothing tells."""
    star = load_star(lf, LONGER_SIDE_PX)
    small = star.shrunk_map(disparity)
    star = star.rings(float(small.abs().median()))
    elsewhere = ELSEWHERE_PX / star.radius
    costs = [match_of_map(star, small + move).cost for move in (0, elsewhere, -elsewhere)]
    textured = star.textured.float()
    means = box_mean(torch.stack([textured, *(cost * textured for cost in costs)]), SUPPORT_PX)
    fit = (means[2] + means[3]) / 2 / means[1].clamp_min(1e-9)
    kept = ((fit - NO_FIT) / (FIT - NO_FIT)).clamp(0, 1)
    kept = torch.where(means[0] > 0.3, kept, torch.ones_like(kept))
    return F.interpolate(kept[None, None], lf.size, mode="bilinear")[0, 0].numpy()


def _differences(lf: LightField, disparity: NDArray[np.float32]) -> tuple[Tensor, Tensor, Tensor]:
    """Of the views moved onto the centre view by a map, (H, W) each.

    Returns:
        mean difference of the better half of the views, over 3x3 pixels; and the means of the
        straight and of the diagonal views.
    """
    height, width = disparity.shape
    centre = lf.centre
    star = [p for p in star_positions(lf.grid[0]) if p != centre]
    views = torch.from_numpy(np.stack([lf.gray(*p) for p in star]))  # (P, H, W)
    reference = torch.from_numpy(np.ascontiguousarray(lf.gray(*centre)))
    moves = [(float(row - centre[0]), float(col - centre[1])) for row, col in star]
    d = torch.from_numpy(np.ascontiguousarray(disparity))
    rows = max(1, BAND_PX // width)
    bands = [
        _moved(views, reference[top : top + rows], d[top : top + rows], moves, top)
        for top in range(0, height, rows)
    ]
    residual, straight, diagonal = torch.cat(bands, 1)
    return box_mean(residual, 3), straight, diagonal


def _moved(
    views: Tensor, reference: Tensor, d: Tensor, moves: Sequence[tuple[float, float]], top: int
) -> Tensor:
    """(3, rows, W) for a band of rows: mean difference over the better half of the views, and the
    means of straight and diagonal ones."""
    seen = sampled(views[None], d[None, None], moves, top)[0]
    straight = torch.tensor([0 in move for move in moves])
    means = seen[straight].mean(0), seen[~straight].mean(0)
    difference = seen.sub_(reference).abs_()
    half = difference.shape[0] // 2
    return torch.stack([difference.topk(half, dim=0, largest=False).values.mean(0), *means])
