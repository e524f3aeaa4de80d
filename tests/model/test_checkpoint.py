"""Weights on disk."""

import torch

from epinet.model.checkpoint import load_weights, save_weights
from epinet.model.epinet import Epinet, EpinetConfig


def test_weights_come_back_in_half_precision_with_all_they_say(tmp_path):
    torch.manual_seed(0)
    net = Epinet(EpinetConfig(views=5, stream_width=6)).eval()
    save_weights(tmp_path / "w.safetensors", net, {"steps": 7, "disparity_range_px": [-1, 2]})
    weights = load_weights(tmp_path / "w.safetensors")
    assert [p.name for p in tmp_path.iterdir()] == ["w.safetensors"]
    assert weights.net.config == net.config
    assert weights.metadata["steps"] == 7
    assert weights.disparity_range_px == (-1, 2)
    assert not weights.sees_local_contrast
    for name, tensor in net.state_dict().items():
        back = weights.net.state_dict()[name]
        assert back.dtype == tensor.dtype
        assert torch.allclose(back.float(), tensor.float(), rtol=1e-3, atol=1e-6)
