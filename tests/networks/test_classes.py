"""Classification beside EPINET's map: its loss by definition, and that it leaves no trace."""

import math

import numpy as np
import pytest
import torch

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.classes import (
    CLASSES,
    DEVIATION_PX,
    LIMIT_PX,
    STREAMS,
    add_classes,
    classes_of,
    remove_classes,
)

CONFIG = EpinetConfig(views=3, stream_width=4)


@pytest.fixture
def net() -> Epinet:
    torch.manual_seed(2)
    net = Epinet(CONFIG).eval()
    add_classes(net)
    return net


def test_the_targets_are_a_gaussian_about_the_disparity(net):
    disparity = torch.tensor([-9.0, -1.23, 0.0, 0.07, 4.2, 30.0]).view(1, 1, 2, 3)
    wanted = classes_of(net).wanted(disparity)[0]
    centres = np.linspace(-LIMIT_PX, LIMIT_PX, CLASSES)
    for y, x in np.ndindex(2, 3):
        d = min(max(disparity[0, 0, y, x].item(), -LIMIT_PX), LIMIT_PX)
        by_hand = np.exp(-0.5 * ((centres - d) / DEVIATION_PX) ** 2)
        np.testing.assert_allclose(wanted[:, y, x], by_hand / by_hand.sum(), atol=1e-6)
    inside = (wanted * torch.tensor(centres).view(-1, 1, 1)).sum(0)[0, 1:]
    torch.testing.assert_close(inside.float(), disparity[0, 0, 0, 1:], atol=1e-3, rtol=0)


def test_the_loss_is_the_mean_of_the_streams_beside_the_last(net):
    """Pixel by pixel, each classifier applied to the window of views around the map's pixel."""
    stacks = torch.rand(1, 4, 3, 26, 27)
    disparity = torch.rand(1, 1, 4, 5)
    classes = classes_of(net)
    streams, hidden = net.features(stacks)
    loss = classes.cross_entropy(streams, hidden, disparity)
    assert loss.shape == disparity.shape
    for y, x in ((0, 0), (3, 4), (1, 2)):
        window = stacks[..., y : y + 23, x : x + 23]
        of_window, before_last = net.features(window)
        wanted = classes.wanted(disparity)[0, :, y, x]
        scores = [(1.0, classes.last(before_last)[0, :, 0, 0])] + [
            (STREAMS / 4, classifier(features)[0, :, 8, 8])  # the middle of 17x17
            for classifier, features in zip(classes.streams, of_window, strict=True)
        ]
        by_hand = sum(
            share * -(wanted * (s - math.log(s.exp().sum().item()))).sum().item()
            for share, s in scores
        )
        assert loss[0, 0, y, x].item() == pytest.approx(by_hand, rel=1e-4)


def test_removed_classes_leave_the_published_network(net):
    names = set(Epinet(CONFIG).state_dict())
    before = net(torch.ones(1, 4, 3, 30, 30))
    assert set(net.state_dict()) > names
    remove_classes(net)
    assert set(net.state_dict()) == names
    assert torch.equal(net(torch.ones(1, 4, 3, 30, 30)), before)
    remove_classes(net)  # again: nothing to do
