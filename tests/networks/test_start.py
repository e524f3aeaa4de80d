"""Starting weights: what passes through them, and what growing leaves alone."""

import pytest
import torch
from torch import nn

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.layers import MARGIN_PX
from epinet.networks.epinet.normed import add_norms, without_norms
from epinet.networks.epinet.start import OPEN, pass_on, start_on_differences, widened

CONFIG = EpinetConfig(views=3, stream_width=4)


def started(config: EpinetConfig = CONFIG) -> Epinet:
    torch.manual_seed(1)
    net = Epinet(config)
    start_on_differences(net)
    return net


def randomised(net: Epinet) -> Epinet:
    """With biases and statistics as training would leave them."""
    g = torch.Generator().manual_seed(0)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.running_mean, -0.2, 0.2, generator=g)
            nn.init.uniform_(module.running_var, 0.5, 1.5, generator=g)
            nn.init.uniform_(module.weight, 0.5, 1.5, generator=g)
        if isinstance(module, nn.BatchNorm2d | nn.Conv2d):
            nn.init.uniform_(module.bias, -0.3, 0.3, generator=g)
    return net.eval()


def test_the_whole_identity_passes_a_picture_through_in_place():
    """A share of all but 1: what the first layers find stands before the last, pixel by pixel."""
    net = started().eval()
    pass_on(net, 1.0)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.eps = 0.0
            nn.init.zeros_(module.bias)
    stacks = torch.rand(2, 4, 3, 40, 38)
    found = [stream[0][0](stacks[:, i]).relu() for i, stream in enumerate(net.streams)]
    streams, hidden = net.features(stacks)
    # The first layer looks at pixels p and p + 1, a stream's output at p..p + 6 and the last but
    # one layer's at p..p + 21: all are centred alike but for half a pixel.
    for features, first in zip(streams, found, strict=True):
        torch.testing.assert_close(features, first[..., 2:-3, 2:-3])
    torch.testing.assert_close(hidden, torch.cat(found, 1)[..., 10:-10, 10:-10])
    assert net.disparity(hidden).shape[-2:] == (40 - 2 * MARGIN_PX, 38 - 2 * MARGIN_PX)


def test_a_share_of_the_identity_lies_at_one_tap_of_each_hidden_layer():
    """The rest is the random part, smaller by sqrt(1 - share^2)."""
    net, plain = started(), started()
    pass_on(net, 0.6)
    for one, other in zip(net.parameters(), plain.parameters(), strict=True):
        if one.ndim == 4 and one.shape[0] == one.shape[1]:
            added = (one - 0.8 * other).detach()
            eye = 0.6 * torch.eye(len(one))
            taps = [torch.allclose(added[:, :, tap, tap], eye, atol=1e-6) for tap in (0, 1)]
            assert sum(taps) == 1
            assert added.abs().sum().item() == pytest.approx(0.6 * len(one), rel=1e-4)
        elif one.ndim == 4:
            assert torch.equal(one, other)


def test_norms_begin_open():
    net = started()
    add_norms(net)
    pass_on(net, 0.7)
    norms = [m for m in net.modules() if isinstance(m, nn.BatchNorm2d)]
    assert len(norms) == 2 * (4 * 3 + 7) + 1
    assert all((norm.bias == OPEN).all() for norm in norms)
    folded = without_norms(net.eval())
    stacks = torch.rand(1, 4, 3, 30, 30)
    torch.testing.assert_close(folded(stacks), net(stacks), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("streams", [1, 2, 4])
@pytest.mark.parametrize("width", [4, 5, 8, 11])
def test_a_wider_network_gives_the_same_map(streams, width):
    net = randomised(started(EpinetConfig(streams, views=3, stream_width=4)))
    wider = widened(net, width, seed=3).eval()
    assert wider.config.stream_width == width
    stacks = torch.rand(2, streams, 3, 30, 28)
    torch.testing.assert_close(wider(stacks), net(stacks), rtol=1e-4, atol=1e-5)


def test_copies_of_a_unit_can_part():
    """They are read by different weights, so that their gradients differ."""
    net = widened(randomised(started()), 8, seed=3).train()
    net(torch.rand(2, 4, 3, 30, 28)).abs().mean().backward()
    gradient = net.merge[3][0].weight.grad
    one, other = gradient[:4], gradient[4:8]
    assert (one - other).abs().max() > 0.05 * one.abs().max()
