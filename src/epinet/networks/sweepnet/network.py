"""SweepNet: a plane sweep along the eight arms of the star, then refinements by what is left over.

EPINET must discover from stacks of views what matching is. SweepNet is shown the views already
moved by hypothesised disparities, and a few small convolutions decide. docs/sweepnet.md draws it.

    sweep    at half resolution, for hypotheses a pixel apart: how far each arm's views, moved by
             it, are from the centre view, there and over wide squares; one network, shared by all
             hypotheses, scores each
    fill     at half resolution, far-seeing: corrects the best disparities where nothing told
             them, and says how to enlarge the map to full resolution
    refine   once at half resolution and twice at full: the views moved by the estimate, a little
             less and a little more; least squares of each arm, weighed by a network, and what it
             adds

What the views show of a disparity is taken by `epinet.networks.sweepnet.matching`. Disparities
inside the network are those of views a quarter of the way to the outermost ones apart, so one
network serves grids of any size; it gives px per adjacent view. Disparities beyond its span are
found on smaller pictures first and refined on the way up.
"""

from __future__ import annotations

import math
from typing import Self

import torch
from pydantic import model_validator
from torch import Tensor, nn
from torch.nn import functional as F

from epinet.networks.base import Batch, Network, Settings
from epinet.networks.sweepnet.estimates import Estimates
from epinet.networks.sweepnet.layers import (
    Fill,
    Refine,
    Sweep,
    SweepNetConfig,
    as_stacks,
    at_full_size,
    best_hypothesis,
    enlarged_by,
    halved,
)
from epinet.networks.sweepnet.loss import MARGIN_PX, sweepnet_loss
from epinet.networks.sweepnet.matching import OUTERMOST, PARTS, Views, enlarged

SPAN = 12.0
"""Ranges wider than this, in the network's unit, are searched on smaller pictures."""


class SweepNetSettings(Settings):
    """What a recipe says of SweepNet."""

    @model_validator(mode="after")
    def _possible_for_sweepnet(self) -> Self:
        if self.patch_px % 2:
            raise ValueError(f"patch_px: SweepNet halves its patches, {self.patch_px} is odd")
        return self


class SweepNet(Network[SweepNetSettings]):
    """The whole network.

    Example:
        >>> net = SweepNet().eval()
        >>> net(torch.zeros(1, 4, 9, 64, 48)).maps[-1].shape
        torch.Size([1, 1, 64, 48])
    """

    Config = SweepNetConfig
    Settings = SweepNetSettings
    margin_px = MARGIN_PX
    floats_per_px = 800
    """Measured; see benchmarks/memory.py."""

    def __init__(self, config: SweepNetConfig = SweepNetConfig()) -> None:  # noqa: B008 (frozen)
        super().__init__()
        self.config = config
        self.sweep = Sweep(config.sweep_width)
        self.fill = Fill(config.fill_width, config.context_width)
        self.refine = nn.ModuleList(
            Refine(refine, config.refine_width, config.context_width)
            for refine in (config.half, config.full)
        )

    def hypotheses(self, range_px: tuple[float, float], views: int) -> tuple[int, Tensor]:
        """How often the views are halved, beyond once, to sweep a range; and the disparities tried.

        Args:
            range_px: px per adjacent view.
            views: per direction.

        Returns:
            the number, and (D,) disparities in the network's unit.
        """
        low, high = (bound * (views // 2) / OUTERMOST for bound in range_px)
        levels = max(0, math.ceil(math.log2(max(high - low, 1e-6) / SPAN)))
        spacing = self.config.spacing_px * 2**levels
        count = math.ceil((high - low) / spacing + 1) + 1
        return levels, torch.linspace(low - spacing / 2, high + spacing / 2, count)

    def coarsest_px(self, range_px: tuple[float, float], views: int) -> int:
        """Costs are `gathered` at half the resolution that is swept."""
        return int(2 ** (self.hypotheses(range_px, views)[0] + 2))

    def forward(self, stacks: Tensor, range_px: tuple[float, float] = (-4.0, 4.0)) -> Estimates:
        """Disparity of the centre view.

        Args:
            stacks: (B, 4, N, H, W) gray views in 0..1 of any odd N, in the order of
                `epinet.angular.DIRECTIONS_DEG`.
            range_px: disparities to look for, px per adjacent view.
        """
        if stacks.ndim != 5 or stacks.shape[1] != 4 or stacks.shape[2] % 2 == 0:
            raise ValueError(f"expected (B, 4, odd N, H, W), got {tuple(stacks.shape)}")
        per_unit = OUTERMOST / (stacks.shape[2] // 2)
        levels, hypotheses = self.hypotheses(range_px, stacks.shape[2])
        hypotheses = hypotheses.to(stacks.device)
        height, width = stacks.shape[-2:]
        pyramid = _pyramid(stacks, levels + 1)
        half = Views(pyramid.pop())
        scores, seen = self._swept(half, hypotheses / 2 ** (levels + 1))
        swept, spread = best_hypothesis(scores, hypotheses / 2**levels)
        filled, context, shares = self.fill(swept, spread, seen)
        maps, log_error = self._refined(half, pyramid, filled, context, shares)
        maps = [per_unit * m[..., :height, :width] for m in maps]
        log_error = log_error[..., :height, :width] + math.log(per_unit)
        return Estimates(maps, log_error, scores, per_unit * hypotheses)

    def _swept(self, half: Views, hypotheses: Tensor) -> tuple[Tensor, Tensor]:
        """Scores (B, D, h, w) of disparities of the halved views, and what is SEEN of these."""
        with torch.no_grad():
            costs, distinct = half.costs(hypotheses.tolist())
        seen = torch.cat([half.centre, costs[:, :, :PARTS].amin(1), distinct], 1)
        return self.sweep(costs, seen), seen

    def _refined(
        self, half: Views, larger: list[Tensor], filled: Tensor, context: Tensor, shares: Tensor
    ) -> tuple[list[Tensor], Tensor]:
        """Maps at full size, the filled one and one more after each round; the last one's error.

        Args:
            half: the most halved views, of h x w px.
            larger: stacks that are halved less and less often; the last of the list the least.
            filled: (B, 1, h, w) map in px of views halved once less.
            context: (B, C, h, w) features of the fill.
            shares: see `enlarged_by`.
        """
        at_half, at_full = self.refine
        levels = len(larger) - 1
        maps = [at_full_size(enlarged_by(filled, shares), levels)]
        disparity = filled / 2
        for _ in range(self.config.half.rounds):
            disparity, _ = at_half(half, disparity, context)
            large = enlarged_by(2 * disparity, shares)
            maps.append(at_full_size(large, levels))
        disparity = large
        for level in reversed(range(levels + 1)):
            views = Views(larger[level])
            context = enlarged(context)
            if level < levels:
                disparity = at_full_size(disparity, 1)
            for _ in range(self.config.full.rounds):
                disparity, log_error = at_full(views, disparity, context)
                maps.append(at_full_size(disparity, level))
        return maps, log_error

    def estimate(
        self, stacks: Tensor, range_px: tuple[float, float]
    ) -> tuple[Tensor, Tensor | None]:
        made: Estimates = self(stacks, range_px)
        return made.maps[-1], made.log_error.exp()

    def loss(self, batch: Batch, settings: SweepNetSettings) -> Tensor:
        made: Estimates = self(batch.stacks, batch.range_px)
        return sweepnet_loss(
            made.scaled(1 / batch.every),
            batch.disparity / batch.every,
            batch.weight,
            settings.loss_scale_px,
        )


def _pyramid(stacks: Tensor, levels: int) -> list[Tensor]:
    """Stacks (B, 4, N, H, W), padded to be halved so often, and these halved ever more often."""
    height, width = stacks.shape[-2:]
    side = 2**levels
    pad = (0, -width % side, 0, -height % side)
    pyramid = [F.pad(stacks.flatten(1, 2), pad, mode="replicate")]
    for _ in range(levels):
        pyramid.append(halved(pyramid[-1]))
    return [as_stacks(images, stacks.shape[2]) for images in pyramid]
