"""Starting weights for training."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import torch
from torch import Tensor, nn

from epinet.networks.epinet.layers import Layers, ViewConv

L = TypeVar("L", bound=Layers)


def start_on_differences(net: Layers, gain: float = 10.0) -> None:
    """He initialisation, the first layers looking at differences to the centre view.

    The first layer of a stream computes sum_i w_i v_i over its views v_i. Taking the sum of the
    others' weights off the centre's turns that into w_c v_c + sum_i w_i (v_i - v_c): parallax
    beside the centre's own texture, of which only the slope is kept (its four taps sum to
    zero), since disparity shows in neither brightness. Both are small, hence the `gain`. Only
    the starting point changes; the network is the paper's.
    """
    for module in net.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
            assert module.bias is not None
            nn.init.zeros_(module.bias)
    with torch.no_grad():
        for module in net.modules():
            if isinstance(module, ViewConv):
                _look_at_differences(module.weight, gain)
            elif isinstance(module, nn.Conv2d) and module.out_channels == 1:
                module.weight.mul_(0.1)


def _look_at_differences(weight: Tensor, gain: float) -> None:
    """Change weights (width, views, 2, 2) in place."""
    middle = weight.shape[1] // 2
    centre = weight[:, middle].clone()
    slope = centre - centre.mean((1, 2), keepdim=True)
    weight[:, middle] = slope - (weight.sum(dim=1) - centre)
    weight.mul_(gain)


OPEN = 0.5
"""Biases of the norms behind layers that pass their input on, so that little is cut off at 0."""


@torch.no_grad()
def pass_on(net: Layers, share: float) -> None:
    """Let every hidden layer begin with a share of the identity beside its random weights.

    22 convolutions without a shortcut garble what the first ones find. Here each convolution of as
    many inputs as outputs gets `share` at one tap of each channel's own weights, upper left and
    lower right in turn, so that the picture stays in place, and its random part is scaled so that
    the variance stays. (Zagoruyko and Komodakis, 2017, "DiracNets", have such a start; the
    identity branch of RepVGG, Ding et al., CVPR 2021, folds into a convolution in the same way.)

    Args:
        net: of random weights; its norms, if it has any, get biases of `OPEN`.
        share: 0..1 of the identity.
    """
    paths = [(0, stream) for stream in net.streams]  # 5 hidden convolutions each: 3 taps of 0
    for first, part in (*paths, (1, nn.ModuleList([net.merge, net.head]))):
        for k, conv in enumerate(_hidden_convolutions(part)):
            tap = (first + k) % 2
            conv.weight.mul_((1 - share**2) ** 0.5)
            conv.weight[:, :, tap, tap].diagonal().add_(share)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.constant_(module.bias, OPEN)


def _hidden_convolutions(part: nn.Module) -> list[nn.Conv2d]:
    """Those with as many outputs as inputs, in the order of the layers."""
    convolutions = [m for m in part.modules() if isinstance(m, nn.Conv2d)]
    return [c for c in convolutions if c.in_channels == c.out_channels]


def start_as_keras(net: Layers) -> None:
    """Keras' default, as in the reference: Glorot's uniform weights and no biases."""
    for module in net.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.xavier_uniform_(module.weight)
            assert module.bias is not None
            nn.init.zeros_(module.bias)


@torch.no_grad()
def with_fewer_views(net: L, views: int) -> L:
    """A network of `views` views per direction that starts from one of more.

    It gives what `net` would give if every view that it lacks were equal to the centre view: a
    start for training, not a result.
    """
    config = replace(net.config, views=views)
    smaller = type(net)(config)
    state = net.state_dict()
    gone = (net.config.views - views) // 2
    for name, module in net.named_modules():
        if isinstance(module, ViewConv):
            weight = module.weight
            kept = weight[:, gone : gone + views].clone()
            kept[:, views // 2] += weight.sum(1) - kept.sum(1)
            state[f"{name}.weight"] = kept
    smaller.load_state_dict(state)
    return smaller


@torch.no_grad()
def widened(net: L, width: int, seed: int) -> L:
    """A wider network that gives what `net` gives (Chen et al., ICLR 2016, "Net2Net").

    Units are copied in turn until there are enough, and each weight of the next layer is shared
    out at random among the copies of the unit that it reads, so that they can part in training.

    Args:
        net: without norms of training, see `epinet.networks.epinet.normed`.
        width: of a stream; no less than the net's.
        seed: of the shares.
    """
    if width == net.config.stream_width:
        return net
    g = torch.Generator().manual_seed(seed)
    old, config = net.config.stream_width, replace(net.config, stream_width=width)
    of_stream = torch.arange(width) % old
    of_merge = torch.cat([of_stream + old * s for s in range(config.streams)])
    wider = type(net)(config)
    state = net.state_dict()
    for name, module in wider.named_modules():
        if isinstance(module, nn.Conv2d) and not isinstance(module, ViewConv):
            sources = of_stream if module.in_channels == width else of_merge
            state[f"{name}.weight"] = _shared_out(state[f"{name}.weight"], sources, g)
        if isinstance(module, nn.Conv2d | nn.BatchNorm2d):
            outputs = state[f"{name}.bias"].numel()
            if outputs > 1:
                sources = of_stream if outputs == old else of_merge
                for key in module.state_dict():
                    if state[f"{name}.{key}"].ndim:
                        state[f"{name}.{key}"] = state[f"{name}.{key}"][sources]
    wider.load_state_dict(state)
    return wider


def _shared_out(weight: Tensor, sources: Tensor, g: torch.Generator) -> Tensor:
    """Weights (outputs, units, 2, 2) of copies of units, which sum to those of the units."""
    shares = torch.rand(len(weight), len(sources), *weight.shape[2:], generator=g) + 0.5
    sums = torch.zeros_like(weight).index_add_(1, sources, shares)
    return weight[:, sources] * shares / sums[:, sources]
