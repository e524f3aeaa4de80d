"""What a network begins a run with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from epinet.errors import InputError
from epinet.networks.base import Batch, Network
from epinet.networks.weights import Weights, load_weights
from epinet.train.recipe import Recipe


def begin(
    net: Network[Any], recipe: Recipe, batches: Callable[[int], Batch]
) -> dict[str, Any] | None:
    """Give a new network the weights that its recipe begins with, and what only training has.

    Args:
        net: changed in place.
        batches: of the run, by step.

    Returns:
        what the weights that it starts from say about themselves, if there are any.

    Raises:
        InputError: those weights cannot be read, or are of another network or input.
    """
    start = None if recipe.from_scratch else load_weights(recipe.start)
    if start is not None and start.input is not recipe.input:
        raise InputError(
            f"{start.source}: weights that see {start.input.name} are no start for a recipe whose "
            f"network sees {recipe.input.name}"
        )
    if start is None:
        net.begin(recipe, None, lambda: batches(0).stacks.cpu())
        return None
    net.begin(recipe, _fitted(start, net, recipe), lambda: batches(0).stacks.cpu())
    return start.metadata


def mixed_with_start(net: Network[Any], recipe: Recipe) -> None:
    """Mix the weights that a run started from into what it has learned, by `start_share`."""
    theirs = _fitted(load_weights(recipe.start), net, recipe).state_dict()
    with torch.no_grad():
        for name, tensor in net.state_dict().items():
            if tensor.is_floating_point():
                tensor.lerp_(theirs[name].to(tensor), recipe.start_share)


def _fitted(start: Weights, net: Network[Any], recipe: Recipe) -> Network[Any]:
    try:
        return net.fitted(start.net, recipe.seed)
    except ValueError as error:
        raise InputError(f"{start.source}: {error}") from error
