"""What a network's map is worth: how far it is trusted, and what may be wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.inspect.spacing import resized
from epinet.inspect.vignetting import black_corners
from epinet.lightfield import LightField
from epinet.networks.weights import CALIBRATION, Weights
from epinet.predict.confidence import (
    AGREEMENT,
    PROBABILITY,
    WITHHELD,
    Calibration,
    agreement,
    support,
)
from epinet.predict.doubts import (
    doubts_about_confidence,
    doubts_about_map,
    doubts_about_range,
    doubts_about_views,
    wrong_order,
)
from epinet.predict.preparation import Prepared
from epinet.refine import refined

STATED_TO_PX = 0.1
"""Ranges of disparities are stated to this."""

SUPPORTED = 0.9
"""Median support of a map that shows its views to stand in a grid, whatever was measured before."""

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Judged:
    """A map (H, W) with its confidence; both of the views that the network saw, or as read."""

    disparity: Floats
    confidence: Floats
    agreed: Floats
    """(H, W) in 0..1: where the map is right as far as the pixel itself tells; for refinement."""
    expected_error: Floats | None
    confidence_means: str
    warnings: tuple[str, ...]


def judge(
    views: Prepared,
    weights: Weights,
    found: Floats,
    error: Floats | None,
    *,
    scale: int,
    stated_px: tuple[float, float] | None,
    doubted: tuple[str, ...],
) -> Judged:
    """Bring a map into the stated range and judge it.

    Args:
        views: that it was estimated from.
        weights: of the network.
        found: (H, W) its map, in the views' pixels as the network saw them.
        error: (H, W) that it expects; None from one that expects none.
        scale: by which the views were shrunk for it.
        stated_px: range that the map is kept within, in the map's unit; None keeps it as it is.
        doubted: what was doubtful about the search for the range.

    Raises:
        InputError: the map is not finite.
    """
    lf, larger = views.seen, views.enlargement
    if not np.isfinite(found).all():
        raise InputError(
            f"{weights.source}: the network gives disparities that are not finite for "
            f"{lf.source or 'this light field'}; take other weights"
        )
    disparity = found if stated_px is None else _within(found, stated_px, larger)
    beyond = np.abs(found - disparity)
    if error is None:
        expected = None
        agreed, confidence = agreement(lf, disparity)
    else:
        expected = error + beyond
        calibration = Calibration(**weights.metadata.get(CALIBRATION) or {})
        agreed = confidence = calibration.confidence(expected / larger)
    supported = support(lf, disparity)
    confidence = confidence * supported
    means = AGREEMENT if error is None else PROBABILITY
    look = views.look
    no_grid = look is not None and look.order is not None and not look.order.is_grid
    if look is not None and no_grid and np.median(supported) > SUPPORTED:
        look = replace(look, order=None)  # disparities beyond those that it was sought with
    warnings = doubts_about_views(look, views.alignment)
    wrong = None if look is None else wrong_order(look, lf, disparity)
    if wrong is None:
        warnings += [*doubted, *doubts_about_confidence(confidence)]
    else:
        warnings = [wrong, *(warning for warning in warnings if warning != wrong)]
        confidence, means = np.zeros_like(confidence), WITHHELD
    warnings += doubts_about_map(weights, found / np.float32(larger), scale)
    warnings += doubts_about_range(stated_px, beyond)
    return Judged(disparity, confidence, agreed, expected, means, tuple(warnings))


def smoothed(judged: Judged, lf: LightField) -> Judged:
    """With the weighted median of the map, and holes filled.

    Args:
        lf: the views that the network saw.
    """
    guide = lf.unit(*lf.centre)
    images = (judged.disparity, guide, judged.agreed)
    tensors = (torch.from_numpy(np.ascontiguousarray(image)) for image in images)
    return replace(judged, disparity=refined(*tensors).numpy())


def as_read(judged: Judged, views: Prepared) -> tuple[Judged, LightField]:
    """Of the views as they were read: their pixels, per adjacent column, without black corners."""
    lf = views.seen
    spacing = views.as_read.row_spacing
    if spacing != 1:
        lf, larger = views.as_read, views.enlargement
        expected = judged.expected_error
        judged = replace(
            judged,
            disparity=resized(judged.disparity / larger, lf.size),
            confidence=resized(judged.confidence, lf.size),
            expected_error=None if expected is None else resized(expected / larger, lf.size),
            warnings=(
                *judged.warnings,
                f"rows are {spacing:.2f} times as far apart as columns (measured); the map is in "
                "px per adjacent column",
            ),
        )
    black = black_corners(lf)
    if not black.any():
        return judged, lf
    note = (
        f"{100 * black.mean():.1f} % of the picture, its corners, are black in every view: nothing "
        "is known there, and the confidence is 0"
    )
    confidence = np.where(black, np.float32(0), judged.confidence)
    return replace(judged, confidence=confidence), replace(lf, notes=(*lf.notes, note))


def _within(disparity: Floats, stated_px: tuple[float, float], larger: float) -> Floats:
    low, high = stated_px
    return disparity.clip(larger * (low - STATED_TO_PX), larger * (high + STATED_TO_PX))
