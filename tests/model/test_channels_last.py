"""Against torch's own operations, in both layouts."""

import pytest
import torch

from epinet.model.channels_last import pointwise, softmax


@pytest.fixture(params=[torch.contiguous_format, torch.channels_last])
def images(request):
    x = torch.rand(2, 7, 8, 12, generator=torch.Generator().manual_seed(6))
    return x.contiguous(memory_format=request.param)


def test_a_convolution_of_one_pixel_is_one(images):
    layer = torch.nn.Conv2d(7, 5, 1)
    with torch.no_grad():
        for parts in ([images], images.split([3, 1, 3], 1)):
            found = pointwise(parts, layer.weight, layer.bias)
            assert torch.allclose(found, layer(images), atol=1e-6)
            assert found.is_contiguous(memory_format=torch.channels_last)


def test_softmax_is_over_the_channels(images):
    assert torch.allclose(softmax(images), images.softmax(1), atol=1e-6)
