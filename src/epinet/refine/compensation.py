"""Views put in their place and exposed alike, as measured (`epinet.inspect.alignment`)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from epinet.inspect.alignment import Alignment
from epinet.lightfield import LightField

LOBES = 3
"""Of the Lanczos kernel that moves views by parts of a pixel."""


def compensated(lf: LightField, alignment: Alignment) -> LightField:
    """The light field without the misalignment and the differences of exposure that matter.

    The centre view and views outside the star stay as they are. Samples keep their type.

    Args:
        alignment: of this light field; see its `is_misaligned` and `is_uneven`.
    """
    if not (alignment.is_misaligned or alignment.is_uneven):
        return lf
    views = lf.views.copy()
    row, col = lf.centre
    for k, (down, right) in enumerate(alignment.offsets):
        place = row + down, col + right
        view = lf.unit(*place)
        if alignment.is_misaligned:
            view = moved(view, *alignment.shifts_px[k].tolist())
        if alignment.is_uneven:
            view = alignment.gains[k] * view + alignment.brighter[k]
        views[place] = _samples(view.clip(0, 1), views.dtype)
    return replace(lf, views=views, notes=(*lf.notes, f"compensated: {alignment}"))


def moved(view: NDArray[np.float32], rows: float, cols: float) -> NDArray[np.float32]:
    """view (H, W, C) at (y + rows, x + cols), by Lanczos's kernel; the border repeats."""
    reach = LOBES + math.ceil(max(abs(rows), abs(cols)))
    image = torch.from_numpy(np.ascontiguousarray(np.moveaxis(view, 2, 0)))[:, None]
    image = F.pad(image, (reach,) * 4, mode="replicate")
    image = F.conv2d(image, _lanczos(rows, reach).view(1, 1, -1, 1))
    image = F.conv2d(image, _lanczos(cols, reach).view(1, 1, 1, -1))
    return np.moveaxis(image[:, 0].numpy(), 0, 2)


def _lanczos(shift: float, reach: int) -> Tensor:
    """(2 * reach + 1,) weights of the pixels around."""
    x = torch.arange(-reach, reach + 1) - shift
    kernel = torch.sinc(x) * torch.sinc(x / LOBES) * (x.abs() < LOBES)
    return kernel / kernel.sum()


def _samples(view: NDArray[np.float32], dtype: np.dtype[Any]) -> NDArray[Any]:
    """A view of 0..1 in the light field's type of samples."""
    if dtype == np.float32:
        return view
    samples: NDArray[Any] = np.round(np.iinfo(dtype).max * view).astype(dtype)
    return samples
