"""Starting weights for training."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from epinet.model.network import Epinet, ViewConv


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


@torch.no_grad()
def revive_head(net: Epinet, stacks: Tensor, least: float = 0.005) -> int:
    """Give units of the head's hidden layer that hardly ever fire another start.

    All inputs of that layer are positive and nothing normalises its sums, so large steps early in
    training can shut units for good, until a handful carries the whole map. A revived unit fires
    at half of the pixels and counts for nothing at first: the network's output stays.

    Args:
        stacks: (B, S, N, H, W) training input.
        least: units that fire at a smaller share of the pixels are revived.

    Returns:
        How many were revived.
    """
    hidden, last = net.head[0], net.head[2]
    assert isinstance(hidden, nn.Conv2d) and isinstance(last, nn.Conv2d)
    assert hidden.bias is not None
    was_training = net.training
    net.eval()
    features = net.merge(torch.cat([s(stacks[:, i]) for i, s in enumerate(net.streams)], dim=1))
    net.train(was_training)
    shut = (hidden(features) > 0).float().mean((0, 2, 3)) < least
    fresh = torch.empty_like(hidden.weight)
    nn.init.kaiming_normal_(fresh, nonlinearity="relu")
    hidden.weight[shut] = fresh[shut]
    hidden.bias[shut] = 0
    middle = hidden(features).transpose(0, 1).flatten(1).median(dim=1).values
    hidden.bias[shut] = -middle[shut]
    last.weight[:, shut] = 0
    return int(shut.sum())
