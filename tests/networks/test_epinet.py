"""The network against the paper's numbers and an independent plain implementation."""

import numpy as np
import pytest
import torch

from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.start import start_as_keras, start_on_differences, with_fewer_views


def trainable(net: torch.nn.Module) -> int:
    return sum(p.numel() for p in net.parameters())


def randomised(config: EpinetConfig) -> Epinet:
    """Random weights and random batch-norm statistics."""
    torch.manual_seed(0)
    net = Epinet(config).eval()
    start_on_differences(net)  # Kaiming: the signal survives 22 layers
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            for tensor in (module.weight.data, module.running_var):
                tensor.uniform_(0.5, 1.5)
            for tensor in (module.bias.data, module.running_mean):
                tensor.normal_(std=0.1)
    return net


def test_published_parameter_count():
    net = Epinet()
    assert trainable(net) == 5_118_681
    statistics = [b for name, b in net.named_buffers() if "running" in name]
    assert sum(b.numel() for b in statistics) == 5_600


@pytest.mark.parametrize("views", [3, 5, 7, 9])
@pytest.mark.parametrize("streams", [1, 2, 4])
def test_table_1_compares_networks_of_equal_size(streams, views):
    config = EpinetConfig.of_equal_size(streams, views)
    assert trainable(Epinet(config)) == config.parameters
    assert config.parameters == pytest.approx(EpinetConfig(views=views).parameters, rel=0.02)
    out = Epinet(config).eval()(torch.zeros(1, streams, views, 24, 25))
    assert out.shape == (1, 1, 2, 3)


def test_layers_are_the_papers():
    """22 valid 2x2 convolutions of stride 1; 70 channels a stream, 280 merged."""
    convolutions = [m for m in Epinet().modules() if isinstance(m, torch.nn.Conv2d)]
    assert all(c.kernel_size == (2, 2) and c.stride == (1, 1) for c in convolutions)
    assert all(c.padding == (0, 0) and c.bias is not None for c in convolutions)
    stream = [(9, 70)] + 5 * [(70, 70)]
    merge = 15 * [(280, 280)] + [(280, 1)]
    assert [(c.in_channels, c.out_channels) for c in convolutions] == 4 * stream + merge


def test_receptive_field_is_23_pixels():
    net = randomised(EpinetConfig(views=3, stream_width=4))
    stacks = torch.rand(1, 4, 3, 31, 33, requires_grad=True)
    out = net(stacks)
    assert out.shape == (1, 1, 9, 11)
    out[0, 0, 4, 5].backward()
    assert stacks.grad is not None
    touched = stacks.grad.abs().sum((0, 1, 2)) > 0
    rows, cols = touched.any(1).nonzero()[:, 0], touched.any(0).nonzero()[:, 0]
    assert (rows.min(), rows.max()) == (4, 26)
    assert (cols.min(), cols.max()) == (5, 27)


def plain_forward(state: dict[str, np.ndarray], stacks: np.ndarray) -> np.ndarray:
    """EPINET from its description, with numpy loops over the taps; stacks (S, N, H, W)."""

    def conv(x: np.ndarray, name: str) -> np.ndarray:
        weight, bias = state[f"{name}.weight"], state[f"{name}.bias"]
        height, width = x.shape[1] - 1, x.shape[2] - 1
        out = np.broadcast_to(bias[:, None, None], (len(bias), height, width)).copy()
        for i in range(2):
            for j in range(2):
                window = x[:, i : i + height, j : j + width]
                out += np.einsum("oc,chw->ohw", weight[:, :, i, j], window)
        return out

    def norm(x: np.ndarray, name: str) -> np.ndarray:
        mean, variance = state[f"{name}.running_mean"], state[f"{name}.running_var"]
        scale = state[f"{name}.weight"] / np.sqrt(variance + 1e-3)
        return (x - mean[:, None, None]) * scale[:, None, None] + state[f"{name}.bias"][
            :, None, None
        ]

    def block(x: np.ndarray, name: str) -> np.ndarray:
        x = np.maximum(conv(x, f"{name}.0"), 0)
        return np.maximum(norm(conv(x, f"{name}.2"), f"{name}.3"), 0)

    streams = []
    for s, x in enumerate(stacks):
        for b in range(3):
            x = block(x, f"streams.{s}.{b}")
        streams.append(x)
    x = np.concatenate(streams)
    for b in range(7):
        x = block(x, f"merge.{b}")
    return conv(np.maximum(conv(x, "head.0"), 0), "head.2")


@pytest.mark.parametrize("streams", [1, 2, 4])
def test_forward_equals_a_plain_implementation(streams):
    net = randomised(EpinetConfig(streams=streams, views=5, stream_width=6)).double()
    stacks = torch.rand(streams, 5, 27, 26, generator=torch.Generator().manual_seed(1))
    state = {name: t.double().numpy() for name, t in net.state_dict().items()}
    expected = plain_forward(state, stacks.double().numpy())
    with torch.no_grad():
        actual = net.float()(stacks[None])[0].numpy()
    assert np.std(expected) > 1e-3
    np.testing.assert_allclose(actual, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())


def test_input_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"\(B, 4, 9, H, W\), got \(1, 4, 7, 32, 32\)"):
        Epinet()(torch.zeros(1, 4, 7, 32, 32))
    with pytest.raises(ValueError, match="larger than 22 px"):
        Epinet()(torch.zeros(1, 4, 9, 22, 32))
    with pytest.raises(ValueError, match="views must be one of"):
        EpinetConfig(views=4)


def test_training_starts_on_differences_between_views():
    """Views without parallax give the first layer no more than the centre view's slopes."""
    net = Epinet(EpinetConfig(views=5))
    start_on_differences(net)
    same = torch.rand(1, 1, 9, 9).expand(1, 5, 9, 9)
    parallax = torch.rand(1, 5, 9, 9)
    for stream in net.streams:
        first = stream[0][0]
        brighter = (first(same + 0.3) - first(same)).detach()
        np.testing.assert_allclose(brighter, 0, atol=1e-4)
        assert first(same).std() > 0.1
        assert first(parallax).std() > first(same).std()


def test_a_network_of_fewer_views_takes_the_missing_for_the_centre():
    torch.manual_seed(0)
    large = Epinet(EpinetConfig(views=9, stream_width=4)).eval()
    small = with_fewer_views(large, 5).eval()
    assert small.config == EpinetConfig(views=5, stream_width=4)
    stacks = torch.rand(1, 4, 5, 26, 26)
    filled = stacks[:, :, 2:3].repeat(1, 1, 9, 1, 1)
    filled[:, :, 2:7] = stacks
    torch.testing.assert_close(small(stacks), large(filled))


def test_keras_starting_weights():
    """Glorot: uniform within sqrt(6 / (inputs + outputs)), a kernel's pixels counted in both."""
    net = Epinet(EpinetConfig(views=3))
    start_as_keras(net)
    weight = net.merge[1][0].weight
    bound = (6 / (4 * (280 + 280))) ** 0.5
    assert 0.99 * bound < weight.abs().max() <= bound
    assert weight.std().item() == pytest.approx(bound / 3**0.5, rel=0.02)
    assert net.merge[1][0].bias.abs().max() == 0
