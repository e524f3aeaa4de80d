"""Squares cut from light fields, a whole batch of them at once, each turned in its own way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from torch import Tensor

from epinet.angular import SYMMETRIES
from epinet.lightfield import LUMA

Offset = tuple[int, int]
"""(row, column) of a view counted from the centre view."""

TURNS = torch.tensor([[s.offset((1, 0)), s.offset((0, 1))] for s in SYMMETRIES]).mT
"""(8, 2, 2): where a step down, and one to the right, of a turned image leads in the image."""


@dataclass(frozen=True)
class Frames:
    """Where B squares lie in scenes, and how they are turned; on the CPU, all of B rows.

    Pixel (i, j) of a square is the scene's at corner + (i, j) @ axes, and its view at (r, c) from
    its centre view is the scene's at middle + (r, c) @ grid.
    """

    scene: Tensor
    """(B,) number of the scene in its source."""
    side: Tensor
    """(B,) px."""
    corner: Tensor
    """(B, 2) row and column of the first pixel."""
    axes: Tensor
    """(B, 2, 2) step to the next row, and to the next column."""
    middle: Tensor
    """(B, 2) offset of the square's centre view from the scene's."""
    grid: Tensor
    """(B, 2, 2) step to the next row of views, and to the next column."""
    divisor: Tensor
    """(B,) disparities are those of the scene divided by this."""
    source: Tensor
    """(B,) number of the source."""

    @classmethod
    def upright(cls, scene: Tensor, side: Tensor, corner: Tensor) -> Frames:
        """Squares as they lie in the scenes."""
        count = len(scene)
        as_it_is = torch.eye(2, dtype=torch.int64).expand(count, 2, 2)
        nothing = torch.zeros(count, 2, dtype=torch.int64)
        return cls(
            scene,
            side,
            corner,
            as_it_is,
            nothing,
            as_it_is,
            torch.ones(count),
            nothing[:, 0],
        )

    @classmethod
    def joined(cls, parts: Sequence[Frames]) -> Frames:
        """The squares of all parts, one part after the other."""
        names = [f.name for f in fields(cls)]
        return cls(**{name: torch.cat([getattr(p, name) for p in parts]) for name in names})

    def __getitem__(self, at: Tensor) -> Frames:
        return Frames(**{f.name: getattr(self, f.name)[at] for f in fields(self)})

    def put(self, at: Tensor, others: Frames) -> Frames:
        """With other squares in the places `at`."""
        rest = torch.ones(len(self.scene), dtype=torch.bool)
        rest[at] = False
        kept = rest.nonzero()[:, 0]
        return Frames.joined([self[kept], others])[torch.cat([kept, at]).argsort()]

    def turned(self, symmetry: Tensor) -> Frames:
        """Images and view grids turned by one of `SYMMETRIES` each; (B,) their numbers."""
        turn = TURNS[symmetry]
        first = (self.side - 1)[:, None] * (1 - turn.sum(1)) // 2
        corner = self.corner + (first[:, None] @ self.axes)[:, 0]
        return replace(self, corner=corner, axes=turn @ self.axes, grid=turn @ self.grid)

    def window(self, first: int, side: int) -> Frames:
        """Smaller squares within, from row and column `first` on."""
        corner = self.corner + first * self.axes.sum(1)
        return replace(self, corner=corner, side=torch.full_like(self.side, side))

    def pixels(self, width: int) -> Tensor:
        """(B, side * side) numbers of the pixels in scenes of a width; all squares as large."""
        steps = torch.arange(int(self.side[0]))
        down, across = (self.axes @ torch.tensor([width, 1])).unbind(1)
        first = self.corner @ torch.tensor([width, 1])
        rows = first[:, None] + down[:, None] * steps
        return (rows[:, :, None] + (across[:, None] * steps)[:, None]).flatten(1)

    def offsets(self, wanted: Sequence[Offset]) -> Tensor:
        """(B, P, 2) where the views at the offsets `wanted` stand in the scenes."""
        return self.middle[:, None] + torch.tensor(wanted) @ self.grid


@dataclass(frozen=True)
class Patches:
    """B squares of light fields, and their truth."""

    views: Tensor
    """(B, P, C, H, W) in 0..1, or 8-bit; C is 3 (RGB) or 1 (gray)."""
    disparity: Tensor
    """(B, H, W) of the centre view, px per adjacent view; NaN where unknown."""
    usable: Tensor
    """(B, H, W) bool: the truth is known, and can be told from the views: no mirror, no glass."""
    centre: int
    """Which of the P views is the centre view."""
    noise: Tensor | None = None
    """(B, H, W) standard deviation of the centre view's noise, where it is known."""

    @property
    def centre_view(self) -> Tensor:
        """(B, C, H, W)."""
        return self.views[:, self.centre]

    def to(self, device: torch.device | str) -> Patches:
        """On a device, with samples in 0..1."""
        views = moved(self.views, device)
        unit = views if views.is_floating_point() else views.float() / 255
        disparity, usable = moved(self.disparity, device), moved(self.usable, device)
        return replace(self, views=unit, disparity=disparity, usable=usable)


@dataclass(frozen=True)
class LightFields:
    """N scenes of one size to cut from."""

    views: Tensor
    """(N, P, C, H, W) in 0..1, or 8-bit."""
    offsets: tuple[Offset, ...]
    """Which views these P are."""
    disparity: Tensor
    """(N, T, H, W) px per adjacent view; NaN where unknown."""
    usable: Tensor
    """(N, T, H, W) bool."""
    truths: tuple[Offset, ...] = ((0, 0),)
    """Of which views the T truths are."""

    def cut(self, frames: Frames, offsets: Sequence[Offset]) -> Patches:
        """Squares, all as large, with the views at `offsets` from their centre views.

        Raises:
            ValueError: a square needs a view, or the truth of one, that the scenes lack.
        """
        device, (channels, height, width) = self.views.device, self.views.shape[2:]
        shown = _numbers(self.offsets, frames.offsets(offsets), "view at")
        known = _numbers(self.truths, frames.offsets([(0, 0)]), "truth of the view at")[:, 0]
        shown = moved(shown + len(self.offsets) * frames.scene[:, None], device)
        known = moved(known + len(self.truths) * frames.scene, device)[:, None]
        pixels, divisor = moved(frames.pixels(width), device), moved(frames.divisor, device)
        side = int(frames.side[0])
        views = self.views.view(-1, channels, height * width)[
            shown[:, :, None, None],
            torch.arange(channels, device=device)[:, None],
            pixels[:, None, None],
        ]
        disparity, usable = (
            t.view(-1, height * width)[known, pixels].view(-1, side, side)
            for t in (self.disparity, self.usable)
        )
        return Patches(
            views.view(*views.shape[:3], side, side),
            disparity / divisor[:, None, None],
            usable,
            list(offsets).index((0, 0)),
        )


def _numbers(known: Sequence[Offset], wanted: Tensor, what: str) -> Tensor:
    """Where each of the offsets (..., 2) stands among those known."""
    beyond = 1 + max(max(abs(row), abs(col)) for row, col in known)
    table = torch.full((2 * beyond + 1, 2 * beyond + 1), -1)
    rows, cols = torch.tensor(known).T + beyond
    table[rows, cols] = torch.arange(len(known))
    rows, cols = (wanted.clamp(-beyond, beyond) + beyond).unbind(-1)
    numbers = table[rows, cols]
    if (numbers < 0).any():
        lacking = tuple(wanted[numbers < 0][0].tolist())
        raise ValueError(f"no {what} {lacking} from the centre")
    return numbers


def cut_by(group: Tensor, frames: Frames, cut: Callable[[int, Frames], Patches]) -> Patches:
    """Squares cut group by group, in the order of the frames.

    Args:
        group: (B,) number of each square's group.
        cut: squares of one group, by its number.
    """
    places = [(k, (group == k).nonzero()[:, 0]) for k in sorted(set(group.tolist()))]
    parts = [cut(k, frames[at]) for k, at in places]
    if len(parts) == 1:
        return parts[0]
    back = torch.cat([at for _, at in places]).argsort()
    channels = max(part.views.shape[2] for part in parts)

    def joined(field: Callable[[Patches], Tensor]) -> Tensor:
        whole = torch.cat([field(part) for part in parts])
        return whole[moved(back, whole.device)]

    return Patches(
        joined(lambda part: part.views.expand(-1, -1, channels, -1, -1)),
        joined(lambda part: part.disparity),
        joined(lambda part: part.usable),
        parts[0].centre,
    )


def gray(patches: Patches, weights: Tensor | None = None) -> Patches:
    """With one channel: luma unless weights (B, 3) are given. Gray stays as it is."""
    if patches.views.shape[2] == 1:
        return patches
    mixture = torch.from_numpy(LUMA)[None] if weights is None else weights
    mixture = moved(mixture, patches.views.device).to(patches.views.dtype)
    mixed = (patches.views * mixture[:, None, :, None, None]).sum(2, keepdim=True)
    return replace(patches, views=mixed)


def moved(tensor: Tensor, device: Any) -> Tensor:
    """On a device; to a GPU without waiting for it."""
    if torch.device(device).type == "cuda" and tensor.device.type == "cpu":
        return tensor.pin_memory().to(device, non_blocking=True)
    return tensor.to(device)
