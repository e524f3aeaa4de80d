"""Which truth the benchmarks judge maps by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epinet.lightfield import LightField

SHOWING_MIRRORS = ("mirrors", "reflective")
"""Parts of the validation sets that are there to show what mirrors do."""


def judged_truth(scene: Path, lf: LightField) -> NDArray[np.float32] | None:
    """(H, W) truth of a scene; NaN on mirrors and panes, but in the parts made to show them."""
    part = scene.name.partition("_")[0]
    return lf.truth if part in SHOWING_MIRRORS else lf.reliable_truth
