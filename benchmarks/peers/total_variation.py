"""Total variation with an L1 data term, as Wanner and Goldluecke (PAMI 2014) smooth disparities."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]

DATA = 1.0
"""Weight of a wholly trusted pixel's distance from its datum, against total variation."""
EDGE = 20.0
"""Total variation counts exp(-EDGE * step of gray) where the picture has a step (gray in 0..1)."""
ITERATIONS = 300
STEP, DUAL_STEP = 0.1 * 8**-0.5, 10 * 8**-0.5
"""Of the map, whose waves across untrusted pixels a small one damps, and of its dual."""
FILL_SCALES_PX = (2, 8, 32)


def smoothed(datum: Array, trust: Array, gray: Array, data: float = DATA) -> Array:
    """The map u that minimises  sum g |grad u| + data * trust * |u - datum|.

    Chambolle and Pock's first-order primal-dual algorithm (2011, algorithm 1).

    Args:
        datum: (H, W) what was measured.
        trust: (H, W) in 0..1; where it is 0, the neighbours decide.
        gray: (H, W) in 0..1, the picture whose steps the map may follow.
    """
    g = np.exp(-EDGE * np.hypot(*_gradient(gray)))
    pull = np.float32(STEP * data) * trust
    u = _filled(datum, trust)
    ahead = u
    p = np.zeros((2, *u.shape), np.float32)
    for _ in range(ITERATIONS):
        p += np.float32(DUAL_STEP) * _gradient(ahead)
        p *= g / np.maximum(np.hypot(*p), g)  # into the discs of radius g
        moved = u + np.float32(STEP) * _divergence(p)
        new = moved - np.clip(moved - datum, -pull, pull)
        ahead = 2 * new - u
        u = new
    return u


def _filled(datum: Array, trust: Array) -> Array:
    """A start: the datum where it is trusted, else the mean of what is trusted around."""
    total, weight = np.zeros_like(datum), np.full_like(datum, 1e-12)
    for scale in FILL_SCALES_PX:
        share = np.float32(scale**-4.0)  # the near ones decide where there are any
        total += share * cv2.GaussianBlur(datum * trust, (0, 0), scale)
        weight += share * cv2.GaussianBlur(trust, (0, 0), scale)
    return trust * datum + (1 - trust) * total / weight


def _gradient(u: Array) -> Array:
    """(2, H, W) forward differences along rows and columns, 0 at the far edges."""
    gradient = np.zeros((2, *u.shape), np.float32)
    np.subtract(u[1:], u[:-1], out=gradient[0, :-1])
    np.subtract(u[:, 1:], u[:, :-1], out=gradient[1, :, :-1])
    return gradient


def _divergence(p: Array) -> Array:
    """The negative adjoint of `_gradient`."""
    divergence = np.zeros(p.shape[1:], np.float32)
    divergence[:-1] += p[0, :-1]
    divergence[1:] -= p[0, :-1]
    divergence[:, :-1] += p[1, :, :-1]
    divergence[:, 1:] -= p[1, :, :-1]
    return divergence
