"""Metrics that the benchmark's four stratified scenes have of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.metrics import disparity
from epinet.metrics.metric import Comparison, Metric
from epinet.metrics.regions import badpix_within
from epinet.metrics.surfaces import BUMPINESS_CLIP, bumpiness_x100

FOREGROUND_COLUMN_PX = 14
"""Of backgammon, in pixels of the light field: it shows the foreground alone, in every row."""
BACKGROUND_COLUMN_FROM_RIGHT_PX = 11
"""Of backgammon, in pixels of the truth, the last being the first: background alone."""

MISSED_DOT_PX, MISSED_DOT_PERCENT = 0.4, 50
DOT_SIZES = range(1, 9)
"""Numbers in the mask `dots_by_size` that are scored; the ninth size is not."""

NUMBERED = frozenset({"boxes", "dots_by_size"})
"""Masks whose gray levels are numbers of parts."""

BACKGAMMON, DOTS, PYRAMIDS, STRIPES = "backgammon", "dots", "pyramids", "stripes"


def _backgammon_fattening(comparison: Comparison) -> float:
    column = FOREGROUND_COLUMN_PX * comparison.scale
    return _beyond_half_way(comparison, "foreground_fattening", column, nearer=True)


def _backgammon_thinning(comparison: Comparison) -> float:
    column = comparison.truth.shape[1] - BACKGROUND_COLUMN_FROM_RIGHT_PX
    return _beyond_half_way(comparison, "foreground_thinning", column, nearer=False)


def _beyond_half_way(comparison: Comparison, mask: str, column: int, *, nearer: bool) -> float:
    """Percent of the mask estimated beyond the mean of its truth and that of the column."""
    if not 0 <= column < comparison.truth.shape[1]:
        return float("nan")
    half_way = 0.5 * (comparison.truth + comparison.truth[:, column : column + 1])
    region = comparison.region(mask) & np.isfinite(half_way)
    beyond = np.where(np.isfinite(comparison.estimate), comparison.estimate, np.nan) - half_way
    return disparity.percent(~((beyond <= 0) if nearer else (beyond >= 0))[region])


def _missed_dots(comparison: Comparison) -> float:
    boxes, sizes = comparison.masks["boxes"], comparison.masks["dots_by_size"]
    known = np.isfinite(comparison.truth)
    missed = []
    for box in np.unique(boxes[boxes > 0]):
        in_box = (boxes == box) & known
        for size in DOT_SIZES:
            dot: NDArray[Any] = np.abs(comparison.difference[in_box & (sizes == size)])
            if dot.size:
                missed.append(disparity.badpix(dot, MISSED_DOT_PX) >= MISSED_DOT_PERCENT)
    return disparity.percent(np.array(missed, dtype=bool))


def _stripes(mask: str, name: str, where: str) -> Metric:
    return badpix_within(
        mask,
        where,
        id=f"stripes_{mask}",
        name=f"Stripes: {name}",
        truth="high",
        scene=STRIPES,
    )


def _pyramids(id_: str, name: str, where: str, masks: tuple[str, ...]) -> Metric:
    return Metric(
        id=id_,
        name=f"Pyramids: {name}",
        unit="x100",
        definition="Frobenius norm of the Hessian (Scharr's kernel twice) of estimate - truth, "
        f"at most {BUMPINESS_CLIP:g}, mean on {where}, times 100.",
        compute=lambda comparison: bumpiness_x100(comparison, *masks),
        masks=masks,
        scene=PYRAMIDS,
    )


STRATIFIED = (
    Metric(
        id="backgammon_fattening",
        name="Backgammon: Fattening",
        unit="%",
        definition="Share of the background near the foreground that is estimated nearer than "
        "half-way to the foreground, or not at all; the foreground is extrapolated along its row.",
        compute=_backgammon_fattening,
        masks=("foreground_fattening",),
        truth="high",
        scene=BACKGAMMON,
    ),
    Metric(
        id="backgammon_thinning",
        name="Backgammon: Thinning",
        unit="%",
        definition="Share of the thin foreground that is estimated farther than half-way to the "
        "background, or not at all; the background is extrapolated along its row.",
        compute=_backgammon_thinning,
        masks=("foreground_thinning",),
        truth="high",
        scene=BACKGAMMON,
    ),
    Metric(
        id="dots_background_mse_x100",
        name="Dots: Background MSE x100",
        unit="px^2",
        definition="Mean squared error of the background where there is an estimate, times 100.",
        compute=lambda comparison: disparity.mse_x100(comparison.error("background")),
        masks=("background",),
        truth="high",
        scene=DOTS,
    ),
    Metric(
        id="dots_missed",
        name="Dots: Missed Dots",
        unit="%",
        definition=f"Share of the dots, of the {len(DOT_SIZES)} sizes in each box, with "
        f"BadPix({MISSED_DOT_PX:g}) of at least {MISSED_DOT_PERCENT} %; the border counts.",
        compute=_missed_dots,
        masks=("boxes", "dots_by_size"),
        truth="high",
        scene=DOTS,
    ),
    _pyramids(
        "pyramids_bumpiness_slanted",
        "Bump. Slanted",
        "spheres and pyramids",
        ("pyramids", "sphere_in", "sphere_out"),
    ),
    _pyramids("pyramids_bumpiness_parallel", "Bump. Parallel", "the parallel plane", ("plane",)),
    _stripes("low_texture", "Low Texture", "on the background of low texture"),
    _stripes("high_contrast", "Dark Stripes", "near the dark stripes, of high contrast"),
    _stripes("low_contrast", "Bright Stripes", "near the bright stripes, of low contrast"),
)
