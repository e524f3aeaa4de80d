"""EPINET as the program uses it: in tiles that change nothing, and with what trains it well."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self

import torch
from pydantic import Field, model_validator
from torch import Tensor, nn
from torch.nn import functional as F

from epinet.networks.base import Batch, Network, Progress, Settings
from epinet.networks.epinet.classes import add_classes, classes_of, remove_classes
from epinet.networks.epinet.layers import (
    MARGIN_PX,
    EpinetConfig,
    Layers,
    ViewConv,
)
from epinet.networks.epinet.normed import add_norms, calibrate_norms, without_norms
from epinet.networks.epinet.start import (
    pass_on,
    start_as_keras,
    start_on_differences,
    widened,
    with_fewer_views,
)
from epinet.networks.inputs import GRAY, LOCAL_CONTRAST, Input
from epinet.networks.robust import robust, weighted_mean
from epinet.networks.tiling import tiles

GLOROT, DIFFERENCES = "glorot", "differences"
"""Ways to start from scratch."""

FLOATS_PER_PX_AND_CHANNEL = 5.3
"""Peak of what the merge part holds at once (measured; see benchmarks/memory.py)."""


class EpinetSettings(Settings):
    """What a recipe says of EPINET."""

    starts: ClassVar[tuple[str, ...]] = (GLOROT, DIFFERENCES)

    start: str = GLOROT
    """Starting weights: "glorot", Keras' default; "differences", He's on differences to the centre
    view; or trained ones: a file, or the name of shipped ones."""
    streams: Literal[1, 2, 4] = 4
    width: Annotated[int, Field(ge=1, le=512)] = 70
    """Channels of each of the streams where there are four, as published; fewer are as much wider
    as gives equal parameters. What a narrow network learned can start a wide one."""
    local_contrast: bool = False
    """The network sees each view with its local mean and contrast normalised, not plain gray."""
    identity: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """Share of the identity in the hidden layers of a start from scratch."""
    norms: bool = False
    """Batch normalisation behind every hidden convolution; it folds into the weights kept."""
    class_weight: Annotated[float, Field(ge=0)] = 0.0
    """Weight of a classification of the disparity from the features, while training only."""

    @model_validator(mode="after")
    def _possible_for_epinet(self) -> Self:
        if self.shape:
            raise ValueError("shape: EPINET's follows from views, streams and width")
        if self.identity and not self.from_scratch:
            raise ValueError("identity: takes a start from scratch, not from weights")
        return self

    @property
    def input(self) -> Input:
        return LOCAL_CONTRAST if self.local_contrast else GRAY


class Epinet(Layers, Network[EpinetSettings]):
    """EPINET as published.

    Example:
        >>> net = Epinet(EpinetConfig(views=9)).eval()
        >>> net(torch.zeros(1, 4, 9, 64, 48)).shape
        torch.Size([1, 1, 42, 26])
    """

    Config = EpinetConfig
    Settings = EpinetSettings
    margin_px = MARGIN_PX
    searches = False

    @classmethod
    def of(cls, settings: EpinetSettings) -> Self:
        return cls(EpinetConfig.of_equal_size(settings.streams, settings.views, settings.width))

    @property
    def views(self) -> tuple[int, ...]:
        return (self.config.views,)

    @property
    def directions(self) -> int:
        return self.config.streams

    def describe(self) -> str:
        return (
            f"EPINET, {self.config.streams} streams of {self.config.views} views, "
            f"{self.parameter_count:,} parameters"
        )

    def estimate(self, stacks: Tensor, range_px: tuple[float, float]) -> tuple[Tensor, None]:
        padded = F.pad(stacks.flatten(0, 1), (MARGIN_PX,) * 4, mode="replicate")
        return self(padded.view(*stacks.shape[:3], *padded.shape[-2:])), None

    @torch.inference_mode()
    def predict(
        self,
        stacks: Tensor,
        range_px: tuple[float, float],
        memory_mb: float,
        advance: Progress = lambda share: None,
    ) -> tuple[Tensor, None]:
        """All convolutions are valid and act pixel by pixel, so a tile with its margin gives what
        the whole picture gives there."""
        height, width = stacks.shape[-2:]
        padded = F.pad(stacks, (MARGIN_PX,) * 4, mode="replicate")
        out = torch.empty(height, width, device=stacks.device)
        for top, bottom, left, right in tiles(height, width, self.tile_side_px(memory_mb)):
            tile = padded[..., top : bottom + 2 * MARGIN_PX, left : right + 2 * MARGIN_PX]
            with torch.backends.cudnn.flags(allow_tf32=False):  # float32 means float32
                out[top:bottom, left:right] = self(tile[None])[0, 0]
            advance((bottom - top) * (right - left) / (height * width))
        return out, None

    def tile_side_px(self, memory_mb: float) -> int:
        """Side of the largest square tile whose intermediate results fit into a bound."""
        channels = self.config.streams * self.config.stream_width
        pixels = memory_mb * 2**20 / (4 * channels * FLOATS_PER_PX_AND_CHANNEL)
        return max(16, math.isqrt(int(pixels)) - 2 * MARGIN_PX)

    def begin(
        self,
        settings: EpinetSettings,
        start: Network[Any] | None,
        stacks: Callable[[], Tensor],
    ) -> None:
        if settings.start == DIFFERENCES:
            start_on_differences(self)
        elif settings.start == GLOROT:
            start_as_keras(self)
        super().begin(settings, start, stacks)
        if settings.identity:
            pass_on(self, settings.identity)
        if settings.norms and start is not None:
            calibrate_norms(self, stacks())

    def attach(self, settings: EpinetSettings) -> None:
        if settings.norms:
            add_norms(self)
        if settings.class_weight:
            add_classes(self)

    def folded(self) -> Epinet:
        plain = without_norms(self)
        remove_classes(plain)
        return plain

    def fitted(self, start: Network[Any], seed: int) -> Network[Any]:
        """Of weights of as many views or more, as wide or narrower."""
        ours, theirs = self.config, start.config
        if not isinstance(start, Epinet) or ours != replace(
            theirs, views=ours.views, stream_width=ours.stream_width
        ):
            raise ValueError("weights of another network than the recipe's")
        if theirs.stream_width > ours.stream_width:
            raise ValueError(
                f"weights of a width of {theirs.stream_width} are no start for one of "
                f"{ours.stream_width}; the other way round they are"
            )
        if theirs.views < ours.views:
            raise ValueError(
                f"weights of {theirs.views} views are no start for {ours.views}; the other way "
                "round they are"
            )
        return widened(with_fewer_views(start, ours.views), ours.stream_width, seed)

    def loss(self, batch: Batch, settings: EpinetSettings) -> Tensor:
        streams, hidden = self.features(batch.stacks)
        error = (self.disparity(hidden) - batch.disparity).abs()
        loss = weighted_mean(robust(error, settings.loss_scale_px), batch.weight)
        if settings.class_weight:
            unlikely = classes_of(self).cross_entropy(streams, hidden, batch.disparity)
            loss = loss + settings.class_weight * weighted_mean(unlikely, batch.weight)
        return loss

    def hidden_weights(self) -> list[nn.Parameter]:
        first = {id(m.weight) for m in self.modules() if isinstance(m, ViewConv)}
        return [weight for weight in super().hidden_weights() if id(weight) not in first]
