"""The four directions of the view grid, and what rotations and flips do to them.

The only module that knows them. Grid positions are (row, col) from the top-left view. For a
9 x 9 grid of HCI numbering (index = 9 * row + col) the directions are

     90: 76, 67, ..., 4    bottom to top, centre column
      0: 36, 37, ..., 44   left to right, centre row
     45: 72, 64, ..., 8    bottom-left to top-right
    -45:  0, 10, ..., 80   top-left to bottom-right

and the stacks of a network stand in this order (the reference implementation's).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

DIRECTIONS_DEG = (90, 0, 45, -45)

STREAM_DIRECTIONS_DEG = {1: (0,), 2: (0, 90), 4: DIRECTIONS_DEG}
"""Directions that a network of so many streams sees (1 and 2: our reading of table 1)."""

CENTRAL_NINE = tuple((row, col) for row in (-1, 0, 1) for col in (-1, 0, 1))
"""The centre view and the eight around it, as (rows, columns) from the centre."""

Array = TypeVar("Array", NDArray[np.float32], Tensor)


def direction_positions(direction_deg: int, views: int) -> list[tuple[int, int]]:
    """(row, col) of the views of one direction in a `views` x `views` grid, in stack order."""
    last, centre = views - 1, views // 2
    return {
        90: [(last - i, centre) for i in range(views)],
        0: [(centre, i) for i in range(views)],
        45: [(last - i, i) for i in range(views)],
        -45: [(i, i) for i in range(views)],
    }[direction_deg]


def star_positions(views: int) -> list[tuple[int, int]]:
    """All (row, col) that the four directions touch, row-major: 4 * views - 3 of them."""
    return sorted({p for d in DIRECTIONS_DEG for p in direction_positions(d, views)})


@dataclass(frozen=True)
class Symmetry:
    """One of the 8 symmetries of the square, applied to images and view grid together.

    Such a change of the whole light field keeps every disparity's value; the map moves with the
    images. `quarter_turns` are counter-clockwise and come after the transposition.
    """

    quarter_turns: int = 0
    transposed: bool = False

    def apply(self, image: Array) -> Array:
        """Turn images (..., H, W): numpy arrays or tensors."""
        if isinstance(image, Tensor):
            turned = image.transpose(-2, -1) if self.transposed else image
            return torch.rot90(turned, self.quarter_turns, (-2, -1))
        flipped = np.swapaxes(image, -2, -1) if self.transposed else image
        return np.rot90(flipped, self.quarter_turns, (-2, -1))

    def undo(self, image: Array) -> Array:
        """The inverse of `apply`."""
        if isinstance(image, Tensor):
            turned = torch.rot90(image, -self.quarter_turns, (-2, -1))
            return turned.transpose(-2, -1) if self.transposed else turned
        rotated = np.rot90(image, -self.quarter_turns, (-2, -1))
        return np.swapaxes(rotated, -2, -1) if self.transposed else rotated

    def position(self, row: int, col: int, views: int) -> tuple[int, int]:
        """Where the view at (row, col) goes."""
        if self.transposed:
            row, col = col, row
        for _ in range(self.quarter_turns % 4):
            row, col = views - 1 - col, row
        return row, col

    def offset(self, offset: tuple[int, int]) -> tuple[int, int]:
        """Where the view goes that stands `offset` (rows, columns) from the centre view."""
        return self.position(*offset, views=1)  # a grid of one view turns about the origin

    def stack_sources(self) -> list[tuple[int, bool]]:
        """For each stack after the symmetry: which stack it was, and whether it is reversed."""
        views = 9
        old = [direction_positions(d, views) for d in DIRECTIONS_DEG]
        moved = [[self.position(*p, views) for p in stack] for stack in old]
        sources = []
        for target in old:
            forward = [i for i, stack in enumerate(moved) if stack == target]
            if forward:
                sources.append((forward[0], False))
            else:
                sources.append((moved.index(target[::-1]), True))
        return sources

    def apply_to_stacks(self, stacks: Tensor) -> Tensor:
        """Turn four stacks (..., 4, N, H, W): images turned, streams re-connected (figure 5)."""
        reordered = [
            stacks[..., i, :, :, :].flip(-3) if reverse else stacks[..., i, :, :, :]
            for i, reverse in self.stack_sources()
        ]
        return self.apply(torch.stack(reordered, dim=-4))


SYMMETRIES = tuple(Symmetry(k, t) for t in (False, True) for k in range(4))
"""All 8: the ensemble of Epinet-fcn-m averages over them."""


def gather_stacks(
    view: Callable[[int, int], NDArray[np.float32]], views: int, streams: int = 4
) -> NDArray[np.float32]:
    """Network input (streams, views, H, W) from a function giving the gray view at (row, col)."""
    cache = {p: view(*p) for p in _positions(views, streams)}
    directions = STREAM_DIRECTIONS_DEG[streams]
    stack = np.stack([cache[p] for d in directions for p in direction_positions(d, views)])
    return stack.reshape(len(directions), views, *stack.shape[1:])


def _positions(views: int, streams: int) -> set[tuple[int, int]]:
    directions = STREAM_DIRECTIONS_DEG[streams]
    return {p for d in directions for p in direction_positions(d, views)}
