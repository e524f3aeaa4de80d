"""How well views match under disparities: the part of SweepNet that has no weights.

An arm is the half of a direction that lies on one side of the centre view: what hides a point
from one arm leaves the opposite one clean. Differences between views count in units of the centre
view's local contrast. Disparities here are those of views a quarter of the way to the outermost
ones apart, so that grids of any size look alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.angular import DIRECTIONS_DEG, direction_positions
from epinet.networks.contrast import local_statistics
from epinet.shifts import Margined, gradients_of, sampled
from epinet.squares import box_mean, extremes

UNIT_WINDOW_PX = 9
"""The local contrast of the centre view is taken over this square."""
FLOOR = 0.003
"""Contrast well below this, near a gray level of 255, counts as noise."""
FINE_PX = 7
"""Differences less their mean over this square do not see a shine that moves with the view."""
OUTERMOST = 4
"""Distance of the outermost views from the centre in the network's own unit of baseline."""
GATHERED = 2
"""Costs of a hypothesis gathered over squares of two sizes."""


def _arms() -> list[tuple[int, int, int, int]]:
    """(stream, side, rows, columns) of each arm: the step from one of its views to the next."""
    arms = []
    for stream, direction in enumerate(DIRECTIONS_DEG):
        (row0, col0), (row1, col1) = direction_positions(direction, 3)[1:]
        for side in (-1, 1):
            arms.append((stream, side, side * (row1 - row0), side * (col1 - col0)))
    return arms


ARMS = _arms()
PARTS = 4 * len(ARMS)
"""Each arm's inner and outer views are told apart, since the inner ones see around more edges; and
differences count in two units: the contrast around a pixel, and the least of those of the squares
that hold it, or faint texture beside a strong edge would go unseen."""


class Squares(NamedTuple):
    """Least squares of each arm's differences to the centre view, pixel by pixel; the step that its
    views ask for is slopes / matches, each over a window."""

    slopes: Tensor
    """(B, 8, H, W) differences times slope."""
    matches: Tensor
    """(B, 8, H, W) slope times slope."""


class Views:
    """The arms' views beside the centre view, in units of its local contrast.

    Args:
        stacks: (B, 4, N, H, W) gray, 0..1, in the order of `epinet.angular.DIRECTIONS_DEG`.
    """

    def __init__(self, stacks: Tensor) -> None:
        half = stacks.shape[2] // 2
        self.offsets = [OUTERMOST * k / half for k in range(1, half + 1)]
        self.inner = max(1, half // 2)  # of each arm, in the order of its views
        self.gray = stacks[:, :1, half]  # (B, 1, H, W)
        mean, unit = local_statistics(self.gray, UNIT_WINDOW_PX, FLOOR)
        _, faint = extremes(unit, UNIT_WINDOW_PX)
        self.unit, self.units = unit, (unit, faint)
        self.centre = torch.cat([(self.gray - mean) / unit / 2, unit.log() / 2 + 2], 1)
        self.arms = [
            (row, col, torch.stack([stacks[:, s, half + side * k] for k in range(1, half + 1)], 1))
            for s, side, row, col in ARMS
        ]

    @cached_property
    def doubled_arms(self) -> list[Tensor]:
        """(B, P, 2H, 2W) views of each arm: between those pixels linear interpolation loses little
        of fine texture, where between the views' own it loses so much that views differ even at
        the truth."""
        return [doubled(views) for _, _, views in self.arms]

    def costs(self, disparities: Sequence[float]) -> tuple[Tensor, Tensor]:
        """Mean differences to the centre view under whole planes.

        Returns:
            (B, D, PARTS + GATHERED, H, W) those of each arm, and what is `gathered` of their mean;
            and (B, GATHERED, H, W) how distinct that is.
        """
        shape = (len(self.gray), len(disparities), PARTS + GATHERED, *self.gray.shape[2:])
        planes = self.gray.new_empty(shape)
        own = planes[:, :, :PARTS]
        reach_px = max(map(abs, disparities))
        for (row, col, views), of_arm in zip(self.arms, own.chunk(len(ARMS), 2), strict=True):
            margined = [
                Margined(view, o * reach_px)
                for o, view in zip(self.offsets, views.unbind(1), strict=True)
            ]
            for d, into in zip(disparities, of_arm.unbind(1), strict=True):
                moved = [
                    view.shifted(-d * o * row, -d * o * col)
                    for o, view in zip(self.offsets, margined, strict=True)
                ]
                self._measure(torch.stack(moved, 1) - self.gray, into)
        planes[:, :, PARTS:], distinct = gathered(own.mean(2))
        return planes, distinct

    def least_squares(
        self, disparity: Tensor, spread_px: float
    ) -> tuple[Tensor, Squares, Squares, Squares]:
        """Of views moved by an estimate (B, 1, H, W).

        An arm's own slope, squared, holds its noise squared, too, so that where texture is faint
        its step is too short. The slope of the mean of all views has little noise, and none in
        common with the arm's.

        A glossy surface is brighter from one view than from the next, as smoothly as its shading
        changes from one pixel to the next, and the two together look like another disparity. Fine
        texture tells: what is left of differences and slopes less their means over FINE_PX.

        Args:
            disparity: the estimate; no gradient flows back to it.
            spread_px: how much nearer and farther the views are moved, too.

        Returns:
            residuals (B, 3 * PARTS, H, W), arm by arm, at the estimate, nearer and farther; and
            least squares with the arms' own slopes, with those of the mean of all views, and with
            those of fine texture.
        """
        estimates = [disparity, disparity + spread_px, disparity - spread_px]
        residuals = self.gray.new_empty(len(self.gray), 3 * PARTS, *self.gray.shape[2:])
        share = self.gray.new_tensor(self.offsets)
        share = (share / share.square().sum()).view(1, -1, 1, 1)
        mean = self.gray.clone()
        slopes, matches, lines = [], [], []
        for (row, col, _), views, of_arm in zip(
            self.arms, self.doubled_arms, residuals.chunk(len(ARMS), 1), strict=True
        ):
            moves = [(o * row, o * col) for o in self.offsets]
            at, near, far = (sampled(views, d, moves).sub_(self.gray) for d in estimates)
            for differences, into in zip((at, near, far), of_arm.chunk(3, 1), strict=True):
                self._measure(differences, into)
            fall = far.sub_(near).div_(2 * spread_px)
            slopes.append(summed(at, fall).div_(len(moves)))
            matches.append(summed(fall, fall).div_(len(moves)))
            # What changes from view to view, as one straight line through the arm's views.
            lines += [summed(t, share) for t in (at, fall)]
            mean += at.sum(1, keepdim=True) / (1 + len(ARMS) * len(self.offsets))
        unit = self.unit.square()
        own = Squares(torch.cat(slopes, 1).div_(unit), torch.cat(matches, 1).div_(unit))
        unit = unit * float(share.numel() * share.square().sum())  # as means over the views, too
        at, fall = torch.cat(lines[::2], 1), torch.cat(lines[1::2], 1)
        gradients = gradients_of(mean)
        wide = self._squares(at, fall, gradients / unit)
        at, fall, gradients = (t - box_mean(t, FINE_PX) for t in (at, fall, gradients))
        return residuals, own, wide, self._squares(at, fall, gradients / unit)

    def _squares(self, at: Tensor, fall: Tensor, gradients: Tensor) -> Squares:
        """With the slopes of an image of such gradients that moves along each arm."""
        down, right = gradients.chunk(2, 1)
        seen = torch.cat([row * down + col * right for row, col, _ in self.arms], 1)
        return Squares(at * seen, fall * seen)

    def _measure(self, differences: Tensor, into: Tensor) -> None:
        """Inner and outer mean of an arm's differences (B, P, H, W), in 0..1, in each unit.

        They are written to (B, 4, H, W): gathering them later would copy the largest tensor of all.
        """
        sizes = differences.abs()
        outer = min(self.inner, sizes.shape[1] - 1)
        for seen, written in zip(
            (sizes[:, : self.inner], sizes[:, outer:]), into.chunk(2, 1), strict=True
        ):
            mean = seen.mean(1, keepdim=True)
            for unit, place in zip(self.units, written.chunk(2, 1), strict=True):
                torch.div(mean, torch.add(mean, unit, out=place), out=place)


def gathered(cost: Tensor) -> tuple[Tensor, Tensor]:
    """Costs over squares of 12 and 36 px (of twice the resolution).

    Args:
        cost: (B, D, h, w) of hypotheses, at half resolution.

    Returns:
        (B, D, GATHERED, h, w) deviations from the mean of all hypotheses, in units of what is
        usual there; and (B, 2, h, w) a logarithm of that unit, for each size.
    """
    height, width = cost.shape[-2:]
    small = F.avg_pool2d(cost, 2, ceil_mode=True, count_include_pad=False)
    relative, distinct = [], []
    for side in (3, 9):
        means = box_mean(small, side)
        mean, unit = means.mean(1, keepdim=True), means.std(1, keepdim=True)
        relative.append((means - mean) / (unit + 0.002))
        distinct.append(0.3 * torch.log(unit + 1e-4) + 2)
    b, count = cost.shape[:2]
    both = torch.cat([torch.stack(relative, 2).flatten(1, 2), *distinct], 1)
    both = enlarged(both)[..., :height, :width]
    return both[:, :-2].view(b, count, GATHERED, height, width), both[:, -2:]


def summed(images: Tensor | Sequence[Tensor], weights: Tensor) -> Tensor:
    """(B, 1, H, W) sum of images (B, C, H, W), or C of (B, 1, H, W), times weights.

    Image by image, which caches hold, it takes half the time of all products and their sum.
    """
    each = torch.split(images, 1, 1) if isinstance(images, Tensor) else images
    total = each[0] * weights[:, :1]
    for k in range(1, len(each)):
        total.addcmul_(each[k], weights[:, k : k + 1])
    return total


def enlarged(images: Tensor) -> Tensor:
    """Images (B, C, H, W) as (B, C, 2H, 2W), bilinear."""
    return F.interpolate(images, scale_factor=2, mode="bilinear", align_corners=False)


def doubled(images: Tensor) -> Tensor:
    """Images (B, P, H, W) with points half-way between their pixels, (B, P, 2H, 2W), bicubic.

    Pixel (y, x) becomes (2y, 2x); the border repeats. The cubic is torch's, that of a = -3/4.
    """
    b, p, h, w = images.shape
    fine = images.new_empty(b, p, h, 2, 2 * w)
    # One by one, which caches hold.
    for image, into in zip(torch.split(images, 1, 1), torch.split(fine, 1, 1), strict=True):
        rows = into[:, :, :, 0]
        rows[..., ::2] = image
        rows[..., 1::2] = _halfway(F.pad(image, (1, 2, 0, 0), mode="replicate"), -1)
        into[:, :, :, 1] = _halfway(F.pad(rows, (0, 0, 1, 2), mode="replicate"), -2)
    return fine.view(b, p, 2 * h, 2 * w)


def _halfway(padded: Tensor, axis: int) -> Tensor:
    first, second, third, fourth = (
        padded.narrow(axis, k, padded.shape[axis] - 3) for k in range(4)
    )
    return (second + third).mul_(19 / 32).sub_(first + fourth, alpha=3 / 32)
