"""What SweepNet gives, all stages of it."""

from __future__ import annotations

import math
from typing import NamedTuple

from torch import Tensor


class Estimates(NamedTuple):
    """What the network makes of views, all per adjacent view."""

    maps: list[Tensor]
    """(B, 1, H, W) disparity after the fill and each round of the refinements; the last is the
    result."""
    log_error: Tensor
    """(B, 1, H, W) logarithm of the mean error to expect of the last map, in px."""
    scores: Tensor
    """(B, D, h, w) of the hypotheses, at the resolution of the sweep."""
    hypotheses: Tensor
    """(D,) disparities of full-size pixels."""

    def scaled(self, factor: float) -> Estimates:
        """The same disparities in another unit."""
        return Estimates(
            [factor * m for m in self.maps],
            self.log_error + math.log(factor),
            self.scores,
            factor * self.hypotheses,
        )
