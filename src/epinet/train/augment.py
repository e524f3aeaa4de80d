"""The paper's augmentations (section 3.3), each a small object that keeps views and truth together.

An augmentation draws one of its choices from a generator, and applies a choice to a `Patch`. The
two are apart so that a patch is cut no larger than its choices need, and so that laws can be
tested choice by choice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import torch
from torch import Generator, Tensor

from epinet.angular import Symmetry
from epinet.lightfield import LUMA
from epinet.synth.draw import WORLD_PX
from epinet.synth.faults import photographed
from epinet.synth.options import Faults

Offset = tuple[int, int]
"""(row, column) of a view counted from the centre view."""


@dataclass(frozen=True)
class Patch:
    """A square piece of a light field, and the truth of some of its views."""

    views: Tensor
    """(P, C, H, W) in 0..1; C is 3 (RGB) or 1 (gray)."""
    offsets: tuple[Offset, ...]
    """Which views these P are."""
    disparity: Tensor
    """(T, H, W) px per adjacent view; NaN where unknown."""
    usable: Tensor
    """(T, H, W) bool: the truth is known, and can be told from the views: no mirror, no glass."""
    truths: tuple[Offset, ...] = ((0, 0),)
    """Of which views the T truths are."""
    noise: Tensor | None = None
    """(H, W) standard deviation of the centre view's noise, where it is known."""

    def view(self, offset: Offset) -> Tensor:
        """One view (C, H, W)."""
        return self.views[self.offsets.index(offset)]

    def truth(self) -> tuple[Tensor, Tensor]:
        """Disparity and usable pixels (H, W) of the centre view."""
        k = self.truths.index((0, 0))
        return self.disparity[k], self.usable[k]

    def mapped(
        self, image: Callable[[Tensor], Tensor], offset: Callable[[Offset], Offset]
    ) -> Patch:
        """All images and the offsets of all views changed, disparities keeping their values."""
        return Patch(
            image(self.views),
            tuple(offset(o) for o in self.offsets),
            image(self.disparity),
            image(self.usable),
            tuple(offset(o) for o in self.truths),
            None if self.noise is None else image(self.noise),
        )


class Augmentation(Protocol):
    """A change of a light field together with its truth."""

    name: ClassVar[str]
    photometric: ClassVar[bool]
    """Whether it changes samples alone: then it comes after all that do not."""

    def draw(self, g: Generator) -> Any:
        """One of its choices, at random."""

    def apply(self, patch: Patch, choice: Any) -> Patch:
        """The patch, changed by a choice."""


@dataclass(frozen=True)
class ViewShift:
    """The nine grids that have two views less in each direction (figure 4).

    Each is a light field of its own, whose truth is that of its own centre view.
    """

    name: ClassVar[str] = "view_shift"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator) -> Offset:
        row, col = torch.randint(-1, 2, (2,), generator=g).tolist()
        return row, col

    def apply(self, patch: Patch, choice: Offset) -> Patch:
        """The grid around the view at `choice`.

        Raises:
            ValueError: the patch has no truth there.
        """
        if choice not in patch.truths:
            raise ValueError(f"no truth of the view at {choice} from the centre")
        row, col = choice
        return patch.mapped(lambda image: image, lambda o: (o[0] - row, o[1] - col))


@dataclass(frozen=True)
class Rotation:
    """Quarter turns of images and view grid; the streams are re-connected (figure 5)."""

    name: ClassVar[str] = "rotation"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator) -> int:
        return int(torch.randint(4, (), generator=g))

    def apply(self, patch: Patch, choice: int) -> Patch:
        return _turned(patch, Symmetry(choice))


@dataclass(frozen=True)
class Flip:
    """Transposition of images and view grid, or none; with rotations it gives all mirror images."""

    name: ClassVar[str] = "flip"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator) -> bool:
        return bool(torch.randint(2, (), generator=g))

    def apply(self, patch: Patch, choice: bool) -> Patch:
        return _turned(patch, Symmetry(0, choice))


def _turned(patch: Patch, symmetry: Symmetry) -> Patch:
    return patch.mapped(symmetry.apply, symmetry.offset)


@dataclass(frozen=True)
class TurnOrFlip:
    """One of five: a quarter turn, a half, three quarters, the transposition, or none.

    What the reference code does in place of `Rotation` and `Flip`, which together give eight.
    """

    name: ClassVar[str] = "turn_or_flip"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator) -> int:
        return int(torch.randint(5, (), generator=g))

    def apply(self, patch: Patch, choice: int) -> Patch:
        return _turned(patch, Symmetry(choice % 4, transposed=choice == 4))


@dataclass(frozen=True)
class SignReversal:
    """Images mirrored left-right, and the rows of the view grid alone reversed: every disparity
    changes its sign.

    The paper's flip: what is a mirror image, with the grid turned by half a turn beside. What was
    far then covers what was near, which no scene does: for the paper's recipes only.
    """

    name: ClassVar[str] = "sign_reversal"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator) -> bool:
        return bool(torch.randint(2, (), generator=g))

    def apply(self, patch: Patch, choice: bool) -> Patch:
        if not choice:
            return patch
        reversed_ = patch.mapped(lambda image: image.flip(-1), lambda o: (-o[0], o[1]))
        return replace(reversed_, disparity=-reversed_.disparity)


@dataclass(frozen=True)
class Scale:
    """Every N-th pixel, and disparity divided by N."""

    name: ClassVar[str] = "scale"
    photometric: ClassVar[bool] = False
    weights: tuple[int, ...] = (8, 6, 3)
    """How often N is 1, 2, 3, ... relative to each other (the reference code's)."""

    def draw(self, g: Generator) -> int:
        weights = torch.tensor(self.weights, dtype=torch.float)
        return 1 + int(torch.multinomial(weights, 1, generator=g))

    def apply(self, patch: Patch, choice: int) -> Patch:
        scaled = patch.mapped(lambda image: image[..., ::choice, ::choice], lambda o: o)
        return replace(scaled, disparity=scaled.disparity / choice)


@dataclass(frozen=True)
class GrayWeights:
    """Gray as a random mixture of the colours in place of luma; drawn once per sample."""

    name: ClassVar[str] = "gray_weights"
    photometric: ClassVar[bool] = True

    def draw(self, g: Generator) -> Tensor:
        weights = 0.05 + torch.rand(3, generator=g)
        return weights / weights.sum()

    def apply(self, patch: Patch, choice: Tensor) -> Patch:
        return gray(patch, choice)


def gray(patch: Patch, weights: Tensor | None = None) -> Patch:
    """With one channel: luma unless weights are given. Gray stays as it is."""
    if patch.views.shape[1] == 1:
        return patch
    mixture = torch.from_numpy(LUMA) if weights is None else weights
    mixed = (patch.views * mixture.to(patch.views)[:, None, None]).sum(1, keepdim=True)
    return replace(patch, views=mixed)


@dataclass(frozen=True)
class ColourScale:
    """All samples times one factor."""

    name: ClassVar[str] = "colour_scale"
    photometric: ClassVar[bool] = True
    bounds: tuple[float, float] = (0.5, 2.0)

    def draw(self, g: Generator) -> float:
        return _between(g, *self.bounds)

    def apply(self, patch: Patch, choice: float) -> Patch:
        return replace(patch, views=patch.views * choice)


@dataclass(frozen=True)
class Gamma:
    """All samples to one power."""

    name: ClassVar[str] = "gamma"
    photometric: ClassVar[bool] = True
    bounds: tuple[float, float] = (0.8, 1.2)

    def draw(self, g: Generator) -> float:
        return _between(g, *self.bounds)

    def apply(self, patch: Patch, choice: float) -> Patch:
        return replace(patch, views=patch.views.clamp_min(0) ** choice)


@dataclass(frozen=True)
class CameraFaults:
    """Exposure, vignetting, gamma, noise and 8 bits of a camera; beyond the paper.

    For rendered scenes, which come clean but for their lens. A choice is the key of a generator.
    """

    name: ClassVar[str] = "camera_faults"
    photometric: ClassVar[bool] = True
    faults: Faults = field(default_factory=Faults)

    def draw(self, g: Generator) -> int:
        return int(torch.randint(2**31, (), generator=g))

    def apply(self, patch: Patch, choice: int) -> Patch:
        g = Generator().manual_seed(choice)
        photos = photographed(g, patch.views[None], self.faults, picture_px=WORLD_PX)
        views, deviation = (t[0] for t in photos)
        return replace(patch, views=views, noise=deviation[patch.offsets.index((0, 0))].mean(0))


def _between(g: Generator, low: float, high: float) -> float:
    return low + (high - low) * float(torch.rand((), generator=g))


AUGMENTATIONS: Mapping[str, Augmentation] = MappingProxyType(
    {
        a.name: a
        for a in (
            ViewShift(),
            Rotation(),
            Flip(),
            TurnOrFlip(),
            SignReversal(),
            Scale(),
            GrayWeights(),
            ColourScale(),
            Gamma(),
            CameraFaults(),
        )
    }
)
"""All by name, in the order in which they are applied."""
