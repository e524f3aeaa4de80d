"""Batch normalisation of networks in training, and its statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import torch
from torch import nn

T = TypeVar("T")


def norms_of(net: nn.Module) -> list[nn.BatchNorm2d]:
    """The batch normalisations of a network."""
    return [m for m in net.modules() if isinstance(m, nn.BatchNorm2d)]


@torch.no_grad()
def take_statistics(
    net: nn.Module,
    run: Callable[[T], object],
    batches: Iterable[T],
    momentum: float | None = None,
) -> None:
    """Give the norms statistics of other batches, and leave the network in training mode.

    Args:
        run: puts a batch through the network.
        batches: of training.
        momentum: of the average over the batches; None takes their plain mean.
    """
    for norm in norms_of(net):
        norm.reset_running_stats()
        norm.momentum = momentum
    net.train()
    for batch in batches:
        run(batch)
