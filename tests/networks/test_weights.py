"""Weights on disk."""

import json

import pytest
import torch

from epinet.errors import InputError
from epinet.networks.base import config_as_dict
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.inputs import GRAY
from epinet.networks.sweepnet import SweepNet
from epinet.networks.weights import load_weights, save_weights


def test_weights_come_back_in_half_precision_with_all_they_say(tmp_path):
    torch.manual_seed(0)
    net = Epinet(EpinetConfig(views=5, stream_width=6)).eval()
    save_weights(tmp_path / "w.safetensors", net, {"steps": 7, "disparity_range_px": [-1, 2]})
    weights = load_weights(tmp_path / "w.safetensors")
    assert [p.name for p in tmp_path.iterdir()] == ["w.safetensors"]
    assert weights.net.config == net.config
    assert weights.metadata["steps"] == 7
    assert weights.disparity_range_px == (-1, 2)
    assert weights.input is GRAY
    for name, tensor in net.state_dict().items():
        back = weights.net.state_dict()[name]
        assert back.dtype == tensor.dtype
        assert torch.allclose(back.float(), tensor.float(), rtol=1e-3, atol=1e-6)


def tampered(path, **changes):
    """A small file of weights with other texts, or tensors by their names."""
    from safetensors.torch import save

    net = Epinet(EpinetConfig(views=3, stream_width=2))
    texts = {"format": "epinet-1", "model": "epinet", "metadata": "{}"}
    texts["config"] = json.dumps(config_as_dict(net))
    tensors = dict(net.state_dict())
    for name, value in changes.items():
        if isinstance(value, torch.Tensor):
            tensors[name.replace("__", ".")] = value
        else:
            texts[name] = value
    path.write_bytes(save(tensors, metadata=texts))
    return path


def test_a_small_file_as_it_should_be_is_read(tmp_path):
    assert load_weights(tampered(tmp_path / "w.safetensors")).net.views == (3,)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"config": "[" * 5000}, "configuration: nested too deeply"),
        ({"config": '{"streams": 4, "views": 3, "stream_width": 1e9}'}, "stream_width: .*2048"),
        ({"config": '{"streams": "x", "views": 3}'}, "streams: .*integer"),
        ({"config": '{"streams": 4, "views": 3, "more": 1}'}, "more"),
        ({"config": '{"merge_blocks": 1000000}'}, "merge_blocks"),
        ({"config": '{"views": 3, "stream_width": 2048}'}, "tensor .* its configuration has"),
        ({"config": '{"views": 3, "stream_width": 2, "merge_blocks": 1}'}, "3 and 1 blocks"),
        ({"config": "[]"}, "configuration: .*dictionary"),
        ({"model": "sweepnet"}, "spacing_px|not known|configuration"),
        ({"model": "transformer"}, "'transformer', which is none of sweepnet, epinet"),
        ({"metadata": "[]"}, "metadata: .*dictionary"),
        ({"metadata": '{"disparity_range_px": [-1]}'}, "disparity_range_px"),
        ({"metadata": '{"disparity_range_px": [-1, 1e400]}'}, "disparity_range_px.1"),
        ({"metadata": '{"calibration": {"even_px": 0, "steepness": 2}}'}, "calibration.even_px"),
        ({"metadata": '{"calibration": 3}'}, "calibration: "),
        ({"metadata": '{"steps": "many"}'}, "steps: "),
        ({"head__2__bias": torch.tensor([float("nan")])}, r"head\.2\.bias holds .* not finite"),
        ({"head__2__bias": torch.zeros(2)}, r"head\.2\.bias' is \(2,\), .* has \(1,\)"),
        ({"spare": torch.zeros(2)}, "'spare' is .* none of that name"),
    ],
)
def test_what_weights_say_is_checked_before_they_are_used(tmp_path, changes, says):
    with pytest.raises(InputError, match=says) as refused:
        load_weights(tampered(tmp_path / "w.safetensors", **changes))
    assert all(p.startswith(str(tmp_path)) for p in refused.value.problems)


def test_a_sweep_without_end_is_refused(tmp_path):
    net = SweepNet()
    config = config_as_dict(net)
    for key, value in (("spacing_px", 1e-6), ("half", config["half"] | {"rounds": 10**6})):
        path = tmp_path / "w.safetensors"
        save_weights(path, net, {})
        data = path.read_bytes()
        old, new = (json.dumps(json.dumps(c)).encode() for c in (config, config | {key: value}))
        header = data[8 : 8 + int.from_bytes(data[:8], "little")]
        changed = header.replace(old, new)
        assert changed != header
        path.write_bytes(len(changed).to_bytes(8, "little") + changed + data[8 + len(header) :])
        with pytest.raises(InputError, match=key):
            load_weights(path)
