"""What may be wrong with an estimate, in words for the user."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from epinet.inspect.alignment import Alignment
from epinet.inspect.order import check_order
from epinet.inspect.sweep import largest_searched_px
from epinet.lightfield import LightField
from epinet.model.checkpoint import Weights

LOW_CONFIDENCE = 0.5
MANY = 0.02
"""Share of the pixels that may lie beyond the stated range without a word."""
FAR_OUT_PX = 0.5
"""Views that stand so far out of place, root mean square, may as well be in the wrong order."""

Floats = NDArray[np.float32]


def doubts_about_views(lf: LightField, alignment: Alignment | None) -> list[str]:
    """Of a camera's views: files of any name may number them in another order.

    Args:
        lf: the views that the network is to see.
        alignment: of them, where it was measured.
    """
    doubts = []
    if lf.captured:
        order = check_order(lf)
        if order.is_consistent is False:
            doubts.append(order.verdict)
    if alignment is not None and alignment.misalignment_px > FAR_OUT_PX:
        doubts.append(
            f"the views stand {alignment.misalignment_px:.2f} px out of place, which was "
            "compensated; if their order is wrong the map is, too: `epinet info` measures it"
        )
    return doubts


def doubts_about_map(
    weights: Weights,
    disparity: Floats,
    confidence: Floats,
    searched_px: tuple[float, float] | None,
    scale: int,
    measured: bool,
) -> list[str]:
    """Of disparities (H, W) and their confidence.

    Args:
        searched_px: disparities that the network looked for, in views shrunk by the scale; None
            from one that is bound to those it was trained for.
        measured: whether the views told them, rather than the user.
    """
    doubts = []
    bounds = weights.disparity_range_px
    if bounds is not None:
        low, high = np.percentile(disparity, [1, 99]) / scale
        if low < bounds[0] or high > bounds[1]:
            doubts.append(
                f"disparities of {low:.1f}..{high:.1f} px exceed the {bounds[0]:g}.."
                f"{bounds[1]:g} px that the weights were trained for: try a larger --scale"
            )
    limit = largest_searched_px(min(disparity.shape))
    if searched_px is not None and measured and scale * max(map(abs, searched_px)) >= limit:
        doubts.append(
            f"disparities may exceed the {limit:.0f} px that are looked for: give their --range"
        )
    if np.median(confidence) < LOW_CONFIDENCE:
        doubts.append(
            "the views disagree under the estimate: is their order right, and are the "
            "disparities within range? `epinet info` measures both"
        )
    return doubts


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
