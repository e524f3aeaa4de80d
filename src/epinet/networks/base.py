"""What the program asks of a network, and what one gets that says no more than its layers.

A network is a class of its own in a folder of its own. Nothing outside that folder asks which
network it has in hand: to predict, to train, to keep and to load one, the program calls what
stands here. docs/how-to/extend.md shows how to write one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any, ClassVar, Generic, Self, TypeVar, cast

import torch
from pydantic import BaseModel, ConfigDict, Field, field_validator
from torch import Tensor, nn

from epinet.networks.inputs import GRAY, Input
from epinet.networks.robust import robust, weighted_mean
from epinet.networks.tiling import overlapping_tiles

VIEW_COUNTS = (3, 5, 7, 9)
"""Sides of the grids of views that networks are trained on."""

OWN = "own"
"""Start from scratch as the network's class makes its weights."""

Progress = Callable[[float], None]
"""Told the share of the work (0..1) done since the last call."""


@dataclass(frozen=True)
class Batch:
    """Views to learn from, and their truth."""

    stacks: Tensor
    """(B, S, N, P + 2 * margin, P + 2 * margin) views as the network sees them: N of them along
    each of S directions."""
    disparity: Tensor
    """(B, 1, P, P) px per adjacent view of the stacks, of their inner part; 0 where unknown."""
    weight: Tensor
    """(B, 1, P, P): 1 where the truth can be told from the views, less where there is little
    texture to match for the noise, on mirrors as the recipe says, and 0 where the truth is
    unknown."""
    every: int
    """The stacks hold every so many-th view on each side of the centre view."""
    range_px: tuple[float, float]
    """Where a network that looks for a range is to look for the disparities of the stacks: as far
    beyond them as when it predicts, whose ranges differ, too."""


class Settings(BaseModel):
    """What networks read of a recipe. A subclass adds values that are one network's own.

    A recipe holds these values beside those of the data and the optimisation, all by their names.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    starts: ClassVar[tuple[str, ...]] = (OWN,)
    """Ways to start from scratch."""

    views: int = 9
    """Per direction."""
    patch_px: Annotated[int, Field(ge=1)] = 1
    """Side of the map that a patch gives; its views are larger by the network's margin."""
    shape: Mapping[str, Any] = {}
    """Values of the network's configuration that differ from its defaults."""
    start: str = OWN
    """Starting weights: one of the network's `starts`, or trained ones: a file, or the name of
    shipped ones."""
    loss_scale_px: Annotated[float, Field(gt=0)] | None = None
    """The loss of an error e is s log(1 + |e| / s), which hardly sees errors far above s.
    None: |e|, the paper's mean absolute error."""
    seed: Annotated[int, Field(ge=0)] = 1

    @field_validator("views")
    @classmethod
    def _known(cls, views: int) -> int:
        if views not in VIEW_COUNTS:
            raise ValueError(f"views must be one of {VIEW_COUNTS}, not {views}")
        return views

    @property
    def from_scratch(self) -> bool:
        """Whether the run begins without trained weights."""
        return self.start in self.starts

    @property
    def input(self) -> Input:
        """What the network sees of gray views."""
        return GRAY


S = TypeVar("S", bound=Settings)


class Network(nn.Module, Generic[S]):
    """A network that estimates the disparity of the centre view of a star of views.

    A subclass has `Config`, a pydantic dataclass, takes one when it is made and keeps it as
    `config`; its `estimate` gives a map. That is enough to predict, to train and to be kept.
    """

    Config: ClassVar[type[Any]]
    """Its shape: a pydantic dataclass, since weights files of strangers are validated by it."""
    Settings: ClassVar[type[Settings]] = Settings
    """What it reads of a recipe."""
    margin_px: ClassVar[int] = 11
    """Views of a training patch extend so far beyond its map on each side."""
    searches: ClassVar[bool] = True
    """Whether it looks for disparities in a range: it is then given the range that the views
    show, and views whose exposure has been made alike. Otherwise its range is its training's."""
    floats_per_px: ClassVar[float] = 1000
    """Peak of what `estimate` holds at once, for the bound on memory."""
    overlap_px: ClassVar[int] = 64
    """What tiles share with each neighbour, where views are too large for that bound."""

    config: Any

    @classmethod
    def of(cls, settings: S) -> Self:
        """The untrained network of a recipe."""
        return cls(cls.Config(**settings.shape))

    @property
    def views(self) -> tuple[int, ...]:
        """Sides of the grids of views that it can be shown, the largest first."""
        return VIEW_COUNTS[::-1]

    @property
    def directions(self) -> int:
        """How many directions of views it sees: 4, 2 or 1 (`epinet.angular`)."""
        return 4

    def describe(self) -> str:
        """A few words for people."""
        views = self.views
        sides = f"{views[-1]}x{views[-1]} to " * (len(views) > 1) + f"{views[0]}x{views[0]}"
        return f"{type(self).__name__}, {sides} views, {self.parameter_count:,} parameters"

    @property
    def parameter_count(self) -> int:
        """Numbers that training changes."""
        return sum(p.numel() for p in self.parameters())

    # To predict.

    def estimate(
        self, stacks: Tensor, range_px: tuple[float, float]
    ) -> tuple[Tensor, Tensor | None]:
        """The map of whole views, and the error to expect of it.

        Args:
            stacks: (B, S, N, H, W) views along each direction, as its input has them.
            range_px: disparities to look for, px per adjacent view.

        Returns:
            (B, 1, H, W) disparity of the centre view in px per adjacent view, and its mean
            absolute error in px, or None from a network that predicts none.
        """
        raise NotImplementedError

    @torch.inference_mode()
    def predict(
        self,
        stacks: Tensor,
        range_px: tuple[float, float],
        memory_mb: float,
        advance: Progress = lambda share: None,
    ) -> tuple[Tensor, Tensor | None]:
        """`estimate` for one light field of any size, within a bound on memory.

        Args:
            stacks: (S, N, H, W)
            range_px: see `estimate`.
            memory_mb: bound on what it holds at once; larger views are done in tiles.
            advance: told about progress.

        Returns:
            (H, W) disparity and error, as from `estimate`.
        """

        def of_tile(tile: Tensor) -> tuple[Tensor, Tensor | None]:
            return self.estimate(tile, range_px)

        pixels = memory_mb * 2**20 / 4 / self.floats_per_px
        align_px = self.coarsest_px(range_px, stacks.shape[1])
        return overlapping_tiles(of_tile, stacks, pixels, self.overlap_px, align_px, advance)

    def coarsest_px(self, range_px: tuple[float, float], views: int) -> int:
        """Side of the squares of pixels that its smallest pictures show as one: tiles begin where
        these begin, or those pictures would show other means than in the whole."""
        return 1

    # To train.

    def begin(self, settings: S, start: Network[Any] | None, stacks: Callable[[], Tensor]) -> None:
        """Begin a run.

        Args:
            settings: the recipe.
            start: trained weights to start from, fitted to this network; None from scratch.
            stacks: gives those of the first batch.
        """
        if start is not None:
            self.load_state_dict(start.state_dict())
        self.attach(settings)

    def attach(self, settings: S) -> None:
        """Add what only training has, also where a run continues from its checkpoint."""

    def folded(self) -> Network[Any]:
        """The network as it is kept: without what only training has; in eval mode it gives the
        same. May change this one."""
        return self

    def fitted(self, start: Network[Any], seed: int) -> Network[Any]:
        """Trained weights as a network of this one's configuration.

        Raises:
            ValueError: they are of another network.
        """
        if type(start) is not type(self) or start.config != self.config:
            raise ValueError("weights of another network than the recipe's")
        return start

    def loss(self, batch: Batch, settings: S) -> Tensor:
        """What training minimises: the mean robust error over pixels, by their weights."""
        found, _ = self.estimate(batch.stacks, batch.range_px)
        inner = slice(self.margin_px, found.shape[-1] - self.margin_px)
        error = (found[..., inner, inner] - batch.disparity).abs() / batch.every
        return weighted_mean(robust(error, settings.loss_scale_px), batch.weight)

    def hidden_weights(self) -> list[nn.Parameter]:
        """Weights of the hidden convolutions, for optimisers that treat them as matrices: all but
        those that narrow down to an output."""
        convolutions = [m for m in self.modules() if isinstance(m, nn.Conv2d)]
        return [
            cast(nn.Parameter, c.weight)
            for c in convolutions
            if 2 * c.out_channels >= c.in_channels
        ]


def config_as_dict(net: Network[Any]) -> dict[str, Any]:
    """A network's configuration, for JSON."""
    return asdict(net.config)
