"""Which truth the benchmarks judge maps by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epinet.lightfield import LightField

OF_MIRRORS = "mirrors"
"""The path-traced scene that is there to show what mirrors do."""


def judged_truth(scene: Path, lf: LightField) -> NDArray[np.float32] | None:
    """(H, W) truth of a scene; NaN on mirrors and panes, but in the scene that is made of them."""
    return lf.truth if scene.name == OF_MIRRORS else lf.reliable_truth
