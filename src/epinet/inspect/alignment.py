"""How far the views are out of place, and how differently they are exposed.

A view at offset p = (row, col) from the centre shows the centre's pixel x, of disparity d, at
x - d p + s, where s is the view's misalignment, and brighter by a gain and an offset. s, d and the
exposure are fitted together (Gauss-Newton on differences of intensity, as Lucas and Kanade's
registration, "An iterative image registration technique", IJCAI 1981), from the disparities of a
plane sweep on. With the gradient g of the centre view, the change of a pixel's difference r_v is

    r_v + g . ds_v - (g . p_v) dd.

dd of each pixel is eliminated from the normal equations, so that an error of the disparities does
not pass for misalignment. What remains cannot tell s_v = k p_v from d = -k everywhere, which is
another focus plane: that part of s is left out. Everything is relative to the centre view.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from epinet.inspect.sweep import Match, Offset, Star, fine_match, load_star, working_image
from epinet.lightfield import LightField
from epinet.squares import box_mean

LONGER_SIDE_PX = 384
"""Longer side of the images on which views are registered."""
STEPS = 4
"""Of Gauss and Newton."""
DISPARITY_WINDOW_PX = 5
"""Pixels that share a correction of their disparity."""
EXPOSURE_BLOCK_PX = 8
"""Exposures are compared in means over blocks, which interpolation hardly blurs."""
MIN_SHARE = 0.25
"""Of the pixels of a block that must be usable."""
MIN_BLOCKS = 16
"""Fewer of them tell nothing of exposure."""
WHITE = 0.97
"""Brighter pixels may be overexposed."""
EXPOSURE_STEPS = 8
"""Of the weighted least squares."""
MIN_GRADIENT = 0.004
"""Pixels of less contrast, in intensity per pixel, tell nothing of a shift."""
OUTLIER = 2.0
"""Pixels whose difference exceeds this times the median are occluded or mirrors."""
MIN_PIXELS = 500
"""Fewer usable working pixels than this tell nothing."""
MISALIGNED_PX = 0.03
"""Less (rms) is not told from none: up to 0.016 px are measured where there is none."""
UNEVEN = 0.004
"""Less (rms, of samples in 0..1) is not told from none: 0.002 are measured where there is none."""
UNDETERMINED = 1e-3
"""Combinations of shifts with eigenvalues below this share of the largest are left alone."""


@dataclass(frozen=True)
class Alignment:
    """Where the views of the star are, and how they are exposed, beside the centre view."""

    offsets: tuple[Offset, ...]
    """(rows, columns) of each view from the centre."""
    shifts_px: NDArray[np.float32]
    """(N, 2) rows and columns by which each view's picture is moved from its place."""
    gains: NDArray[np.float32]
    """(N, C): the centre shows gain * view + brighter, of samples in 0..1."""
    brighter: NDArray[np.float32]
    """(N, C), see `gains`."""

    @property
    def misalignment_px(self) -> float:
        """Root mean square length of the shifts."""
        return float(np.sqrt((self.shifts_px**2).sum(1).mean()))

    @property
    def unevenness(self) -> float:
        """Root mean square difference that exposure makes to middle gray, in 0..1."""
        return float(np.sqrt(((0.5 * (self.gains - 1) + self.brighter) ** 2).mean()))

    @property
    def is_misaligned(self) -> bool:
        """Whether the misalignment is more than the error of its estimate."""
        return self.misalignment_px >= MISALIGNED_PX

    @property
    def is_uneven(self) -> bool:
        """Whether the differences of exposure are more than the error of their estimate."""
        return self.unevenness >= UNEVEN

    def as_dict(self) -> dict[str, Any]:
        """Plain values, fit for JSON."""
        return {
            "misalignment_px": round(self.misalignment_px, 4),
            "largest_shift_px": round(float(np.hypot(*self.shifts_px.T).max()), 4),
            "unevenness": round(self.unevenness, 5),
            "gains": [round(float(bound(self.gains)), 4) for bound in (np.min, np.max)],
            "is_misaligned": self.is_misaligned,
            "is_uneven": self.is_uneven,
        }

    def __str__(self) -> str:
        """What is more than the error of its estimate, in words."""
        parts = []
        if self.is_misaligned:
            largest = np.hypot(*self.shifts_px.T).max()
            parts.append(
                f"views {self.misalignment_px:.2f} px out of place (rms; at most {largest:.2f})"
            )
        if self.is_uneven:
            parts.append(f"exposures that differ by {100 * self.unevenness:.1f} % of white (rms)")
        return ", ".join(parts) or "views in their places and exposed alike"


def estimate_alignment(lf: LightField) -> Alignment | None:
    """Measure misalignment and exposure of the star's views. None where there is no texture.

    Raises:
        InputError: the grid is smaller than 3x3, or the star of views is missing.
    """
    coarse = load_star(lf)
    match = fine_match(coarse)
    if match is None:
        return None
    fit = _Fit(load_star(lf, LONGER_SIDE_PX), match, coarse.scale)
    for _ in range(STEPS):
        if not fit.step():
            return None
    gains, brighter = fit.exposures(lf)
    return Alignment(
        fit.star.offsets,
        shifts_px=(fit.shifts / fit.star.scale).numpy(),
        gains=gains.numpy(),
        brighter=brighter.numpy(),
    )


class _Fit:
    """Registration of a star's views with its centre; shifts and disparities improve in steps."""

    def __init__(self, star: Star, match: Match, match_scale: float) -> None:
        size = star.centre.shape

        def enlarged(image: Tensor, mode: str) -> Tensor:
            return functional.interpolate(image[None, None], size, mode=mode)[0, 0]

        self.star = star
        self.places = torch.tensor(star.offsets, dtype=torch.float32)
        self.shifts = torch.zeros_like(self.places)
        self.disparity = star.scale / match_scale * enlarged(match.disparity, "bilinear")
        explained = match.usable & (match.cost <= OUTLIER * match.typical_cost)
        self.gradient = torch.stack(torch.gradient(star.centre))
        self.slopes = torch.einsum("nk,kyx->nyx", self.places, self.gradient)
        textured = self.gradient.square().sum(0) > MIN_GRADIENT**2
        self.usable = textured & (enlarged(explained.float(), "nearest") > 0)
        self.explained = self.usable

    def step(self) -> bool:
        """Improve shifts and disparities once; False if too few pixels tell."""
        moved, used = self._moved(self.star.views), self._inside()
        if int(used.sum()) < MIN_PIXELS:
            return False
        gains, brighter = _exposures(moved, self.star.centre, used)
        difference = gains * moved + brighter - self.star.centre
        size = difference.square().mean(0).sqrt()
        used &= size <= OUTLIER * size[used].median()
        self.explained = used
        step = _shift_step(difference[:, used], self.gradient[:, used], self.places)
        self.shifts += step
        share = (self.shifts * self.places).sum() / self.places.square().sum()
        self.shifts -= share * self.places  # another focus plane
        difference += torch.einsum("nk,kyx->nyx", step, self.gradient)
        self._improve_disparity(difference * used, self.slopes * used)
        return True

    def exposures(self, lf: LightField) -> tuple[Tensor, Tensor]:
        """(N, C) gains and additions of the channels."""
        row, col = lf.centre

        def pictures(offset: Offset) -> Tensor:
            view = lf.unit(row + offset[0], col + offset[1])
            return torch.stack([working_image(c, self.star.scale) for c in np.moveaxis(view, 2, 0)])

        centre = pictures((0, 0))
        views = torch.stack([pictures(offset) for offset in self.star.offsets], 1)
        fits = []
        for channel, target in zip(views, centre, strict=True):
            moved = self._moved(channel)
            exposed = (torch.maximum(moved.amax(0), target) < WHITE) & self.explained
            fits.append(_exposures(moved, target, exposed))
        gains, brighter = (torch.cat(part, 2)[:, 0] for part in zip(*fits, strict=True))
        return gains, brighter

    def _positions(self) -> tuple[Tensor, Tensor]:
        """(N, H, W) rows and columns at which the views show the centre's pixels."""
        height, width = self.disparity.shape
        (row, col), (down, right) = self.places.T[..., None, None], self.shifts.T[..., None, None]
        y = torch.arange(height)[:, None] - self.disparity * row + down
        x = torch.arange(width) - self.disparity * col + right
        return y, x

    def _moved(self, views: Tensor) -> Tensor:
        """Views (N, H, W) as the centre view would show them."""
        height, width = self.disparity.shape
        y, x = self._positions()
        grid = torch.stack([2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1], -1)
        moved = functional.grid_sample(
            views[:, None], grid, padding_mode="border", align_corners=True
        )
        return moved[:, 0]

    def _inside(self) -> Tensor:
        """(H, W) usable pixels that all views show."""
        height, width = self.disparity.shape
        y, x = self._positions()
        shown = (y >= 1) & (y <= height - 2) & (x >= 1) & (x <= width - 2)
        return self.usable & shown.all(0)

    def _improve_disparity(self, difference: Tensor, slopes: Tensor) -> None:
        asked = box_mean((difference * slopes).sum(0, keepdim=True), DISPARITY_WINDOW_PX)
        matched = box_mean(slopes.square().sum(0, keepdim=True), DISPARITY_WINDOW_PX)
        limit = 0.5 / self.star.radius
        self.disparity += (asked / matched.clamp_min(1e-6))[0].clamp(-limit, limit)


def _shift_step(difference: Tensor, gradient: Tensor, places: Tensor) -> Tensor:
    """(N, 2) least squares shifts of N views, each pixel's disparity being free.

    Args:
        difference: (N, P) of view and centre.
        gradient: (2, P) of the centre.
        places: (N, 2) of the views from the centre.
    """
    slopes = places @ gradient
    squares = slopes.square().sum(0).clamp_min(1e-12)
    left = difference - slopes * ((slopes * difference).sum(0) / squares)
    count = len(places)
    each = torch.einsum("ip,jp->ij", gradient, gradient)
    tied = torch.einsum("ip,jp,kp,lp->ijkl", gradient, gradient, gradient, gradient / squares)
    normal = -torch.einsum("vk,wl,ijkl->viwj", places, places, tied)
    normal += torch.einsum("vw,ij->viwj", torch.eye(count), each)
    inverse = torch.linalg.pinv(
        normal.reshape(2 * count, 2 * count).double(), rtol=UNDETERMINED, hermitian=True
    )
    step: Tensor = -inverse.float() @ (left @ gradient.T).flatten()
    return step.view(count, 2)


def _exposures(moved: Tensor, centre: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
    """(N, 1, 1) gains and additions that make views (N, H, W) as bright as the centre.

    A line through the means of blocks, by least squares with Cauchy's weights, since highlights
    and occlusions differ between views in earnest.
    """
    share = functional.avg_pool2d(used[None].float(), EXPOSURE_BLOCK_PX)
    images = torch.cat([centre[None], moved]) * used
    blocks = (functional.avg_pool2d(images, EXPOSURE_BLOCK_PX) / share)[:, share[0] > MIN_SHARE]
    target, seen = blocks[0], blocks[1:]
    if len(target) < MIN_BLOCKS:
        return torch.ones(len(moved), 1, 1), torch.zeros(len(moved), 1, 1)
    ratio = (target / seen.clamp_min(1e-3)).median(1, keepdim=True).values
    left = target - ratio * seen
    for _ in range(EXPOSURE_STEPS):
        typical = left.abs().median(1, keepdim=True).values.clamp_min(1e-5)
        weight = 1 / (1 + (left / typical) ** 2)
        weight = weight / weight.sum(1, keepdim=True)
        mean, goal = ((weight * b).sum(1, keepdim=True) for b in (seen, target))
        varied = (weight * (seen - mean) ** 2).sum(1, keepdim=True).clamp_min(1e-9)
        gains = (weight * (seen - mean) * (target - goal)).sum(1, keepdim=True) / varied
        left = target - goal - gains * (seen - mean)
    return gains[..., None], (goal - gains * mean)[..., None]
