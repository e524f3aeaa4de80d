"""What reports and pages say of the range that a scene states: whether maps were kept within it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from epinet.benchmark.table import ranges_text
from epinet.predict.result import Result

KEPT = "kept_within_stated_range"
"""Key in reports."""
BEFORE = (
    "Maps of both networks, EPINET's, too, were kept within the range of disparities that a scene "
    "states, as `predict` did when this was measured."
)


def kept(result: Result) -> bool:
    """Whether a map was kept within the range that its scene states."""
    return result.settings["stated_px"] is not None


def note(maps: Mapping[str, Sequence[bool | None]]) -> str:
    """What a page says of maps.

    Args:
        maps: by model, of each map; None where a report does not record it.
    """
    is_recorded = any(each is not None for of_model in maps.values() for each in of_model)
    return ranges_text(maps) if is_recorded else BEFORE
