"""The paper's augmentations (section 3.3), each a small object that keeps views and truth together.

An augmentation draws choices from a generator, one for each patch of a batch, and applies them.
The geometric ones say how squares lie in scenes, before they are cut; the photometric ones change
samples. Drawing and applying are apart so that a patch is cut no larger than its choices need, and
so that laws can be tested choice by choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import torch
from torch import Generator, Tensor

from epinet.angular import SYMMETRIES, Symmetry
from epinet.synth.draw import WORLD_PX
from epinet.synth.faults import photographed
from epinet.synth.generator import generator
from epinet.synth.options import Faults
from epinet.train.patches import Frames, Patches, gray, moved


class Augmentation(Protocol):
    """A change of light fields together with their truth."""

    name: ClassVar[str]
    photometric: ClassVar[bool]
    """Whether it changes samples alone, of `Patches`; otherwise it changes `Frames`."""

    def draw(self, g: Generator, count: int) -> Tensor:
        """(count, ...) of its choices, at random."""

    def apply(self, patches: Any, choices: Tensor) -> Any:
        """Frames or patches, each changed by its choice."""


@dataclass(frozen=True)
class ViewShift:
    """The nine grids that have two views less in each direction (figure 4).

    Each is a light field of its own, whose truth is that of its own centre view. A choice is the
    offset of that view.
    """

    name: ClassVar[str] = "view_shift"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(-1, 2, (count, 2), generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        middle = patches.middle + (choices[:, None] @ patches.grid)[:, 0]
        return replace(patches, middle=middle)


@dataclass(frozen=True)
class Rotation:
    """Quarter turns of images and view grid; the streams are re-connected (figure 5)."""

    name: ClassVar[str] = "rotation"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(4, (count,), generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        return patches.turned(_numbers_of([Symmetry(k) for k in range(4)])[choices])


@dataclass(frozen=True)
class Flip:
    """Transposition of images and view grid, or none; with rotations it gives all mirror images."""

    name: ClassVar[str] = "flip"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(2, (count,), generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        return patches.turned(_numbers_of([Symmetry(0), Symmetry(0, True)])[choices])


def _numbers_of(symmetries: list[Symmetry]) -> Tensor:
    return torch.tensor([SYMMETRIES.index(s) for s in symmetries])


@dataclass(frozen=True)
class TurnOrFlip:
    """One of five: a quarter turn, a half, three quarters, the transposition, or none.

    What the reference code does in place of `Rotation` and `Flip`, which together give eight.
    """

    name: ClassVar[str] = "turn_or_flip"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(5, (count,), generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        five = [*(Symmetry(quarters) for quarters in range(4)), Symmetry(0, True)]
        return patches.turned(_numbers_of(five)[choices])


@dataclass(frozen=True)
class SignReversal:
    """Images mirrored left-right, and the rows of the view grid alone reversed: every disparity
    changes its sign.

    The paper's flip: what is a mirror image, with the grid turned by half a turn beside. What was
    far then covers what was near, which no scene does: for the paper's recipes only.
    """

    name: ClassVar[str] = "sign_reversal"
    photometric: ClassVar[bool] = False

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(2, (count,), generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        sign = 1 - 2 * choices
        still = torch.ones_like(sign)
        last = torch.stack([0 * choices, choices * (patches.side - 1)], 1)
        corner = patches.corner + (last[:, None] @ patches.axes)[:, 0]
        axes = torch.stack([still, sign], 1)[..., None] * patches.axes
        grid = torch.stack([sign, still], 1)[..., None] * patches.grid
        divisor = sign * patches.divisor
        return replace(patches, corner=corner, axes=axes, grid=grid, divisor=divisor)


@dataclass(frozen=True)
class Scale:
    """Every N-th pixel, and disparity divided by N."""

    name: ClassVar[str] = "scale"
    photometric: ClassVar[bool] = False
    weights: tuple[int, ...] = (8, 6, 3)
    """How often N is 1, 2, 3, ... relative to each other (the reference code's)."""

    def draw(self, g: Generator, count: int) -> Tensor:
        weights = torch.tensor(self.weights, dtype=torch.float)
        return 1 + torch.multinomial(weights, count, replacement=True, generator=g)

    def apply(self, patches: Frames, choices: Tensor) -> Frames:
        return replace(
            patches,
            side=-(-patches.side // choices),
            axes=choices[:, None, None] * patches.axes,
            divisor=choices * patches.divisor,
        )


@dataclass(frozen=True)
class GrayWeights:
    """Gray as a random mixture of the colours in place of luma; drawn once per sample."""

    name: ClassVar[str] = "gray_weights"
    photometric: ClassVar[bool] = True

    def draw(self, g: Generator, count: int) -> Tensor:
        weights = 0.05 + torch.rand(count, 3, generator=g)
        return weights / weights.sum(1, keepdim=True)

    def apply(self, patches: Patches, choices: Tensor) -> Patches:
        return gray(patches, choices)


@dataclass(frozen=True)
class ColourScale:
    """All samples times one factor."""

    name: ClassVar[str] = "colour_scale"
    photometric: ClassVar[bool] = True
    bounds: tuple[float, float] = (0.5, 2.0)

    def draw(self, g: Generator, count: int) -> Tensor:
        return _between(g, count, *self.bounds)

    def apply(self, patches: Patches, choices: Tensor) -> Patches:
        return replace(patches, views=patches.views * _each(choices, patches))


@dataclass(frozen=True)
class Gamma:
    """All samples to one power."""

    name: ClassVar[str] = "gamma"
    photometric: ClassVar[bool] = True
    bounds: tuple[float, float] = (0.8, 1.2)

    def draw(self, g: Generator, count: int) -> Tensor:
        return _between(g, count, *self.bounds)

    def apply(self, patches: Patches, choices: Tensor) -> Patches:
        return replace(patches, views=patches.views.clamp_min(0) ** _each(choices, patches))


@dataclass(frozen=True)
class CameraFaults:
    """Exposure, vignetting, gamma, noise and 8 bits of a camera; beyond the paper.

    For rendered scenes, which come clean but for their lens. Choices are, all together, the key of
    a generator.
    """

    name: ClassVar[str] = "camera_faults"
    photometric: ClassVar[bool] = True
    faults: Faults = field(default_factory=Faults)

    def draw(self, g: Generator, count: int) -> Tensor:
        return torch.randint(2**31, (count,), generator=g)

    def apply(self, patches: Patches, choices: Tensor) -> Patches:
        g = generator(*choices.tolist())
        views, deviation = photographed(g, patches.views, self.faults, picture_px=WORLD_PX)
        return replace(patches, views=views, noise=deviation[:, patches.centre].mean(1))


def _between(g: Generator, count: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(count, generator=g)


def _each(choices: Tensor, patches: Patches) -> Tensor:
    """(B, 1, 1, 1, 1) a number for each patch."""
    return moved(choices, patches.views.device).view(-1, 1, 1, 1, 1)


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
