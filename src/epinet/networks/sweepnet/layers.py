"""Parts of SweepNet: its shape, the plane sweep, the fill and the refinements."""

from __future__ import annotations

import math
from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
from torch import Tensor, nn
from torch.nn import functional as F

from epinet.networks.channels_last import channels_first, pointwise, to_one
from epinet.networks.sweepnet.matching import (
    ARMS,
    GATHERED,
    PARTS,
    Squares,
    Views,
    enlarged,
    summed,
)
from epinet.squares import box_mean

BOXES_PX = (1, 5, 15, 45)
"""Squares over which least squares are taken; a network chooses among them."""
WIDE_PX = 15
"""From this side on, squares weigh fine texture against what is smooth."""
SMOOTHINGS_PX = (3, 9, 25)
KEPT = 7.0
"""A refinement begins by keeping its own map: by so much its log odds exceed any neighbour's."""
SMOOTH = -1.5
"""It begins by trusting what is smooth less than fine texture: by these log odds."""
SEEN = 2 + PARTS + 2
"""Features of the centre view, least costs, and how distinct the gathered ones are."""


_Width = Annotated[int, Field(ge=1, le=1024)]
"""Channels. Bounds are far beyond what was ever trained; weights from elsewhere must not ask for
all time and memory."""


@dataclass(frozen=True, config={"extra": "forbid"})
class RefineConfig:
    """Shape of one refinement; lengths in pixels of its resolution."""

    spread_px: Annotated[float, Field(gt=0, le=8)]
    """How much nearer and farther it looks."""
    side: Annotated[int, Field(ge=1, le=15)]
    apart_px: Annotated[int, Field(ge=1, le=64)]
    """A pixel chooses from the maps at `side` x `side` places, so far apart."""
    dilations: Annotated[tuple[Annotated[int, Field(ge=1, le=64)], ...], Field(max_length=32)]
    """Of its residual blocks."""
    rounds: Annotated[int, Field(ge=1, le=16)]
    """How often it is applied, each time to its own result."""

    def __post_init__(self) -> None:
        if self.side % 2 == 0:
            raise ValueError(f"side {self.side}: must be odd")


@dataclass(frozen=True, config={"extra": "forbid"})
class SweepNetConfig:
    """Shape of one SweepNet. What is out of bounds raises a ValueError (of pydantic)."""

    spacing_px: Annotated[float, Field(ge=0.1, le=16)] = 1.0
    """Between hypotheses."""
    sweep_width: _Width = 32
    fill_width: _Width = 32
    context_width: _Width = 16
    """Channels that the fill passes on to the refinements."""
    refine_width: _Width = 32
    half: RefineConfig = RefineConfig(0.25, 3, 2, (1, 2, 4, 8, 1), rounds=1)
    full: RefineConfig = RefineConfig(0.15, 5, 2, (1, 4, 1), rounds=2)
    """At half resolution, then at full."""


class Residual(nn.Module):
    def __init__(self, width: int, dilation: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation)
        self.second = nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(_bias(self.second))

    def forward(self, x: Tensor) -> Tensor:
        added: Tensor = self.second(F.relu(self.first(F.relu(x)), inplace=True))
        return added.add_(x)


class Sweep(nn.Module):
    """Scores of hypotheses, each from the costs of the arms' views at it and beside it."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(PARTS + GATHERED, 3 * width, 1)
        self.shared = nn.Conv2d(SEEN, width, 3, padding=1)
        self.body = nn.Sequential(*(Residual(width, d) for d in (1, 2, 4)))
        self.score = nn.Conv2d(width, 1, 3, padding=1)

    def forward(self, costs: Tensor, seen: Tensor) -> Tensor:
        """Costs (B, D, PARTS + GATHERED, h, w) and what is SEEN -> scores (B, D, h, w).

        A plane sees its own costs and those of the planes before and after it. One plane after the
        other, since the caches hold one.
        """
        # Of the planes before, at and after it, in this order; they are neighbours in memory, too.
        weights, biases = (
            torch.unflatten(t, 0, (3, -1))[[1, 0, 2]]
            for t in (self.first.weight, _bias(self.first))
        )
        shared, count = self.shared(seen), costs.shape[1]
        scores = []
        for d in range(count):
            planes, taps = slice(max(d - 1, 0), d + 2), slice(max(1 - d, 0), count + 1 - d)
            weight = weights[taps].transpose(0, 1).flatten(1, 2)
            own = costs[:, planes].flatten(1, 2)
            plane = pointwise([own], [weight], biases[taps].sum(0)).add_(shared)
            scores.append(to_one(self.score, F.relu(self.body(plane), inplace=True)))
        return torch.cat(scores, 1)


class Fill(nn.Module):
    """Corrects the swept map with far-seeing features and says how to enlarge it."""

    DILATIONS = (1, 2, 4, 8, 16, 1)

    def __init__(self, width: int, context: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(SEEN + 2 + len(SMOOTHINGS_PX), width, 3, padding=1)
        self.body = nn.Sequential(*(Residual(width, d) for d in self.DILATIONS))
        self.out = nn.Conv2d(width, 1 + context + 4 * 9, 3, padding=1)
        nn.init.zeros_(self.out.weight[:1])

    def forward(self, swept: Tensor, spread: Tensor, seen: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Map and its spread (B, 1, h, w) and features -> map, context, shares to enlarge it by."""
        x = torch.cat([seen, spread, *_bumps(swept), swept * 0.1], 1)
        out = channels_first(self.out(F.relu(self.body(self.first(x)), inplace=True)).float())
        shares = torch.unflatten(out[:, -36:], 1, (9, 2, 2)).softmax(1)
        return swept + out[:, :1], out[:, 1:-36], shares


class Refine(nn.Module):
    """Moves an estimate by least squares of the arms' residuals, as a network weighs them.

    Then each pixel chooses among its neighbours' disparities: beside an edge the estimate is often
    of the wrong surface, too far off for least squares, while a neighbour has it right. The next
    round sees how well the views match there.
    """

    def __init__(self, config: RefineConfig, width: int, context: int) -> None:
        super().__init__()
        self.config = config
        wide = sum(box >= WIDE_PX for box in BOXES_PX)
        seen = 3 * PARTS + 2 * len(ARMS) + 4 * wide + 2 + len(SMOOTHINGS_PX) + context
        self.first = nn.Conv2d(seen, width, 1)
        self.body = nn.Sequential(*(Residual(width, d) for d in config.dilations))
        self.parts = [len(ARMS), len(BOXES_PX), 1, 1, 1, config.side**2]
        self.out = nn.Conv2d(width, sum(self.parts), 3, padding=1)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(_bias(self.out))
        with torch.no_grad():
            _bias(self.out)[sum(self.parts[:2])] = SMOOTH
            _bias(self.out)[sum(self.parts[:-1]) + config.side**2 // 2] = KEPT

    def forward(self, views: Views, disparity: Tensor, context: Tensor) -> tuple[Tensor, Tensor]:
        """The map (B, 1, H, W) refined once, and the logarithm of its expected error."""
        disparity = disparity.detach()
        spread_px = self.config.spread_px
        residuals, own, wide, fine = views.least_squares(disparity, spread_px)
        of_all = [Squares(*(t.sum(1, keepdim=True) for t in squares)) for squares in (wide, fine)]
        asked, steps = [own], []
        for box in BOXES_PX:
            if box >= WIDE_PX:
                asked += [Squares(*(box_mean(t, box) for t in squares)) for squares in of_all]
        for slopes, matches in asked:
            sure = matches.clamp_min(0)
            steps.append((slopes / (sure + 1e-4)).div_(spread_px).clamp_(-2, 2))
            steps.append(sure.mul_(spread_px**2).add_(1e-5).log_().mul_(0.3).add_(2))
        bumps = [bump / spread_px for bump in _bumps(disparity)]
        seen = [residuals, torch.cat([*steps, views.centre, *bumps, context], 1)]
        of_each = torch.split(self.first.weight, [part.shape[1] for part in seen], 1)
        x = pointwise(seen, of_each, _bias(self.first))
        del seen, residuals  # they are large
        out = channels_first(self.out(F.relu(self.body(x), inplace=True)).float())
        weights, choice, smooth, more, log_error, kept = torch.split(out, self.parts, 1)
        weights, choice, smooth = weights.clamp(-8, 8).exp(), choice.softmax(1), smooth.sigmoid()
        own, wide, fine = (
            Squares(*(summed(t, weights) for t in squares)) for squares in (own, wide, fine)
        )
        disparity = disparity + spread_px * more
        for k, box in enumerate(BOXES_PX):
            if box < WIDE_PX:
                slope, match = (box_mean(t, box) for t in own)
            else:
                slope, match = (box_mean(t, box) for t in fine)
                slope_of_all, match_of_all = (box_mean(t, box) for t in wide)
                slope = slope + smooth * (slope_of_all - slope)
                match = match.clamp_min(0) + smooth * (match_of_all - match).clamp_min(0)
            moved = (slope / (match + 1e-4)).clamp(-2 * spread_px, 2 * spread_px)
            disparity = disparity + choice[:, k : k + 1] * moved
        around = _neighbours(disparity, self.config.side, self.config.apart_px)
        disparity = summed(around, kept.softmax(1))
        return disparity, log_error + math.log(spread_px)


def halved(images: Tensor) -> Tensor:
    """Means of 2x2 px of images with even sides: torch's pooling takes several times as long."""
    rows = images[..., ::2, :] + images[..., 1::2, :]
    return (rows[..., ::2] + rows[..., 1::2]).div_(4)


def as_stacks(images: Tensor, views: int) -> Tensor:
    """Images (B, 4 * N, H, W) as stacks (B, 4, N, H, W)."""
    return images.view(len(images), -1, views, *images.shape[-2:])


def best_hypothesis(scores: Tensor, hypotheses: Tensor) -> tuple[Tensor, Tensor]:
    """Mean disparity (B, 1, h, w) around the best hypothesis, and the probability of others."""
    probability = scores.float().softmax(1)
    index = torch.arange(len(hypotheses), device=scores.device).view(1, -1, 1, 1)
    best = probability.max(1, keepdim=True).indices  # argmax takes six times as long
    near = (index - best).abs() <= 1
    local = probability * near
    certain = local.sum(1, keepdim=True)
    local = local / certain
    values = hypotheses.view(1, -1, 1, 1)
    mean = (local * values).sum(1, keepdim=True)
    return mean, 1 - certain


def _bumps(disparity: Tensor) -> list[Tensor]:
    """What smoothing changes."""
    return [box_mean(disparity, side) - disparity for side in SMOOTHINGS_PX]


def _neighbours(images: Tensor, side: int, apart_px: int) -> list[Tensor]:
    """(B, 1, H, W) images at each of the side^2 places of a square; the border repeats."""
    reach, (height, width) = side // 2 * apart_px, images.shape[-2:]
    padded = F.pad(images, (reach,) * 4, mode="replicate")
    steps = range(0, 2 * reach + 1, apart_px)
    return [padded[..., y : y + height, x : x + width] for y in steps for x in steps]


def enlarged_by(disparity: Tensor, shares: Tensor) -> Tensor:
    """Map (B, 1, h, w) as (B, 1, 2h, 2w): means of the 3x3 around, by (B, 9, 2, 2, h, w) shares."""
    b, _, h, w = disparity.shape
    around = torch.cat(_neighbours(disparity, 3, 1), 1).view(b, 9, 1, 1, h, w)
    return (shares * around).sum(1).permute(0, 3, 1, 4, 2).reshape(b, 1, 2 * h, 2 * w)


def at_full_size(disparity: Tensor, level: int) -> Tensor:
    """The map of views halved so often as a map of the whole ones."""
    for _ in range(level):
        disparity = 2 * enlarged(disparity)
    return disparity


def _bias(layer: nn.Conv2d) -> Tensor:
    assert layer.bias is not None
    return layer.bias
