"""Which of the 8 flips and transpositions of the view grid fits the images, if any.

Photo-consistency tells four classes apart: reversing both axes of the grid only turns d into -d, so
two arrangements share each class. Under the best one all views must agree (agreement.py), or no
arrangement of a square grid fits. Occlusion then tells the sign (occlusion.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from epinet.inspect.agreement import agreement
from epinet.inspect.occlusion import Votes, occlusion_votes
from epinet.inspect.spacing import Spacing, estimate_spacing, row_spacing, stretched
from epinet.inspect.sweep import (
    FINE_STEP_PX,
    TAIL,
    Match,
    Offset,
    Star,
    load_star,
    match_of_map,
    rough_match,
    rough_range,
    sweep,
)
from epinet.lightfield import LightField

MIN_GRID_MARGIN = 1.1
"""The second best class must leave at least this times the residual of the best."""
MIN_VOTES = 40
MIN_VOTE_MARGIN = 0.4
SIGN_LONGER_SIDE_PX = 512
"""Occlusions are a few pixels wide and need a finer image than the classes do."""
SIGN_STEP_PX = 0.5
SIGN_WINDOW = 3
"""A wider one fattens the edges, where the votes are."""


@dataclass(frozen=True)
class Arrangement:
    """A correction of the view order, as `LightField.reordered` makes it."""

    flip_rows: bool = False
    flip_cols: bool = False
    transpose: bool = False

    def moves(self, offset: Offset) -> Offset:
        """Where a view at this offset from the centre goes: transposed first, then flipped."""
        row, col = offset[::-1] if self.transpose else offset
        return -row if self.flip_rows else row, -col if self.flip_cols else col

    @property
    def reversed(self) -> Arrangement:
        """The other one of the class, with both axes reversed."""
        return Arrangement(not self.flip_rows, not self.flip_cols, self.transpose)

    @property
    def flags(self) -> tuple[str, ...]:
        """Command line flags; none if the order is right as it is."""
        named = {
            "--flip-rows": self.flip_rows,
            "--flip-cols": self.flip_cols,
            "--transpose": self.transpose,
        }
        return tuple(flag for flag, wanted in named.items() if wanted)

    def after(self, first: Arrangement) -> Arrangement:
        """The one that does in a single step what `first` and then this do.

        Example:
            >>> Arrangement(flip_rows=True).after(Arrangement(flip_rows=True, transpose=True))
            Arrangement(flip_rows=False, flip_cols=False, transpose=True)
        """
        rows, cols = first.flip_rows, first.flip_cols
        if self.transpose:
            rows, cols = cols, rows
        return Arrangement(
            rows != self.flip_rows, cols != self.flip_cols, first.transpose != self.transpose
        )

    def apply(self, lf: LightField) -> LightField:
        """The light field with its views put where they belong."""
        return lf.reordered(**asdict(self))

    def __str__(self) -> str:
        return " ".join(self.flags) or "no change"


CLASSES = (
    Arrangement(),
    Arrangement(flip_rows=True),
    Arrangement(transpose=True),
    Arrangement(flip_rows=True, transpose=True),
)
"""The simplest arrangement of each class; its `reversed` is the other one."""


@dataclass(frozen=True)
class OrderCheck:
    """What the images say about the order of the views."""

    correction: Arrangement
    """Puts the views in order; the simplest that remains possible where undecided."""
    decided_grid: bool
    """Whether one class of arrangements fits clearly better than the other three."""
    decided_sign: bool
    """Whether occlusion tells the sign of disparity, and so the arrangement within the class."""
    residuals: Mapping[Arrangement, float]
    """Mean difference of intensity left by the best plane, by class (its simplest arrangement)."""
    votes: Votes
    """Occlusions that speak for (near) and against (far) the sign after the correction."""
    given: Arrangement
    """The correction that had been made already, as a user may ask for it."""
    is_grid: bool = True
    """Whether any arrangement of a square grid fits, as far as the images tell."""
    spacing: Spacing | None = None
    """Of the rows as given; None where the images tell no disparity along them."""

    @property
    def in_all(self) -> Arrangement:
        """What to ask for in place of `given`."""
        return self.correction.after(self.given)

    @property
    def flags(self) -> tuple[str, ...]:
        """Command line flags that put the views in order, in place of those given."""
        return self.in_all.flags

    @property
    def remedy(self) -> str:
        """What the user is to give; both possibilities where occlusions do not tell."""
        possible = (self.in_all,) if self.decided_sign else (self.in_all, self.in_all.reversed)
        wanted = [" ".join(a.flags) for a in possible]
        if self.given == Arrangement():
            return " or ".join(text or "no change" for text in wanted)
        return f"{' or '.join(text or 'no flag' for text in wanted)} in place of {self.given}"

    @property
    def grid_margin(self) -> float:
        """Residual of the second best class over that of the best, 1 or more."""
        best, second = sorted(self.residuals.values())[:2]
        return second / max(best, 1e-9)

    @property
    def is_consistent(self) -> bool | None:
        """Whether the order is right as given; None where that stays open."""
        if not self.is_grid:
            return False
        if not self.decided_grid:
            return None
        if self.correction == Arrangement():
            return True if self.decided_sign else None
        return False

    @property
    def verdict(self) -> str:
        """One sentence for the user."""
        if not self.is_grid:
            return (
                "No arrangement of a square grid fits the views, which disagree under all of them: "
                "no flip puts a serpentine or shuffled order right, or makes a grid of a straight "
                "track; name the views by their rows and columns (view_<row>_<column>.png)."
            )
        if not self.decided_grid:
            return "The images have too little texture or parallax to tell the order of the views."
        fit = f"fits {self.grid_margin:.1f} times better than the next"
        if not self.decided_sign:
            return (
                f"The order of the views needs {self.remedy} (this {fit}); occlusions do not tell "
                "which, so disparity may have the wrong sign."
            )
        seen = f"{self.votes.near} of {self.votes.near + self.votes.far} occlusions agree"
        if self.is_consistent:
            return f"The order of the views is right (it {fit}; {seen})."
        return f"The order of the views is wrong: it needs {self.remedy} (this {fit}; {seen})."


def check_order(lf: LightField) -> OrderCheck:
    """Find the arrangement of the view grid under which the images are geometrically consistent.

    Only the views of the star are used, those of the largest central odd grid that are present.

    Raises:
        InputError: the grid is smaller than 3x3, or the star of views is missing.
    """
    star = load_star(lf)
    spacing = estimate_spacing(star)
    if (factor := row_spacing(spacing)) != 1:
        lf = stretched(lf, factor)
        star = load_star(lf)
    residuals, match = _class_residuals(star)
    best = min(CLASSES, key=lambda arrangement: residuals[arrangement])
    given = Arrangement(*lf.order)
    check = OrderCheck(Arrangement(), False, False, residuals, Votes(0, 0), given, spacing=spacing)
    if match is None:
        return replace(check, is_grid=not star.has_texture)
    is_grid = not star.has_texture or agreement(star.rearranged(best.moves), match).is_grid
    if check.grid_margin < MIN_GRID_MARGIN:
        return replace(check, is_grid=is_grid)
    votes = _sign_votes(lf, star, best, match)
    decided = votes.near + votes.far >= MIN_VOTES and abs(votes.margin) >= MIN_VOTE_MARGIN
    if decided and votes.margin < 0:
        best, votes = best.reversed, Votes(votes.far, votes.near)
    return OrderCheck(best, True, decided, residuals, votes, given, is_grid, spacing)


def _class_residuals(star: Star) -> tuple[dict[Arrangement, float], Match | None]:
    """The residual of each class, and the match of the best; None, and zeros, without any.

    A rough sweep of all classes finds how far disparities reach; a fine one compares the classes.
    """
    stars = {a: star.rearranged(a.moves) for a in CLASSES}
    rough = {a: rough_match(s) for a, s in stars.items()}
    while not any(match.is_distinct for match in rough.values()):
        if not star.can_widen:
            return dict.fromkeys(CLASSES, 0.0), None
        star = star.widened()
        stars = {a: s.widened() for a, s in stars.items()}
        rough = {a: rough_match(s) for a, s in stars.items()}
    low, high = rough_range(star, min(rough.values(), key=lambda match: match.residual))
    reach = max(abs(low), abs(high))
    fine = {a: sweep(s.rings(reach), -reach, reach, FINE_STEP_PX) for a, s in stars.items()}
    best = min(fine.values(), key=lambda match: match.residual)
    if not best.has_pixels:
        return dict.fromkeys(CLASSES, 0.0), None
    return {a: match.residual for a, match in fine.items()}, best


def _sign_votes(lf: LightField, matched: Star, arrangement: Arrangement, match: Match) -> Votes:
    star = load_star(lf, SIGN_LONGER_SIDE_PX).rearranged(arrangement.moves)
    low, high = (bound * star.scale / matched.scale for bound in match.disparity_percentiles(TAIL))
    star = star.rings(max(abs(low), abs(high)))
    match = sweep(star, low, high, SIGN_STEP_PX, window=SIGN_WINDOW, occlusions=True)
    return occlusion_votes(star, match) if match.has_pixels else Votes(0, 0)


@torch.inference_mode()
def sign_votes(lf: LightField, disparity: NDArray[np.float32]) -> Votes:
    """Occlusions that speak for and against the sign of a disparity map.

    Args:
        lf: whose centre view the map is of.
        disparity: (H, W) px per adjacent view.
    """
    star = load_star(lf, SIGN_LONGER_SIDE_PX)
    small = star.shrunk_map(disparity)
    star = star.rings(float(np.percentile(small.abs().numpy(), 99)))
    match = match_of_map(star, small, SIGN_WINDOW)
    return occlusion_votes(star, match) if match.has_pixels else Votes(0, 0)


def reversed_verdict(votes: Votes, order: tuple[bool, bool, bool]) -> str | None:
    """What to say where occlusions are clearly against the sign; None where they are not."""
    count = votes.near + votes.far
    if count < MIN_VOTES or votes.margin > -MIN_VOTE_MARGIN:
        return None
    given = Arrangement(*order)
    wanted = Arrangement().reversed.after(given)
    instead = "" if given == Arrangement() else f" in place of {given}"
    text = " ".join(wanted.flags) or "no flag"
    return (
        f"The order of the views is wrong: it needs {text}{instead} ({votes.far} of {count} "
        "occlusions show that near and far are exchanged)."
    )
