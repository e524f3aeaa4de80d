"""Where the rays of a pixel go."""

import pytest
import torch

from epinet.synth.render import _lens_points, _pixel_points


@pytest.mark.parametrize("count", [1, 2, 4, 9, 16])
def test_the_rays_of_a_pixel_see_it_from_its_middle(count):
    """Truth is that of the pixel's and the lens's centre."""
    points = torch.tensor(_pixel_points(count))
    assert points.mean(0).abs().max() < 1e-6
    assert points.abs().max() <= 0.5
    lens = _lens_points(count)
    assert lens.mean(0).abs().max() < 1e-6
    assert lens.norm(dim=1).max() < 1.2


@pytest.mark.parametrize("count", [4, 9, 16])
def test_the_rays_of_a_pixel_fill_it(count):
    """Along x there is one in each strip; along y no strip of two such is empty."""
    y, x = torch.tensor(_pixel_points(count)).T
    assert ((x + 0.5) * count).floor().tolist() == list(range(count))
    gaps = torch.cat([torch.tensor([-0.5]), y.sort().values, torch.tensor([0.5])]).diff()
    assert gaps.max() < 2.1 / count
