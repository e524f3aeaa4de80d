"""SweepNet: a plane sweep along the eight arms of the star, then refinements by what is left over.

EPINET must discover from stacks of views what matching is. SweepNet is shown the views already
moved by hypothesised disparities, and a few small convolutions decide. docs/sweepnet.md draws it.

    sweep    at half resolution, for hypotheses half a pixel apart: how far each arm's views, moved
             by it, are from the centre view; one network, shared by all hypotheses, scores each
    fill     at half resolution, far-seeing: corrects the best disparities where nothing told
             them, and enlarges the map to full resolution
    refine   at full resolution, twice: the views moved by the estimate, a little less and a little
             more; least squares of each arm, weighed by a network, and what it adds to them

An arm is the half of a direction that lies on one side of the centre view: what hides a point
from one arm leaves the opposite one clean. Differences between views count in units of the centre
view's local contrast. Disparities inside the network are those of views a quarter of the way to
the outermost ones apart, so one network serves grids of any size; it gives px per adjacent view.
Disparities beyond its span are found on smaller pictures first and refined on the way up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from epinet.angular import DIRECTIONS_DEG, direction_positions
from epinet.model.contrast import box_mean, local_statistics

UNIT_WINDOW_PX = 9
"""The local contrast of the centre view is taken over this square."""
FLOOR = 0.003
"""Contrast well below this, near a gray level of 255, counts as noise."""
OUTERMOST = 4
"""Distance of the outermost views from the centre in the network's own unit of baseline."""
SPAN = 12.0
"""Ranges wider than this, in the network's unit, are searched on smaller pictures."""
BOXES_PX = (1, 5, 15, 45)
"""Squares over which least squares are taken; a network chooses among them."""
SMOOTHINGS_PX = (3, 9, 25)
KEPT = 7.0
"""A refinement begins by keeping its own map: by so much its log odds exceed any neighbour's."""


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


@dataclass(frozen=True)
class SweepNetConfig:
    """Shape of one SweepNet."""

    spacing_px: float = 0.5
    """Between hypotheses."""
    sweep_width: int = 32
    fill_width: int = 32
    context_width: int = 16
    """Channels that the fill passes on to the refinements."""
    refine_width: int = 32
    spreads_px: tuple[float, ...] = (0.25, 0.08)
    """One refinement for each: how much nearer and farther it looks."""
    neighbours: tuple[tuple[int, int], ...] = ((5, 2), (3, 1))
    """For each refinement (side, spacing in px) of the square whose maps a pixel chooses from."""

    def __post_init__(self) -> None:
        # JSON has lists.
        object.__setattr__(self, "spreads_px", tuple(self.spreads_px))
        object.__setattr__(self, "neighbours", tuple((n, px) for n, px in self.neighbours))

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


class Estimates(NamedTuple):
    """What the network makes of views, all per adjacent view."""

    maps: list[Tensor]
    """(B, 1, H, W) disparity after the fill and after each refinement; the last is the result."""
    log_error: Tensor
    """(B, 1, H, W) logarithm of the mean error to expect of the last map, in px."""
    scores: Tensor
    """(B, D, h, w) of the hypotheses, at the resolution of the sweep."""
    hypotheses: Tensor
    """(D,) disparities of full-size pixels."""

    def scaled(self, factor: float) -> Estimates:
        """The same disparities in another unit."""
        return Estimates(
            [factor * m for m in self.maps],
            self.log_error + math.log(factor),
            self.scores,
            factor * self.hypotheses,
        )


class _Residual(nn.Module):
    def __init__(self, width: int, dilation: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation)
        self.second = nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(_bias(self.second))

    def forward(self, x: Tensor) -> Tensor:
        added: Tensor = self.second(F.relu(self.first(F.relu(x)), inplace=True))
        return added.add_(x)


class _Sweep(nn.Module):
    """Scores of hypotheses, each from the costs of the arms' views at it and beside it."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(PARTS, 3 * width, 1)
        self.shared = nn.Conv2d(2 + PARTS, width, 3, padding=1)
        self.body = nn.ModuleList(_Residual(width, d) for d in (1, 2, 4))
        self.score = nn.Conv2d(width, 1, 3, padding=1)

    def forward(self, cost: Tensor, seen: Tensor) -> Tensor:
        """Costs (B, D, PARTS, h, w) and features of no hypothesis -> scores (B, D, h, w)."""
        b, count = cost.shape[:2]
        shared = self.shared(seen)
        own, before, after = zip(
            self.first.weight.chunk(3), _bias(self.first).chunk(3), strict=True
        )
        costs = cost.flatten(0, 1)
        x = F.conv2d(costs, *own)
        planes = x.view(b, count, *x.shape[1:])  # one after the other, for the sake of memory
        planes += shared[:, None]
        planes[:, 1:] += F.conv2d(costs, *before).view_as(planes)[:, :-1]
        planes[:, :-1] += F.conv2d(costs, *after).view_as(planes)[:, 1:]
        for block in self.body:
            x = block(_exchanged(x, count))
        scores: Tensor = self.score(F.relu(x))
        return scores.view(b, count, *cost.shape[-2:])


def _exchanged(x: Tensor, count: int) -> Tensor:
    """Hypotheses (B * count, C, h, w) that see an eighth of either neighbour's channels."""
    share = x.shape[1] // 8
    exchanged = x.clone()
    old, new = (t.view(-1, count, *t.shape[1:]) for t in (x, exchanged))
    new[:, 1:, :share], new[:, 0, :share] = old[:, :-1, :share], 0
    new[:, :-1, share : 2 * share], new[:, -1, share : 2 * share] = old[:, 1:, share : 2 * share], 0
    return exchanged


class _Fill(nn.Module):
    """Corrects the swept map with far-seeing features and enlarges it, pixel by weighed pixel."""

    DILATIONS = (1, 2, 4, 8, 16, 1)

    def __init__(self, width: int, context: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(2 + PARTS + 2 + len(SMOOTHINGS_PX), width, 3, padding=1)
        self.body = nn.Sequential(*(_Residual(width, d) for d in self.DILATIONS))
        self.out = nn.Conv2d(width, 1 + context + 4 * 9, 3, padding=1)
        nn.init.zeros_(self.out.weight[:1])

    def forward(self, swept: Tensor, spread: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
        """Map and its spread (B, 1, h, w) and features -> map (B, 1, 2h, 2w) and context."""
        b, _, h, w = swept.shape
        x = torch.cat([seen, spread, *_bumps(swept), swept * 0.1], 1)
        out = self.out(F.relu(self.body(self.first(x)))).float()
        swept = swept + out[:, :1]
        weights = out[:, -36:].view(b, 1, 9, 2, 2, h, w).softmax(2)
        around = F.unfold(F.pad(swept, (1,) * 4, mode="replicate"), 3).view(b, 1, 9, 1, 1, h, w)
        enlarged = (weights * around).sum(2).permute(0, 1, 4, 2, 5, 3).reshape(b, 1, 2 * h, 2 * w)
        return enlarged, out[:, 1:-36]


class _Refine(nn.Module):
    """Moves an estimate by least squares of the arms' residuals, as a network weighs them.

    Then each pixel chooses among its neighbours' disparities: beside an edge the estimate is often
    of the wrong surface, too far off for least squares, while a neighbour has it right.
    """

    DILATIONS = (1, 2, 4, 8, 1)

    def __init__(self, width: int, context: int, neighbours: tuple[int, int]) -> None:
        super().__init__()
        self.side, self.apart_px = neighbours
        seen = 3 * PARTS + 2 * len(ARMS) + 2 + len(SMOOTHINGS_PX) + 1 + context
        self.first = nn.Conv2d(seen, width, 1)
        self.body = nn.Sequential(*(_Residual(width, d) for d in self.DILATIONS))
        self.parts = (len(ARMS), len(BOXES_PX), 1, 1, self.side**2)
        self.out = nn.Conv2d(width, sum(self.parts), 3, padding=1)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(_bias(self.out))
        with torch.no_grad():
            _bias(self.out)[-(self.side**2 // 2 + 1)] = KEPT

    def forward(
        self, views: Views, disparity: Tensor, spread_px: float, context: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The map (B, 1, H, W) refined, and the logarithm of its expected error."""
        disparity = disparity.detach()
        residuals, slopes, matches = views.least_squares(disparity, spread_px)
        step = (slopes / (matches + 1e-4) / spread_px).clamp(-2, 2)
        told = 0.3 * torch.log(matches * spread_px**2 + 1e-5) + 2
        bumps = [bump / spread_px for bump in _bumps(disparity)]
        spread = torch.full_like(disparity, math.log(spread_px))
        x = torch.cat([residuals, step, told, views.centre, *bumps, spread, context], 1)
        out = self.out(F.relu(self.body(self.first(x)))).float()
        weights, choice, more, log_error, kept = out.split(self.parts, 1)
        weights, choice = weights.clamp(-8, 8).exp(), choice.softmax(1)
        slope, match = ((weights * t).sum(1, keepdim=True) for t in (slopes, matches))
        disparity = disparity + spread_px * more
        for k, box in enumerate(BOXES_PX):
            moved = box_mean(slope, box) / (box_mean(match, box) + 1e-4)
            disparity = disparity + choice[:, k : k + 1] * moved.clamp(
                -2 * spread_px, 2 * spread_px
            )
        chosen = (kept.softmax(1) * _neighbours(disparity, self.side, self.apart_px)).sum(
            1, keepdim=True
        )
        return chosen, log_error + math.log(spread_px)


class Views:
    """The arms' views beside the centre view, in units of its local contrast.

    Args:
        stacks: (B, 4, N, H, W) gray, 0..1, in the order of `epinet.angular.DIRECTIONS_DEG`.
    """

    def __init__(self, stacks: Tensor) -> None:
        half = stacks.shape[2] // 2
        self.offsets = [OUTERMOST * k / half for k in range(1, half + 1)]
        self.inner = [o <= OUTERMOST / 2 or half == 1 for o in self.offsets]
        self.gray = stacks[:, :1, half]  # (B, 1, H, W)
        mean, unit = local_statistics(self.gray, UNIT_WINDOW_PX, FLOOR)
        faint = -F.max_pool2d(-unit, UNIT_WINDOW_PX, 1, UNIT_WINDOW_PX // 2)
        self.unit, self.units = unit, (unit, faint)
        self.centre = torch.cat([(self.gray - mean) / unit / 2, unit.log() / 2 + 2], 1)
        self.arms = [
            (row, col, torch.stack([stacks[:, s, half + side * k] for k in range(1, half + 1)], 1))
            for s, side, row, col in ARMS
        ]

    def costs(self, disparities: Sequence[float]) -> Tensor:
        """(B, D, PARTS, H, W) mean differences to the centre view under whole planes."""
        planes = []
        for d in disparities:
            parts: list[Tensor] = []
            for row, col, views in self.arms:
                moved = [
                    _shifted(views[:, k], -d * o * row, -d * o * col)
                    for k, o in enumerate(self.offsets)
                ]
                parts += self._parts(torch.stack(moved, 1) - self.gray)
            planes.append(torch.cat(parts, 1))
        return torch.stack(planes, 1)

    def least_squares(self, disparity: Tensor, spread_px: float) -> tuple[Tensor, Tensor, Tensor]:
        """Of views moved by an estimate (B, 1, H, W).

        Returns:
            residuals (B, 3 * PARTS, H, W) at the estimate, nearer and farther; and of each arm
            (B, 8, H, W) sums of residual times slope and of slope squared, so that the step which
            its views ask for is their quotient.
        """
        residuals: list[Tensor] = []
        slopes, matches = [], []
        for row, col, views in self.arms:
            moves = [(o * row, o * col) for o in self.offsets]
            at, near, far = (
                sampled(views, disparity + by, moves) - self.gray
                for by in (0, spread_px, -spread_px)
            )
            for r in (at, near, far):
                residuals += self._parts(r)
            at, slope = at / self.unit, (near - far) / (2 * spread_px * self.unit)
            slopes.append(-(at * slope).mean(1, keepdim=True))
            matches.append((slope * slope).mean(1, keepdim=True))
        return torch.cat(residuals, 1), torch.cat(slopes, 1), torch.cat(matches, 1)

    def _parts(self, differences: Tensor) -> list[Tensor]:
        """Inner and outer mean (B, 1, H, W) of an arm's differences, in 0..1."""
        sizes = differences.abs()
        parts = []
        for inner in (True, False):
            chosen = [k for k, is_inner in enumerate(self.inner) if is_inner == inner]
            mean = sizes[:, chosen or [0]].mean(1, keepdim=True)
            parts += [mean / (mean + unit) for unit in self.units]
        return parts


class SweepNet(nn.Module):
    """The whole network.

    Example:
        >>> net = SweepNet().eval()
        >>> net(torch.zeros(1, 4, 9, 64, 48)).maps[-1].shape
        torch.Size([1, 1, 64, 48])
    """

    def __init__(self, config: SweepNetConfig = SweepNetConfig()) -> None:
        super().__init__()
        self.config = config
        self.sweep = _Sweep(config.sweep_width)
        self.fill = _Fill(config.fill_width, config.context_width)
        self.refine = nn.ModuleList(
            _Refine(config.refine_width, config.context_width, neighbours)
            for _, neighbours in zip(config.spreads_px, config.neighbours, strict=True)
        )

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
        low, high = (bound / per_unit for bound in range_px)
        levels = max(0, math.ceil(math.log2(max(high - low, 1e-6) / SPAN)))
        height, width = stacks.shape[-2:]
        side = 2 ** (levels + 1)
        pad = (0, -width % side, 0, -height % side)
        padded = F.pad(stacks.flatten(1, 2), pad, mode="replicate")
        pyramid = [_stacks(F.avg_pool2d(padded, 2**k), stacks.shape[2]) for k in range(levels + 2)]

        half = Views(pyramid[-1])
        margin = self.config.spacing_px * 2**levels / 2
        count = math.ceil((high - low + 2 * margin) / (self.config.spacing_px * 2**levels)) + 1
        hypotheses = torch.linspace(low - margin, high + margin, count, device=stacks.device)
        with torch.no_grad():
            cost = half.costs((hypotheses / side).tolist())
        seen = torch.cat([half.centre, cost.amin(1)], 1)
        scores = self.sweep(cost, seen)
        swept, spread = _best(scores, hypotheses / 2**levels)
        disparity, context = self.fill(swept, spread, seen)
        maps = [disparity]
        for level in reversed(range(levels + 1)):
            views = Views(pyramid[level])
            context = _enlarged(context)
            if level < levels:
                disparity = 2 * _enlarged(disparity)
            disparity, log_error = self.refine[0](
                views, disparity, self.config.spreads_px[0], context
            )
        maps.append(disparity)
        for refine, spread_px in zip(self.refine[1:], self.config.spreads_px[1:], strict=True):
            disparity, log_error = refine(views, disparity, spread_px, context)
            maps.append(disparity)
        maps = [per_unit * m[..., :height, :width] for m in maps]
        log_error = log_error[..., :height, :width] + math.log(per_unit)
        return Estimates(maps, log_error, scores, per_unit * hypotheses)


def _stacks(images: Tensor, views: int) -> Tensor:
    """Images (B, 4 * N, H, W) as stacks (B, 4, N, H, W)."""
    return images.view(len(images), -1, views, *images.shape[-2:])


def _best(scores: Tensor, hypotheses: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and deviation of the disparity (B, 1, h, w) around the best hypothesis."""
    probability = scores.float().softmax(1)
    index = torch.arange(len(hypotheses), device=scores.device).view(1, -1, 1, 1)
    near = (index - probability.argmax(1, keepdim=True)).abs() <= 2
    local = probability * near
    certain = local.sum(1, keepdim=True)
    local = local / certain
    values = hypotheses.view(1, -1, 1, 1)
    mean = (local * values).sum(1, keepdim=True)
    return mean, 1 - certain


def _bumps(disparity: Tensor) -> list[Tensor]:
    """What smoothing changes."""
    return [box_mean(disparity, side) - disparity for side in SMOOTHINGS_PX]


def _neighbours(images: Tensor, side: int, apart_px: int) -> Tensor:
    """(B, side^2, H, W) of images (B, 1, H, W): at each place of a square; the border repeats."""
    reach, (height, width) = side // 2 * apart_px, images.shape[-2:]
    padded = F.pad(images, (reach,) * 4, mode="replicate")
    steps = range(0, 2 * reach + 1, apart_px)
    moved = [padded[..., y : y + height, x : x + width] for y in steps for x in steps]
    return torch.cat(moved, 1)


def _enlarged(images: Tensor) -> Tensor:
    return F.interpolate(images, scale_factor=2, mode="bilinear", align_corners=False)


def _shifted(images: Tensor, rows: float, cols: float) -> Tensor:
    """images (B, H, W) at (y + rows, x + cols), bilinear; the border repeats."""
    for axis, by in ((-2, rows), (-1, cols)):
        if by == 0:
            continue
        whole, size = math.floor(by), images.shape[axis]
        index = torch.arange(whole, whole + size + 1, device=images.device).clamp_(0, size - 1)
        source = images.index_select(axis, index)
        images = torch.lerp(source.narrow(axis, 0, size), source.narrow(axis, 1, size), by - whole)
    return images


def sampled(
    views: Tensor, disparity: Tensor, moves: Sequence[tuple[float, float]], top: int = 0
) -> Tensor:
    """Views (B, P, H, W) where they show the centre view's points, bilinear; the border repeats.

    Args:
        disparity: (B, 1, R, W) of the centre view's rows from `top` on, px per unit of `moves`.
        moves: (rows, columns) of the views from the centre view. A view at (r, c) shows the point
            of (x, y) at (x - c d, y - r d).

    Returns:
        (B, P, R, W).
    """
    b, p, h, w = views.shape
    rows_seen = disparity.shape[-2]
    y = torch.arange(top, top + rows_seen, device=views.device, dtype=views.dtype).view(1, 1, -1, 1)
    x = torch.arange(w, device=views.device, dtype=views.dtype).view(1, 1, 1, w)
    rows, cols = torch.tensor(moves, dtype=views.dtype, device=views.device).T.view(2, 1, p, 1, 1)
    grid = torch.stack(
        [(2 * (x - cols * disparity) + 1) / w - 1, (2 * (y - rows * disparity) + 1) / h - 1], -1
    )
    seen = F.grid_sample(
        views.reshape(b * p, 1, h, w),
        grid.view(b * p, rows_seen, w, 2),
        padding_mode="border",
        align_corners=False,
    )
    return seen.view(b, p, rows_seen, w)


def _bias(layer: nn.Conv2d) -> Tensor:
    assert layer.bias is not None
    return layer.bias
