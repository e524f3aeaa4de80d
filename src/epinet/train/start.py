"""What a network begins a run with: the recipe's first weights and batch normalisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import torch

from epinet.errors import InputError
from epinet.model.checkpoint import Network, Weights, load_weights
from epinet.model.epinet import Epinet
from epinet.model.initialise import (
    pass_on,
    start_as_keras,
    start_on_differences,
    widened,
    with_fewer_views,
)
from epinet.model.normed import add_norms, calibrate_norms
from epinet.model.sweepnet import SweepNet
from epinet.train.batches import Batch
from epinet.train.classes import add_classes
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
        net.load_state_dict(_fitted(start, net, recipe.seed).state_dict())
        if start.sees_local_contrast != recipe.local_contrast:
            raise InputError(
                f"{start.source}: weights that see {_input(start.sees_local_contrast)} are no "
                f"start for a recipe of {_input(recipe.local_contrast)}: "
                f"--set local_contrast={str(start.sees_local_contrast).lower()}"
            )
    attach(net, recipe)
    if recipe.identity:
        pass_on(as_epinet(net), recipe.identity)
    if recipe.norms and not recipe.from_scratch:
        calibrate_norms(as_epinet(net), batches(0).stacks.cpu())
    return start.metadata if start else None


def attach(net: Network, recipe: Recipe) -> None:
    """Give a network what its recipe trains it with and its weights are kept without."""
    if recipe.norms:
        add_norms(as_epinet(net))
    if recipe.class_weight:
        add_classes(as_epinet(net))


def mixed_with_start(net: SweepNet, recipe: Recipe) -> None:
    """Mix the weights that a run started from into what it has learned, by `start_share`."""
    start = _fitted(load_weights(recipe.start), net, recipe.seed).state_dict()
    with torch.no_grad():
        for name, tensor in net.state_dict().items():
            tensor.lerp_(start[name].to(tensor), recipe.start_share)


def as_epinet(net: Network) -> Epinet:
    """The same network: what a recipe asks for here only EPINET has."""
    assert isinstance(net, Epinet)
    return net


def _input(local_contrast: bool) -> str:
    return "local contrast" if local_contrast else "plain gray"


def _fitted(start: Weights, net: Network, seed: int) -> Network:
    """Trained weights for a network of as many views or fewer, as wide or wider."""
    theirs, ours = start.net, net
    if isinstance(theirs, Epinet) and isinstance(ours, Epinet):
        views, width = ours.config.views, ours.config.stream_width
        if replace(theirs.config, views=views, stream_width=width) == ours.config:
            if theirs.config.stream_width > width:
                raise InputError(
                    f"{start.source}: weights of a width of {theirs.config.stream_width} are no "
                    f"start for one of {width}; the other way round they are"
                )
            if theirs.config.views >= views:
                return widened(with_fewer_views(theirs, views), width, seed)
            raise InputError(
                f"{start.source}: weights of {theirs.config.views} views are no start for {views}; "
                "the other way round they are"
            )
    elif theirs.config == ours.config:
        return theirs
    raise InputError(f"{start.source}: weights of another network than the recipe's")
