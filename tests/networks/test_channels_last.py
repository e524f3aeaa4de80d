"""Against torch's own operation, in both layouts."""

import pytest
import torch

from epinet.networks.channels_last import channels_first, pointwise, to_one


@pytest.fixture(params=[torch.contiguous_format, torch.channels_last])
def images(request):
    x = torch.rand(2, 7, 8, 12, generator=torch.Generator().manual_seed(6))
    return x.contiguous(memory_format=request.param)


def test_a_convolution_of_one_pixel_is_one(images):
    layer = torch.nn.Conv2d(7, 5, 1)
    with torch.no_grad():
        for parts in ([images], images.split([3, 1, 3], 1)):
            weights = layer.weight.split([part.shape[1] for part in parts], 1)
            found = pointwise(parts, weights, layer.bias)
            assert torch.allclose(found, layer(images), atol=1e-6)
            assert found.is_contiguous(memory_format=torch.channels_last)


def test_a_convolution_to_one_channel_is_one(images):
    layer = torch.nn.Conv2d(7, 1, 3, padding=1)
    with torch.no_grad():
        assert torch.allclose(to_one(layer, images), layer(images), atol=1e-6)


def test_channels_come_first_in_memory(images):
    found = channels_first(images)
    assert torch.equal(found, images)
    assert all(channel[0].is_contiguous() for channel in found.split(1, 1))
