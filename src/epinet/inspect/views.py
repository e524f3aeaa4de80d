"""A quick look at views whose origin does not vouch for their order, before the network sees them.

Their star is swept once or twice on small pictures. Only where that leaves doubts are all
arrangements compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from epinet.inspect.agreement import agreement
from epinet.inspect.disparity_range import LONGER_SIDE_PX, range_match
from epinet.inspect.order import OrderCheck, check_order
from epinet.inspect.spacing import estimate_spacing, row_spacing, stretched
from epinet.inspect.sweep import Match, load_star
from epinet.lightfield import LightField

CLEAR_FIT = 4.5
"""Under the right order chance leaves 5.2 to 7.6 times what the best disparities leave on real
scenes, under another class of orders 3.1 and less."""


@dataclass(frozen=True)
class Look:
    """What the views say of their grid."""

    row_spacing: float
    """In units of the columns' distance; 1 as far as the views tell no other."""
    order: OrderCheck | None
    """Where the views left doubts that they stand in order, up to the sign of disparity."""
    match: Match | None
    """Of the views `stretched` by that spacing, as `range_match` finds it."""


@torch.inference_mode()
def look_at(lf: LightField) -> Look:
    """Measure the spacing of the rows and, where it is in doubt, the order.

    Raises:
        InputError: as `check_order`.
    """
    star = load_star(lf, LONGER_SIDE_PX)
    spacing = row_spacing(estimate_spacing(star))
    if spacing != 1:
        star = load_star(stretched(lf, spacing), LONGER_SIDE_PX)
    match = range_match(star)
    if match is not None:
        agreed = agreement(star, match)
        if agreed.is_grid and agreed.fit >= CLEAR_FIT:
            return Look(spacing, None, match)
    elif not star.has_texture:
        return Look(spacing, None, match)
    order = check_order(lf)
    measured = row_spacing(order.spacing)
    if measured not in (1, spacing):
        spacing = measured
        match = range_match(load_star(stretched(lf, spacing), LONGER_SIDE_PX))
    return Look(spacing, order, match)
