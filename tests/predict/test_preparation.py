"""What is measured of the views while they are prepared is what the network would measure."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from epinet.inspect.disparity_range import LONGER_SIDE_PX, range_match
from epinet.inspect.sweep import star_of_stacks
from epinet.lightfield import LightField
from epinet.predict.preparation import prepare


def plane(disparity_px: int, side: int = 96) -> LightField:
    """3x3 views of a textured plane."""
    texture = gaussian_filter(np.random.default_rng(0).normal(size=(200, 200, 1)), (1.5, 1.5, 0))
    texture = (0.5 + 0.12 * texture / texture.std()).clip(0, 1).astype(np.float32)
    places = [50 + disparity_px * k for k in (-1, 0, 1)]
    return LightField(
        np.array([[texture[r : r + side, c : c + side] for c in places] for r in places])
    )


@pytest.mark.parametrize("disparity_px", [2, -7])
def test_the_match_of_the_look_is_that_of_the_views_that_the_network_sees(disparity_px):
    views = prepare(plane(disparity_px), refine=False)
    assert views.is_matched
    star = star_of_stacks(torch.from_numpy(views.seen.stacks(3)), LONGER_SIDE_PX)
    measured = range_match(star.exposed_alike())
    assert views.match is not None and measured is not None
    assert torch.equal(views.match.disparity, measured.disparity)
    assert torch.equal(views.match.usable, measured.usable)
    assert views.match.search == measured.search


def test_views_that_are_compensated_are_matched_anew():
    lf = plane(2)
    dimmed = lf.views.copy()
    dimmed[0, 0] *= 0.8
    dimmed[2, 1] *= 0.8
    assert not prepare(replace(lf, views=dimmed), refine=True).is_matched
    assert prepare(lf, refine=True).is_matched
