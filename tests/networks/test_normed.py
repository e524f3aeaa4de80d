"""Norms for training: they fold away, and can be put into trained weights unnoticed."""

import copy

import torch
from torch import nn

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.normed import NormedConv, add_norms, calibrate_norms, without_norms

CONFIG = EpinetConfig(views=3, stream_width=4)


def trained(net: Epinet) -> Epinet:
    """With biases and statistics as training would leave them."""
    g = torch.Generator().manual_seed(0)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            for values, low in ((module.running_mean, -0.2), (module.running_var, 0.5)):
                values.copy_(low + torch.rand(values.shape, generator=g))
            nn.init.uniform_(module.weight, 0.5, 1.5, generator=g)
            nn.init.uniform_(module.bias, -0.3, 0.3, generator=g)
        elif isinstance(module, nn.Conv2d):
            nn.init.uniform_(module.bias, -0.1, 0.1, generator=g)
    return net.eval()


def test_folded_norms_leave_the_published_network():
    torch.manual_seed(1)
    net = Epinet(CONFIG)
    names = set(net.state_dict())
    add_norms(net)
    assert sum(isinstance(m, NormedConv) for m in net.modules()) == 4 * 3 + 7 + 1
    trained(net)
    plain = without_norms(net)
    assert set(plain.state_dict()) == names
    stacks = torch.rand(2, 4, 3, 30, 28)
    torch.testing.assert_close(plain(stacks), net(stacks), rtol=1e-3, atol=1e-5)


def test_every_hidden_unit_is_normalised():
    """In training, what enters each ReLU has mean 0 and deviation 1, whatever the weights."""
    torch.manual_seed(1)
    net = Epinet(CONFIG)
    with torch.no_grad():
        net.head[0].bias.sub_(100.0)
    add_norms(net)
    seen = []
    for module in net.modules():
        if isinstance(module, nn.ReLU):
            module.register_forward_pre_hook(lambda m, x: seen.append(x[0].detach().clone()))
    net.train()(torch.rand(2, 4, 3, 30, 28))
    assert len(seen) == 2 * (4 * 3 + 7) + 1
    for values in seen:
        assert values.mean((0, 2, 3)).abs().max() < 1e-3
        assert (values.var((0, 2, 3)) - 1).abs().max() < 0.35  # epsilon is .001


def test_norms_enter_trained_weights_unnoticed():
    torch.manual_seed(1)
    plain = trained(Epinet(CONFIG))
    stacks = torch.rand(2, 4, 3, 30, 28)
    normed = copy.deepcopy(plain)
    add_norms(normed)
    calibrate_norms(normed, stacks)
    torch.testing.assert_close(normed(stacks), plain(stacks), rtol=1e-3, atol=1e-5)
    torch.testing.assert_close(without_norms(normed)(stacks), plain(stacks), rtol=1e-3, atol=1e-5)
