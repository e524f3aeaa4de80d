"""Pictures moved by parts of a pixel, against numpy pixel by pixel."""

import numpy as np
import pytest
import torch

from epinet.shifts import Margined

HEIGHT, WIDTH = 7, 10


@pytest.mark.parametrize("rows", [0.0, 0.25, -1.6, 3.0, 40.5])
@pytest.mark.parametrize("cols", [0.0, -0.25, 2.7, -4.0, -33.3])
def test_it_is_the_picture_so_much_further_on(rows, cols):
    """Beyond the picture, too, where its border repeats."""
    images = torch.rand(2, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(8))
    moved = Margined(images, max(abs(rows), abs(cols))).shifted(rows, cols)
    assert moved.shape == images.shape
    y, x = np.arange(HEIGHT) + rows, np.arange(WIDTH) + cols
    for image, found in zip(images.double().numpy(), moved.numpy(), strict=True):
        across = np.stack([np.interp(x, np.arange(WIDTH), row) for row in image])
        expected = np.stack([np.interp(y, np.arange(HEIGHT), col) for col in across.T], 1)
        assert found == pytest.approx(expected, abs=1e-5)
