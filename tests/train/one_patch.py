"""The augmentations of one patch at a time, by plain indexing: what whole batches are held to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from epinet.angular import Symmetry
from epinet.train.patches import LightFields, Offset


@dataclass(frozen=True)
class Patch:
    """A square of a light field, and the truth of some of its views."""

    views: Tensor
    """(P, C, H, W)."""
    offsets: tuple[Offset, ...]
    disparity: Tensor
    """(T, H, W)."""
    usable: Tensor
    truths: tuple[Offset, ...]

    @classmethod
    def of(cls, scenes: LightFields, scene: int, row: int, col: int, side: int) -> Patch:
        views, disparity, usable = (
            t[scene, ..., row : row + side, col : col + side]
            for t in (scenes.views, scenes.disparity, scenes.usable)
        )
        return cls(views, scenes.offsets, disparity, usable, scenes.truths)

    def mapped(
        self, image: Callable[[Tensor], Tensor], offset: Callable[[Offset], Offset]
    ) -> Patch:
        return Patch(
            image(self.views),
            tuple(offset(o) for o in self.offsets),
            image(self.disparity),
            image(self.usable),
            tuple(offset(o) for o in self.truths),
        )

    def stacked(self, offsets: list[Offset]) -> Tensor:
        """(P, C, H, W) in the order of `offsets`."""
        return torch.stack([self.views[self.offsets.index(o)] for o in offsets])

    def truth(self) -> tuple[Tensor, Tensor]:
        k = self.truths.index((0, 0))
        return self.disparity[k], self.usable[k]


def view_shift(patch: Patch, choice: Tensor) -> Patch:
    row, col = choice.tolist()
    return patch.mapped(lambda image: image, lambda o: (o[0] - row, o[1] - col))


def rotation(patch: Patch, choice: Tensor) -> Patch:
    symmetry = Symmetry(int(choice))
    return patch.mapped(symmetry.apply, symmetry.offset)


def flip(patch: Patch, choice: Tensor) -> Patch:
    symmetry = Symmetry(0, bool(choice))
    return patch.mapped(symmetry.apply, symmetry.offset)


def sign_reversal(patch: Patch, choice: Tensor) -> Patch:
    if not choice:
        return patch
    reversed_ = patch.mapped(lambda image: image.flip(-1), lambda o: (-o[0], o[1]))
    return replace(reversed_, disparity=-reversed_.disparity)


def scale(patch: Patch, choice: Tensor) -> Patch:
    n = int(choice)
    scaled = patch.mapped(lambda image: image[..., ::n, ::n], lambda o: o)
    return replace(scaled, disparity=scaled.disparity / n)


def gray_weights(patch: Patch, choice: Tensor) -> Patch:
    mixed = (patch.views * choice[:, None, None]).sum(1, keepdim=True)
    return replace(patch, views=mixed)


def colour_scale(patch: Patch, choice: Tensor) -> Patch:
    return replace(patch, views=patch.views * choice)


def gamma(patch: Patch, choice: Tensor) -> Patch:
    return replace(patch, views=patch.views.clamp_min(0) ** choice)


AUGMENTED: dict[str, Callable[[Patch, Tensor], Patch]] = {
    f.__name__: f
    for f in (
        view_shift,
        rotation,
        flip,
        sign_reversal,
        scale,
        gray_weights,
        colour_scale,
        gamma,
    )
}
