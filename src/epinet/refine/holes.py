"""Refinement of an estimated map: the weighted median everywhere, and holes filled.

A hole is where the estimate is hardly trusted. It takes the weighted median of the trusted values
around that look alike, from the smallest window that holds enough of them; the windows grow by
looking at every third, then every ninth pixel only.
"""

from __future__ import annotations

import torch
from torch import Tensor

from epinet.refine.median import weighted_median

HOLE_CONFIDENCE = 0.2
"""Below this a value counts as missing."""

SPACINGS_PX = (1, 3, 9)
"""Of the pixels of the windows in which values for a hole are sought, in turn."""

LEAST_WEIGHT = 1.0
"""What a window must hold: as much as one trusted pixel of the same colour."""


def refined(disparity: Tensor, guide: Tensor, confidence: Tensor) -> Tensor:
    """A map (H, W) after the weighted median by colour and confidence, its holes filled.

    Values at confident pixels come from the weighted median alone. A hole that finds no trusted
    value of its colour keeps that median, too.

    Args:
        disparity: (H, W) float32.
        guide: (H, W, C) in 0..1, the centre view.
        confidence: (H, W) in 0..1, of `disparity`.

    Example:
        >>> values = torch.tensor([[1.0, 1.0, 5.0, 1.0, 1.0]])
        >>> trust = torch.tensor([[0.9, 0.9, 0.1, 0.9, 0.9]])
        >>> refined(values, torch.ones(1, 5, 3), trust)
        tensor([[1., 1., 1., 1., 1.]])
    """
    smooth = weighted_median(disparity, guide, confidence).values
    trust = torch.where(confidence < HOLE_CONFIDENCE, 0.0, confidence)
    holes = (trust == 0).flatten().nonzero()[:, 0]
    filled = smooth.flatten()
    for spacing in SPACINGS_PX:
        found = weighted_median(disparity, guide, trust, pixels=holes, spacing_px=spacing)
        enough = found.weights >= LEAST_WEIGHT
        filled[holes[enough]] = found.values[enough]
        holes = holes[~enough]
    return filled.view_as(disparity)
