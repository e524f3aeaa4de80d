"""Local contrast against its definition, and what it leaves unchanged."""

import numpy as np
import torch

from epinet.networks.contrast import DEVIATION, FLOOR, MEAN, WINDOW_PX, local_contrast


def test_equals_its_definition_in_plain_loops():
    views = torch.rand(2, 30, 33, generator=torch.Generator().manual_seed(0)) * 0.1
    actual = local_contrast(views).numpy()
    reach = WINDOW_PX // 2
    for v, row, col in ((0, 0, 0), (0, 15, 16), (1, 29, 32), (1, 3, 20)):
        image = views[v].double().numpy()
        window = image[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1]
        deviation = np.sqrt(window.var() + FLOOR**2)
        expected = MEAN + DEVIATION * (image[row, col] - window.mean()) / deviation
        np.testing.assert_allclose(actual[v, row, col], expected, atol=1e-3)


def test_brightness_does_not_count_and_contrast_hardly():
    views = torch.rand(3, 40, 40, generator=torch.Generator().manual_seed(1))
    seen = local_contrast(views)
    np.testing.assert_allclose(local_contrast(0.1 * views + 0.3), seen, atol=0.03)
    assert seen.std() > 0.1


def test_a_flat_view_stays_flat():
    assert torch.equal(local_contrast(torch.full((1, 30, 30), 0.25)), torch.full((1, 30, 30), MEAN))
