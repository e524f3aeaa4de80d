"""What may be wrong with an estimate, in words for the user."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from epinet.inspect.alignment import Alignment
from epinet.inspect.disparity_range import NOTHING_MATCHES, DisparityRange
from epinet.inspect.order import reversed_verdict, sign_votes
from epinet.inspect.sweep import Star
from epinet.inspect.views import Look
from epinet.lightfield import LightField
from epinet.networks.weights import Weights

LOW_CONFIDENCE = 0.5
MANY = 0.02
"""Share of the pixels that may lie beyond the stated range without a word."""
FAR_OUT_PX = 0.5
"""Views that stand so far out of place, root mean square, may as well be in the wrong order."""

Floats = NDArray[np.float32]


def doubts_about_views(look: Look | None, alignment: Alignment | None) -> list[str]:
    """Of views whose order is not known for sure: files of any name may number them otherwise.

    Args:
        look: at the views that the network is to see; None where their order is known.
        alignment: of them, where it was measured.
    """
    doubts = []
    if look is not None and look.order is not None and look.order.is_consistent is False:
        doubts.append(look.order.verdict)
    if alignment is not None and alignment.misalignment_px > FAR_OUT_PX:
        doubts.append(
            f"the views stand {alignment.misalignment_px:.2f} px out of place, which was "
            "compensated; if their order is wrong the map is, too: `epinet info` measures it"
        )
    return doubts


def wrong_order(look: Look, lf: LightField, disparity: Floats) -> str | None:
    """What to say where the order is clearly wrong; None otherwise.

    Args:
        lf: the views that the network saw.
        disparity: (H, W) that it found, whose occlusions tell the sign.
    """
    if look.order is not None:
        return look.order.verdict if look.order.is_consistent is False else None
    return reversed_verdict(sign_votes(lf, disparity), lf.order)


def doubts_about_search(found: DisparityRange | None, star: Star) -> list[str]:
    """Of the range of disparities that was measured.

    Args:
        found: None where nothing tells it.
        star: that it was measured on.
    """
    if found is not None and found.hits_limit:
        return [
            f"disparities may exceed the {found.search_px:.0f} px that are looked for: give their "
            "--range"
        ]
    if found is None and star.has_texture:
        return [NOTHING_MATCHES]
    return []


def doubts_about_map(weights: Weights, disparity: Floats, scale: int) -> list[str]:
    """Of disparities (H, W) that the network may not know."""
    bounds = weights.disparity_range_px
    if bounds is None:
        return []
    low, high = np.percentile(disparity, [1, 99]) / scale
    if bounds[0] <= low and high <= bounds[1]:
        return []
    return [
        f"disparities of {low:.1f}..{high:.1f} px exceed the {bounds[0]:g}.."
        f"{bounds[1]:g} px that the weights were trained for: try a larger --scale"
    ]


def doubts_about_confidence(confidence: Floats) -> list[str]:
    """Of a map that is mostly not to be trusted."""
    if np.median(confidence) >= LOW_CONFIDENCE:
        return []
    return [
        "the views disagree under the estimate, or show too little texture: is their order "
        "right, and are the disparities within range? `epinet info` measures both"
    ]


def doubts_about_range(stated_px: tuple[float, float] | None, beyond: Floats) -> list[str]:
    """Of the range that the scene's file or the user states.

    Args:
        stated_px: None where neither does, or the map need not stay within it.
        beyond: (H, W) how far the estimate lay beyond it.
    """
    share = float((beyond > 0).mean())
    if stated_px is None or share < MANY:
        return []
    low, high = stated_px
    return [
        f"{100 * share:.0f} % of the pixels lay beyond the stated {low:g}..{high:g} px and "
        "were set to its bounds: mirrors do; if it is wrong, correct it, or give --range "
        "or --no-range"
    ]
