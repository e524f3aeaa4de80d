"""Optimisers against their definitions in plain numpy."""

import numpy as np
import pytest
import torch

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.train.optimisers import Muon, Optimisers, orthogonalised
from epinet.train.recipe import Recipe


@pytest.mark.parametrize("shape", [(20, 20), (12, 48), (48, 12)])
def test_orthogonalised_is_the_polar_factor(shape):
    """Against singular vectors: the same ones, with all values near 1."""
    g = torch.Generator().manual_seed(0)
    matrix = torch.randn(shape, generator=g)
    u, _, vh = np.linalg.svd(matrix.numpy(), full_matrices=False)
    values = np.linalg.svd(orthogonalised(matrix).numpy(), compute_uv=False)
    assert values.min() > 0.5
    assert values.max() < 1.3
    polar, found = u @ vh, orthogonalised(matrix).numpy()
    cosine = (polar * found).sum() / np.linalg.norm(polar) / np.linalg.norm(found)
    assert cosine > 0.97


def test_muon_moves_no_direction_of_a_layer_more_than_others():
    """A gradient dominated by one direction: Muon's step is not."""
    weight = torch.zeros(8, 2, 2, 2, requires_grad=True)
    g = torch.Generator().manual_seed(0)
    weight.grad = torch.randn(8, 2, 2, 2, generator=g) + 30
    Muon([weight], lr=1.0).step()
    step = weight.detach().flatten(1).numpy()
    values = np.linalg.svd(step, compute_uv=False)
    assert values[0] < 3 * values[-1]
    assert np.sqrt((step**2).mean()) == pytest.approx(0.2, rel=0.3)


def test_weight_decay_shrinks():
    weight = torch.ones(4, 4, requires_grad=True)
    weight.grad = torch.zeros(4, 4)
    Muon([weight], lr=0.1, weight_decay=0.5).step()
    assert torch.allclose(weight, torch.full((4, 4), 0.95))


def test_rmsprop_is_that_of_keras():
    """Keras: v = .9 v + .1 g^2, p -= lr g / (sqrt(v) + 1e-7)."""
    net = Epinet(EpinetConfig(views=3, stream_width=2))
    optimisers = Optimisers(net, Recipe.of({"views": 3}))
    parameter = net.head[2].weight
    expected, v = parameter.detach().numpy().copy(), 0.0
    for k in range(3):
        for p in net.parameters():
            p.grad = torch.full_like(p, 0.5 + k)
        gradient = 0.5 + k
        v = 0.9 * v + 0.1 * gradient**2
        expected = expected - 1e-3 * gradient / (np.sqrt(v) + 1e-7)
        optimisers.step(1e-3)
    assert np.allclose(parameter.detach().numpy(), expected, atol=1e-6)


def test_muon_takes_the_hidden_layers_and_adam_the_rest():
    net = Epinet(EpinetConfig(views=3, stream_width=2))
    hidden = net.hidden_weights()
    assert len(hidden) == 4 * 5 + 14 + 1  # of 22 layers, four times the first six
    optimisers = Optimisers(net, Recipe.of({"views": 3, "optimiser": "muon"}))
    counts = [sum(len(g["params"]) for g in o.param_groups) for o, _ in optimisers.parts]
    assert counts == [len(hidden), len(list(net.parameters())) - len(hidden)]
