"""Starting weights for training."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor, nn

from epinet.model.epinet import Epinet, ViewConv


def start_on_differences(net: Epinet, gain: float = 10.0) -> None:
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


def start_as_keras(net: Epinet) -> None:
    """Keras' default, as in the reference: Glorot's uniform weights and no biases."""
    for module in net.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.xavier_uniform_(module.weight)
            assert module.bias is not None
            nn.init.zeros_(module.bias)


@torch.no_grad()
def with_fewer_views(net: Epinet, views: int) -> Epinet:
    """A network of `views` views per direction that starts from one of more.

    It gives what `net` would give if every view that it lacks were equal to the centre view: a
    start for training, not a result.
    """
    config = replace(net.config, views=views)
    smaller = Epinet(config)
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
