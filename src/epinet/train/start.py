"""What a network begins a run with: the recipe's first weights and batch normalisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import torch

from epinet.errors import InputError
from epinet.model.checkpoint import Network, Weights, load_weights
from epinet.model.epinet import Epinet
from epinet.model.initialise import start_as_keras, start_on_differences, with_fewer_views
from epinet.model.normed import add_norms, calibrate_norms
from epinet.model.sweepnet import SweepNet
from epinet.train.batches import Batch
from epinet.train.recipe import DIFFERENCES, GLOROT, OWN, Recipe


def begin(net: Network, recipe: Recipe, batches: Callable[[int], Batch]) -> dict[str, Any] | None:
    """Give a new network the weights and norms that its recipe begins with.

    Args:
        net: changed in place.
        batches: of the run, by step; normalisation is set by the first.

    Returns:
        what the weights that it starts from say about themselves, if there are any.

    Raises:
        InputError: those weights cannot be read, or are of another network or input.
    """
    start = None
    if recipe.start == DIFFERENCES:
        start_on_differences(as_epinet(net))
    elif recipe.start == GLOROT:
        start_as_keras(as_epinet(net))
    elif recipe.start != OWN:
        start = load_weights(recipe.start)
        net.load_state_dict(_fitted(start, net).state_dict())
        if start.sees_local_contrast != recipe.local_contrast:
            raise InputError(
                f"{start.source}: weights that see {_input(start.sees_local_contrast)} are no "
                f"start for a recipe of {_input(recipe.local_contrast)}: "
                f"--set local_contrast={str(start.sees_local_contrast).lower()}"
            )
    if recipe.norms:
        add_norms(as_epinet(net))
        if not recipe.from_scratch:
            calibrate_norms(as_epinet(net), batches(0).stacks.cpu())
    return start.metadata if start else None


def mixed_with_start(net: SweepNet, recipe: Recipe) -> None:
    """Mix the weights that a run started from into what it has learned, by `start_share`."""
    start = _fitted(load_weights(recipe.start), net).state_dict()
    with torch.no_grad():
        for name, tensor in net.state_dict().items():
            tensor.lerp_(start[name].to(tensor), recipe.start_share)


def as_epinet(net: Network) -> Epinet:
    """The same network: what a recipe asks for here only EPINET has."""
    assert isinstance(net, Epinet)
    return net


def _input(local_contrast: bool) -> str:
    return "local contrast" if local_contrast else "plain gray"


def _fitted(start: Weights, net: Network) -> Network:
    """Trained weights for a network that sees as many views, or fewer."""
    theirs, ours = start.net, net
    if isinstance(theirs, Epinet) and isinstance(ours, Epinet):
        views = ours.config.views
        if replace(theirs.config, views=views) == ours.config:
            if theirs.config.views >= views:
                return with_fewer_views(theirs, views)
            raise InputError(
                f"{start.source}: weights of {theirs.config.views} views are no start for {views}; "
                "the other way round they are"
            )
    elif theirs.config == ours.config:
        return theirs
    raise InputError(f"{start.source}: weights of another network than the recipe's")
