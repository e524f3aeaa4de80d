"""EPINET, the network of Shin et al., CVPR 2018 (section 3.2 and figure 2), whole.

Each stream sees the views along one direction of the grid, stacked as channels:

    stack (B, N, H, W) -> 3 blocks of [conv2x2 - ReLU - conv2x2 - BN - ReLU]     (B, 70, H-6, W-6)
    concatenate the streams                                                      (B, 280, H-6, W-6)
    merge:  7 such blocks, then conv2x2 - ReLU - conv2x2                         (B, 1, H-22, W-22)

Every convolution is valid with stride 1, so the receptive field is 23 x 23 and the map is 22
pixels smaller than its input. The streams share no weights. The output is the disparity of the
centre view in pixels per adjacent view (see docs/conventions.md).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
from torch import Tensor, nn

from epinet.networks.base import VIEW_COUNTS

MARGIN_PX = 11
"""Pixels of context that one output pixel needs on each side: the map is 2 * 11 smaller."""

STREAM_COUNTS = (1, 2, 4)


@dataclass(frozen=True, config={"extra": "forbid"})
class EpinetConfig:
    """Shape of one EPINET. What is out of bounds raises a ValueError (of pydantic)."""

    streams: int = 4
    """Directions looked along: 4 (90, 0, 45, -45 degrees), 2 (0, 90) or 1 (0)."""
    views: int = 9
    """Views per stream, N: the grid is N x N."""
    stream_width: Annotated[int, Field(ge=1, le=2048)] = 70
    """Channels of one stream; the merge part has streams * stream_width."""
    stream_blocks: Annotated[int, Field(ge=1, le=32)] = 3
    merge_blocks: Annotated[int, Field(ge=1, le=32)] = 7

    def __post_init__(self) -> None:
        if self.streams not in STREAM_COUNTS:
            raise ValueError(f"streams must be one of {STREAM_COUNTS}, not {self.streams}")
        if self.views not in VIEW_COUNTS:
            raise ValueError(f"views must be one of {VIEW_COUNTS}, not {self.views}")
        if self.stream_blocks + self.merge_blocks + 1 != MARGIN_PX:
            raise ValueError(
                f"{self.stream_blocks} and {self.merge_blocks} blocks see another number of pixels "
                f"around than {MARGIN_PX}"
            )

    @classmethod
    def of_equal_size(cls, streams: int, views: int = 9, width: int = 70) -> EpinetConfig:
        """The network of table 1: `streams` streams at about as many parameters as 4 of a width.

        The paper states no widths for 1 and 2 streams; this takes the width that comes nearest.
        """
        return cls(streams, views, stream_width=_width_of_equal_size(streams, views, width))

    @property
    def parameters(self) -> int:
        """Trainable parameters, from the layer shapes alone."""

        def conv(c_in: int, c_out: int) -> int:
            return 4 * c_in * c_out + c_out

        def blocks(n: int, c_in: int, c: int) -> int:
            return conv(c_in, c) - conv(c, c) + n * (2 * conv(c, c) + 2 * c)

        width = self.streams * self.stream_width
        streams = self.streams * blocks(self.stream_blocks, self.views, self.stream_width)
        merge = blocks(self.merge_blocks, width, width)
        return streams + merge + conv(width, width) + conv(width, 1)


@lru_cache
def _width_of_equal_size(streams: int, views: int, width: int) -> int:
    target = EpinetConfig(views=views, stream_width=width).parameters

    def distance(candidate: int) -> int:
        return abs(EpinetConfig(streams, views, candidate).parameters - target)

    return min(range(width, 4 * width + 1), key=distance)


class ViewConv(nn.Conv2d):
    """The first layer of a stream, which compares views: float32 also under autocast.

    It is 1 % of the cost, and bf16 cannot tell neighbouring 8-bit grays apart.
    """

    def forward(self, views: Tensor) -> Tensor:
        with torch.autocast(views.device.type, enabled=False):
            return super().forward(views.float().contiguous(memory_format=torch.channels_last))


def batch_norm(channels: int) -> nn.BatchNorm2d:
    """With Keras' defaults, as in the reference."""
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01)


def _block(first: nn.Conv2d) -> nn.Sequential:
    c = first.out_channels
    return nn.Sequential(
        first,
        nn.ReLU(inplace=True),
        nn.Conv2d(c, c, 2),
        batch_norm(c),
        nn.ReLU(inplace=True),
    )


def _blocks(n: int, first: nn.Conv2d) -> nn.Sequential:
    c = first.out_channels
    return nn.Sequential(_block(first), *(_block(nn.Conv2d(c, c, 2)) for _ in range(n - 1)))


class Layers(nn.Module):
    """The published network."""

    def __init__(self, config: EpinetConfig = EpinetConfig()) -> None:  # noqa: B008 (frozen)
        super().__init__()
        self.config = config
        width = config.streams * config.stream_width
        self.streams = nn.ModuleList(
            _blocks(config.stream_blocks, ViewConv(config.views, config.stream_width, 2))
            for _ in range(config.streams)
        )
        self.merge = _blocks(config.merge_blocks, nn.Conv2d(width, width, 2))
        self.head = nn.Sequential(
            nn.Conv2d(width, width, 2), nn.ReLU(inplace=True), nn.Conv2d(width, 1, 2)
        )

    def forward(self, stacks: Tensor) -> Tensor:
        """Disparity of the centre view.

        Args:
            stacks: (B, S, N, H, W) gray views in 0..1; the S stacks in the order of
                `epinet.angular.STREAM_DIRECTIONS_DEG[S]`.

        Returns:
            (B, 1, H - 22, W - 22), pixels per adjacent view, float32.

        Raises:
            ValueError: the stacks do not fit the configuration or are too small.
        """
        cfg = self.config
        if stacks.ndim != 5 or stacks.shape[1:3] != (cfg.streams, cfg.views):
            raise ValueError(
                f"expected stacks of shape (B, {cfg.streams}, {cfg.views}, H, W), "
                f"got {tuple(stacks.shape)}"
            )
        if min(stacks.shape[-2:]) <= 2 * MARGIN_PX:
            raise ValueError(f"views must be larger than {2 * MARGIN_PX} px on each side")
        return self.disparity(self.features(stacks)[1])

    def features(self, stacks: Tensor) -> tuple[list[Tensor], Tensor]:
        """What the last layers of the streams and the last but one of the whole give.

        Returns:
            S tensors (B, width, H - 6, W - 6), and (B, S * width, H - 21, W - 21).
        """
        streams = [stream(stacks[:, i]) for i, stream in enumerate(self.streams)]
        x = torch.cat(streams, dim=1)  # (B, S * width, H - 6, W - 6)
        return streams, self.head[:-1](self.merge(x))

    def disparity(self, hidden: Tensor) -> Tensor:
        """The last layer: (B, 1, H - 22, W - 22) of the last but one's features."""
        out: Tensor = self.head[-1](hidden)
        return out.float()
