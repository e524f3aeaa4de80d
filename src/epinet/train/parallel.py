"""Processes that train one network together, as `torchrun` starts them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import torch
import torch.distributed as dist
from torch import Tensor


@dataclass(frozen=True)
class Team:
    """This process among those of a run; alone unless `torchrun` started it."""

    rank: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process validates, logs and saves."""
        return self.rank == 0

    def add(self, tensors: Sequence[Tensor]) -> None:
        """Replace each tensor by its sum over the processes, in place and in one message."""
        self._exchange(tensors, dist.all_reduce)

    def share(self, tensors: Sequence[Tensor]) -> None:
        """Replace each tensor by that of the process that leads, in place and in one message."""
        self._exchange(tensors, partial(dist.broadcast, src=0))

    def _exchange(self, tensors: Sequence[Tensor], send: Callable[[Tensor], object]) -> None:
        if self.size == 1:
            return
        message = torch.cat([t.detach().flatten().float() for t in tensors])
        send(message)
        parts = torch.split(message, [t.numel() for t in tensors])
        with torch.no_grad():
            for tensor, part in zip(tensors, parts, strict=True):
                tensor.copy_(part.view_as(tensor))


ALONE = Team()


@contextmanager
def team(device: torch.device) -> Iterator[Team]:
    """The processes that `torchrun` started together with this one.

    They talk by NCCL on GPUs and by Gloo otherwise.
    """
    size = int(os.environ.get("WORLD_SIZE", "1"))
    if size == 1:
        yield ALONE
        return
    dist.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Team(dist.get_rank(), size)
    finally:
        dist.destroy_process_group()


def local_device(device: torch.device) -> torch.device:
    """The GPU of this process among those of its machine."""
    if device.type == "cuda" and device.index is None:
        return torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
    return device
