"""The views of a light field as a network is to see them: in a square grid, in place, as bright."""

from __future__ import annotations

from dataclasses import dataclass, replace

from epinet.errors import InputError
from epinet.inspect.alignment import Alignment, estimate_alignment
from epinet.inspect.spacing import stretched
from epinet.inspect.sweep import Match
from epinet.inspect.views import Look, look_at
from epinet.lightfield import LightField
from epinet.refine import compensated


@dataclass(frozen=True)
class Prepared:
    """Views as they were read and as the network sees them, with what was measured of them."""

    as_read: LightField
    """Brightened where their samples are faint; `row_spacing` is the measured one."""
    seen: LightField
    """Also stretched to a square grid and compensated; its pictures may be larger."""
    look: Look | None
    """None where the origin of the views vouches for their order."""
    alignment: Alignment | None
    """Of the views before they were compensated, where it was measured."""
    is_matched: bool
    """Whether `match` is known: the look saw the views as the network sees them."""

    @property
    def match(self) -> Match | None:
        """Of the seen views, as `range_match` finds it, if it is known."""
        return self.look.match if self.look is not None and self.is_matched else None

    @property
    def enlargement(self) -> float:
        """How much wider pictures, and greater disparities, are in what the network sees."""
        return max(1.0, self.as_read.row_spacing)


def prepare(lf: LightField, refine: bool) -> Prepared:
    """Measure what is not known of the views, and put right what can be.

    Args:
        lf: the grid of views that the network takes.
        refine: whether to compensate misalignment and exposure.

    Raises:
        InputError: plain numbers name the views, and no square grid of them fits.
    """
    lf = lf.brightened()
    # Only parameters.cfg of a rendered scene vouches for the order.
    look = None if lf.camera is not None and not lf.captured else look_at(lf)
    if look is not None and look.order is not None:
        guessed = lf.layout == "numbered"
        if guessed and not look.order.is_grid:
            raise InputError(f"{lf.source or 'light field'}: {look.order.verdict}")
    spacing = 1.0 if look is None else look.row_spacing
    looked_at = seen = stretched(lf, spacing)
    alignment = estimate_alignment(seen) if refine else None
    if alignment is not None:
        seen = compensated(seen, alignment)
    same = look is not None and seen is looked_at
    return Prepared(replace(lf, row_spacing=spacing), seen, look, alignment, same)
