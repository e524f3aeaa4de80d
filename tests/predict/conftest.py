"""A small network of random weights: what surrounds the network does not depend on its weights."""

import pytest
import torch

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.start import start_on_differences
from epinet.networks.weights import Weights
from epinet.predict.estimator import Estimator


@pytest.fixture(scope="session")
def estimator() -> Estimator:
    torch.manual_seed(0)
    net = Epinet(EpinetConfig(views=5, stream_width=6)).eval()
    start_on_differences(net)
    torch.nn.init.kaiming_normal_(net.head[-1].weight)
    return Estimator(Weights(net, {"disparity_range_px": [-4, 4]}, "random", "0"), device="cpu")
