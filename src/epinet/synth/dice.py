"""Random numbers: drawn on the CPU, so that every device gets the same, handed out on one."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

CPU = torch.device("cpu")


@dataclass(frozen=True)
class Dice:
    """Random numbers of a given shape, all from one CPU generator."""

    g: Generator
    device: torch.device = CPU

    def uniform(self, low: float | Tensor, high: float | Tensor, *shape: int) -> Tensor:
        """Uniform numbers."""
        return (low + (high - low) * torch.rand(*shape, generator=self.g)).to(self.device)

    def log_uniform(self, low: float | Tensor, high: float | Tensor, *shape: int) -> Tensor:
        """Numbers uniform in their logarithm."""
        low, high = torch.as_tensor(low).log(), torch.as_tensor(high).log()
        return self.uniform(low, high, *shape).exp()

    def normal(self, *shape: int) -> Tensor:
        """Gaussian numbers of mean 0 and deviation 1."""
        return torch.randn(*shape, generator=self.g).to(self.device)

    def integers(self, low: int, high: int, *shape: int) -> Tensor:
        """Integers from `low` to `high`, both included."""
        return torch.randint(low, max(low, high) + 1, shape, generator=self.g).to(self.device)

    def chance(self, share: float, *shape: int) -> Tensor:
        """Booleans that hold with a probability."""
        return self.uniform(0, 1, *shape) < share

    def rotations(self, *shape: int) -> Tensor:
        """(*shape, 3, 3) rotations, all equally likely."""
        q = F.normalize(self.normal(*shape, 4), dim=-1)
        w, x, y, z = q.unbind(-1)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return torch.stack([torch.stack(row, -1) for row in rows], -2)

    def each(self, n: int, low: float, high: float) -> Tensor:
        """(n, 1, 1) uniform numbers: one for each tile."""
        return self.uniform(low, high, n, 1, 1)

    def each_log(self, n: int, low: float, high: float) -> Tensor:
        """(n, 1, 1) numbers uniform in their logarithm."""
        return self.log_uniform(low, high, n, 1, 1)

    def each_count(self, n: int, low: int, high: int) -> Tensor:
        """(n, 1, 1) integers, small ones more often: uniform in their logarithm."""
        return self.each_log(n, low, max(low, high) + 0.999).floor().long()

    def each_chance(self, n: int, share: float) -> Tensor:
        """(n, 1, 1) booleans that hold with a probability."""
        return self.chance(share, n, 1, 1)
