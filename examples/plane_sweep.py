"""A network of one's own: a plane sweep whose costs three convolutions judge.

It needs nothing of the package but what a network is (`epinet.networks.base`), and every command
takes it by its name:

    cd examples
    epinet train --recipe plane_sweep.yaml -o plane_sweep
    epinet predict SCENE -o out --model plane_sweep:PlaneSweep \\
        --weights plane_sweep/weights.safetensors
"""

from __future__ import annotations

from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
from torch import Tensor, nn

from epinet.angular import DIRECTIONS_DEG, direction_positions
from epinet.networks.base import Network, Settings
from epinet.shifts import sampled


@dataclass(frozen=True, config={"extra": "forbid"})
class PlaneSweepConfig:
    """Shape of the network; its bounds are those of weights files from elsewhere, too."""

    planes: Annotated[int, Field(ge=2, le=256)] = 24
    width: Annotated[int, Field(ge=1, le=256)] = 12


class PlaneSweep(Network[Settings]):
    """Scores disparities by how far the views, warped by each, differ from the centre view."""

    Config = PlaneSweepConfig
    floats_per_px = 300

    def __init__(self, config: PlaneSweepConfig = PlaneSweepConfig()) -> None:  # noqa: B008
        super().__init__()
        self.config = config
        self.score = nn.Sequential(
            nn.Conv2d(3, config.width, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(config.width, config.width, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(config.width, 1, 3, padding=1),
        )

    def estimate(self, stacks: Tensor, range_px: tuple[float, float]) -> tuple[Tensor, None]:
        """The mean (B, 1, H, W) over the planes by their scores, for views (B, 4, N, H, W)."""
        middle = stacks.shape[2] // 2
        moves = [
            (float(row - middle), float(col - middle))
            for direction in DIRECTIONS_DEG
            for row, col in direction_positions(direction, stacks.shape[2])
        ]
        views, centre = stacks.flatten(1, 2), stacks[:, :1, middle]
        planes = torch.linspace(*range_px, self.config.planes, device=stacks.device)
        scores = []
        for disparity in planes.tolist():
            warped = sampled(views, torch.full_like(centre, disparity), moves)
            nearest, _ = (warped - centre).abs().sort(1)  # an occluder hides half of the views
            half = nearest[:, : len(moves) // 2].mean(1, keepdim=True)
            seen = torch.cat([half, nearest.mean(1, keepdim=True), centre], 1)
            scores.append(self.score(20 * seen))
        share = torch.cat(scores, 1).softmax(1)
        return (share * planes.view(1, -1, 1, 1)).sum(1, keepdim=True), None
