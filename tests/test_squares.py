"""Means and extremes of squares, against numpy and scipy pixel by pixel."""

import numpy as np
import pytest
import torch
from scipy.ndimage import maximum_filter, minimum_filter

from epinet.squares import box_mean, extremes

HEIGHT, WIDTH = 9, 13
SIDES = [1, 3, 5, 7, 9, 11, 13, 15, 25, 45]
"""Larger than the image, too."""


@pytest.fixture
def images():
    return torch.randn(2, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(5))


@pytest.mark.parametrize("side", SIDES)
def test_means_are_of_what_lies_inside(images, side):
    means = box_mean(images, side)
    reach = side // 2
    for *at, y, x in np.ndindex(*images.shape):
        rows = slice(max(0, y - reach), y + reach + 1)
        cols = slice(max(0, x - reach), x + reach + 1)
        expected = images[tuple(at)][rows, cols].double().mean().item()
        assert means[*at, y, x].item() == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("side", SIDES[:-3])
def test_extremes_are_those_of_the_square_around(images, side):
    greatest, least = extremes(images, side)
    for at in np.ndindex(2, 3):
        image = images[at].numpy()
        assert np.array_equal(greatest[at].numpy(), maximum_filter(image, side, mode="nearest"))
        assert np.array_equal(least[at].numpy(), minimum_filter(image, side, mode="nearest"))


def test_a_mean_passes_gradients_on_evenly():
    image = torch.zeros(1, 1, 7, 7, requires_grad=True)
    box_mean(image, 5)[0, 0, 3, 3].backward()
    assert image.grad is not None
    assert torch.allclose(image.grad[0, 0, 1:6, 1:6], torch.full((5, 5), 1 / 25))
    assert image.grad.sum().item() == pytest.approx(1)
