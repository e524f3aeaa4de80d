"""The range of disparities that a light field shows, measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from epinet.inspect.sweep import (
    FINE_STEP_PX,
    ROUGH_STEP_PX,
    TAIL,
    WINDOW,
    Match,
    Star,
    distinct_match,
    load_star,
    refined_match,
    rough_match,
)
from epinet.lightfield import LightField
from epinet.squares import box_mean

LONGER_SIDE_PX = 192
"""Longer side of the working images: enough for a range, in half the time of the usual one."""
SPACING_PX = 1 / 3
"""Planes lie so far apart, in pixels per adjacent view, where a sweep's steps are no finer than
that: with many views fewer planes do."""
PART_PX, PART_SHARE = 9, 0.6
"""A part of the picture holds a square of so many working pixels, but for a few of them: this share
of them belongs to it at least. Real scenes have no such part that nothing explains; rendered ones
have, beside wide occlusions and in mirrors, but none that larger disparities explain."""
STEADY_PX = 1.0
"""Neighbours that match in earnest differ by less, root mean square, in working pixels."""
LEAST_SLACK_PX, SLACK = 0.5, 0.1
"""A search goes so much, or this share of its range, beyond the disparities that are known."""
NOTHING_MATCHES = (
    "the views have texture, but nothing matches within the disparities that were searched, as far "
    "as views of this size tell: are the views in order? If disparities are known, give --range"
)
"""What to say where a range cannot be told, though not for lack of texture."""


@dataclass(frozen=True)
class DisparityRange:
    """Disparities that a light field shows, in pixels per adjacent view."""

    min_px: float
    """Farthest: 0.5 percent of the textured, well explained pixels are below."""
    max_px: float
    """Nearest: 0.5 percent are above."""
    search_px: float
    """Disparities from -search_px to search_px were tried."""
    hits_limit: bool
    """The range ends where the search ended, so the true one may be wider."""

    @classmethod
    def of(cls, star: Star, match: Match) -> DisparityRange:
        """That of a star's match, see `range_match`."""
        low, high = match.disparity_percentiles(TAIL)
        return cls(
            min_px=low / star.scale,
            max_px=high / star.scale,
            search_px=match.search / star.scale,
            hits_limit=_hits_limit(star, match),
        )

    def divided(self, factor: float) -> DisparityRange:
        """That of pictures that were stretched by the factor, in px of the unstretched ones."""
        return replace(
            self,
            min_px=self.min_px / factor,
            max_px=self.max_px / factor,
            search_px=self.search_px / factor,
        )

    def __str__(self) -> str:
        text = f"{self.min_px:.2f}..{self.max_px:.2f} px per adjacent view"
        return f"{text}, perhaps wider than the search" if self.hits_limit else text


@torch.inference_mode()
def estimate_range(lf: LightField) -> DisparityRange | None:
    """Measure the range of disparities by a plane sweep, rough to fine. None without texture.

    The views must stand in the right order (see `check_order`). Good to about 0.3 px; surfaces
    of under 0.5 percent of the textured pixels are left out on purpose.

    Raises:
        InputError: the grid is smaller than 3x3, or the star of views is missing.
    """
    star = load_star(lf, LONGER_SIDE_PX)
    match = range_match(star)
    return None if match is None else DisparityRange.of(star, match)


def range_match(star: Star) -> Match | None:
    """A plane sweep, rough to fine, that tells the range. None without texture or a match.

    Where the range ends with the search, or a part of the picture matches only beyond it, as
    something near does before a far background, a wider one is tried.

    Args:
        star: exposed alike, in working images of LONGER_SIDE_PX.
    """
    match = _match_within(star)
    while match is not None and _hits_limit(star, match) and star.can_widen:
        star = star.widened()
        match = _match_within(star)
    return match


def _match_within(star: Star) -> Match | None:
    found = distinct_match(star)
    return None if found is None else refined_match(*_with_all_parts(*found), _step_px(star))


def _with_all_parts(star: Star, rough: Match) -> tuple[Star, Match]:
    """The star and its rough match, or such of a wider search that explains a textured part which
    this one does not."""
    wider, unexplained = star, star.textured & ~rough.explained
    while _is_part(unexplained) and wider.can_widen:
        wider = wider.widened()
        tried = rough_match(wider)
        mean, mean_square = box_mean(torch.stack([tried.disparity, tried.disparity**2]), WINDOW)
        steady = mean_square - mean**2 < STEADY_PX**2
        beyond = tried.usable & tried.explained & (tried.disparity.abs() > star.search)
        if _is_part(unexplained & steady & beyond):
            star, rough, unexplained = wider, tried, unexplained & ~tried.explained
    return star, rough


def _is_part(pixels: Tensor) -> bool:
    """Whether pixels (H, W) hold a square that is of meaningful size."""
    return float(box_mean(pixels[None].float(), PART_PX).max()) > PART_SHARE


def _hits_limit(star: Star, match: Match) -> bool:
    low, high = match.disparity_percentiles(TAIL)
    return max(-low, high) >= match.search - _step_px(star)


def _step_px(star: Star) -> float:
    return min(ROUGH_STEP_PX, max(FINE_STEP_PX, SPACING_PX * star.scale * star.radius))


def searched(low_px: float, high_px: float) -> tuple[float, float]:
    """Where to look for the disparities of a scene that lie between these, px."""
    slack = max(LEAST_SLACK_PX, SLACK * (high_px - low_px))
    return low_px - slack, high_px + slack
