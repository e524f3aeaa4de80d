"""How well each view of a star agrees with the centre view under the disparities of a match.

In a regular grid all views agree about as well. Where some stand elsewhere, as every second row of
a serpentine scan does, those differ by about what chance leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from epinet.inspect.sweep import Match, Star

OUTLYING = 2.6
"""Views that differ by this times the median stand elsewhere; 1.9 is measured for hidden points in
views in their places, 4.2 and more for serpentine scans."""
FEW = 0.12
"""A larger share of such views is no fault of single views."""
MIN_FIT = 1.6
"""What chance leaves over what the best disparities leave: 1.5 and less is measured in grids of
no order, 3.8 and more in order, even under noise of 8 gray levels."""


@dataclass(frozen=True)
class Agreement:
    """Of the views of a star."""

    residuals: Tensor
    """(N,) mean truncated difference of each view to the centre view."""
    fit: float
    """What chance leaves over what the best disparities leave."""

    @property
    def outlying(self) -> float:
        """Share of the views that differ much more than the others."""
        limit = OUTLYING * self.residuals.median()
        return float((self.residuals > limit).float().mean())

    @property
    def is_grid(self) -> bool:
        """Whether the views stand on a square grid, but for a few."""
        return self.fit >= MIN_FIT and self.outlying <= FEW


@torch.inference_mode()
def agreement(star: Star, match: Match) -> Agreement:
    """How well the views of a star agree.

    Args:
        match: of the same star, with enough usable pixels.
    """
    difference = star.differences(match.disparity, star.offsets)
    chance = float(match.chance_cost[match.usable].mean())
    residuals = difference[:, match.usable].mean(1)
    return Agreement(residuals, chance / max(match.residual, 1e-9))
