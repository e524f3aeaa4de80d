"""Metrics of the regions where depth estimation fails: edges, thin things, hidden ground."""

from __future__ import annotations

from typing import Any

from epinet.metrics import disparity
from epinet.metrics.metric import Comparison, Metric

BADPIX_PX = 0.07
FINE_PX = 0.15


def badpix_within(mask: str, where: str, **about: Any) -> Metric:
    """BadPix(.07) inside a mask.

    Args:
        where: the region, as the definition names it.
        about: the metric's `id`, `name` and what else differs from the defaults.
    """
    return Metric(
        unit="%",
        definition=f"BadPix({BADPIX_PX:g}) {where}.",
        compute=lambda comparison: disparity.badpix(comparison.error(mask), BADPIX_PX),
        masks=(mask,),
        **about,
    )


def _fine_fattening(comparison: Comparison) -> float:
    return disparity.percent(
        ~(comparison.difference[comparison.region("fine_surrounding")] <= FINE_PX)
    )


def _fine_thinning(comparison: Comparison) -> float:
    return disparity.percent(~(comparison.difference[comparison.region("fine")] >= -FINE_PX))


DISCONTINUITIES = badpix_within(
    "discontinuities",
    "at edges of depth",
    id="discontinuities",
    name="Discontinuities",
    truth="high",
)
FINE_FATTENING = Metric(
    id="fine_fattening",
    name="Fine Fattening",
    unit="%",
    definition="Share of the pixels around fine structures with truth - estimate < "
    f"-{FINE_PX:g} px or no estimate.",
    compute=_fine_fattening,
    masks=("fine_surrounding",),
    truth="high",
)
FINE_THINNING = Metric(
    id="fine_thinning",
    name="Fine Thinning",
    unit="%",
    definition="Share of the pixels on fine structures with truth - estimate > "
    f"{FINE_PX:g} px or no estimate.",
    compute=_fine_thinning,
    masks=("fine",),
    truth="high",
)


def _part(mask: str, name: str, where: str) -> Metric:
    return badpix_within(mask, where, id=f"badpix_{mask}", name=name, source="epinet")


def _matchable(comparison: Comparison) -> float:
    seen = comparison.scored & ~(comparison.masks["invalid"] > 0)
    return disparity.badpix(comparison.error()[seen[comparison.scored]], BADPIX_PX)


PARTS = (
    _part("planes", "BadPix Planes", "on planes"),
    _part("smooth_surfaces", "BadPix Surfaces", "on smooth surfaces that are no planes"),
    _part("occluded", "BadPix Occluded", "where some view does not see the surface"),
    Metric(
        id="badpix_matchable",
        name="BadPix Matchable",
        unit="%",
        definition=f"BadPix({BADPIX_PX:g}) but for mirrors and panes (the mask `invalid`).",
        compute=_matchable,
        masks=("invalid",),
        source="epinet",
    ),
)
"""BadPix of what the masks of rendered scenes tell apart."""
