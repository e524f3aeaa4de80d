"""The bound on a disparity's precision, against least squares on many noisy views."""

import math

import pytest
import torch

from epinet.angular import star_positions
from epinet.inspect.information import WINDOW_PX, disparity_deviation


def wave(y, x):
    """Smooth texture, known between the pixels too."""
    return (0.05 * (0.7 * x + 0.2 * y).sin() + 0.03 * (0.5 * y - 0.3 * x + 1).cos())[None, None]


@pytest.mark.parametrize(("views", "sigma"), [(3, 0.004), (9, 0.004), (9, 0.02)])
def test_least_squares_reaches_the_bound_and_no_more(views, sigma):
    offsets = [(r - views // 2, c - views // 2) for r, c in star_positions(views)]
    side, tries = 31, 400
    g = torch.Generator().manual_seed(views)
    y, x = torch.meshgrid(*(torch.arange(float(side)),) * 2, indexing="ij")
    middle = slice(side // 2 - WINDOW_PX // 2, side // 2 + WINDOW_PX // 2 + 1)
    down = (wave(y + 1e-2, x) - wave(y - 1e-2, x)) / 2e-2
    across = (wave(y, x + 1e-2) - wave(y, x - 1e-2)) / 2e-2

    def photo() -> torch.Tensor:
        return wave(y, x) + sigma * torch.randn(tries, 1, side, side, generator=g)

    centre = photo()
    above = below = 0.0
    for row, col in offsets:
        if (row, col) == (0, 0):
            continue
        slope = (-(row * down + col * across))[..., middle, middle]
        difference = (photo() - centre)[..., middle, middle]
        above = above + (slope * difference).sum((-1, -2))
        below = below + (slope**2).sum()
    estimates = (above / below).flatten()  # the truth is 0
    noise = torch.full_like(centre, sigma)
    bound = disparity_deviation(centre, noise, offsets)[..., side // 2, side // 2]
    assert estimates.std().item() == pytest.approx(bound.median().item(), rel=0.2)


def test_noise_alone_tells_nothing():
    g = torch.Generator().manual_seed(0)
    noise = 0.01 * torch.randn(20, 1, 40, 40, generator=g)
    offsets = [(r - 4, c - 4) for r, c in star_positions(9)]
    told = disparity_deviation(noise, torch.full_like(noise, 0.01), offsets)
    assert told.median() > 0.03
    flat = disparity_deviation(torch.zeros(1, 1, 20, 20), torch.full((1, 1, 20, 20), 0.01), offsets)
    assert (flat == math.inf).all()
