"""The range of disparities is measured within tolerance, whatever its place and width."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from epinet.inspect import estimate_range
from epinet.inspect.sweep import SLACK_PX, Match, load_star, rough_range
from epinet.lightfield import LightField
from epinet.synth.generator import render_scene
from epinet.synth.options import Options

Renderer = Callable[..., LightField]

DISC, DISC_2 = (0.3, 0.35, 0.17), (0.7, 0.45, 0.17)


@pytest.mark.parametrize(
    ("disparities", "grid", "tolerance"),
    [
        ((-1.0, 0.1, 1.2), 9, 0.2),
        ((-3.0, -2.2, -1.5), 9, 0.2),
        ((0.1, 0.4, 0.8), 9, 0.2),
        ((-1.5, 0.0, 2.0), 3, 0.3),
    ],
)
def test_range_of_layers(
    disparities: tuple[float, float, float], grid: int, tolerance: float, render: Renderer
) -> None:
    far, middle, near = disparities
    lf = render({far: None, middle: DISC, near: DISC_2}, grid, noise=0.005)
    measured = estimate_range(lf)
    assert measured is not None and not measured.hits_limit
    assert (measured.min_px, measured.max_px) == pytest.approx((far, near), abs=tolerance)


def test_what_no_plane_explains_does_not_widen_the_search(render: Renderer) -> None:
    """A tenth of the pixels match planes anywhere nearly as well as their best one."""
    star = load_star(render({-1.0: None, 1.2: DISC}))
    g = torch.Generator().manual_seed(5)
    shape = star.centre.shape
    unexplained = torch.rand(shape, generator=g) < 0.1
    match = Match(
        cost=torch.where(unexplained, 0.012, 0.005),
        disparity=torch.where(unexplained, 60 * torch.rand(shape, generator=g) - 30, 0.5),
        usable=torch.ones(shape, dtype=torch.bool),
        chance_cost=torch.where(unexplained, 0.015, 0.05),
    )
    assert rough_range(star, match) == (0.5 - SLACK_PX, 0.5 + SLACK_PX)


def test_wide_baseline(render: Renderer) -> None:
    lf = render({-25: None, -8: DISC, 5: DISC_2}, grid=3, size=(200, 220))
    measured = estimate_range(lf)
    assert measured is not None and not measured.hits_limit
    assert (measured.min_px, measured.max_px) == pytest.approx((-25, 5), abs=0.5)


def test_end_of_the_search_is_reported(render: Renderer) -> None:
    """Where the views are too small to show more; larger ones are searched farther."""
    measured = estimate_range(render({31.9: None}, grid=3, size=(96, 150)))
    assert measured is not None and measured.hits_limit
    assert "wider" in str(measured)
    for disparity in (31.9, -40):
        found = estimate_range(render({disparity: None}, grid=3, size=(200, 200)))
        assert found is not None and not found.hits_limit
        assert (found.min_px, found.max_px) == pytest.approx((disparity, disparity), abs=0.5)


@pytest.mark.parametrize(
    ("far", "near", "noise"), [(-1, 45, 0.0), (-1, 45, 0.03), (-10, 62, 0.0), (-45, 5, 0.0)]
)
def test_a_part_beyond_the_search_widens_it_though_the_rest_matches_within(
    far: float, near: float, noise: float, render: Renderer
) -> None:
    """Be it near before a far background, or the background itself."""
    disc = (0.45, 0.4, 0.12) if near > 32 else (0.5, 0.4, 0.3)
    measured = estimate_range(render({far: None, near: disc}, 3, size=(230, 260), noise=noise))
    assert measured is not None and not measured.hits_limit and measured.search_px > 32
    assert (measured.min_px, measured.max_px) == pytest.approx((far, near), abs=0.6)


def test_what_matches_nowhere_does_not_widen_the_search(render: Renderer) -> None:
    """Wide occlusions, noise, and mirrors with highlights."""
    mirrors = Options(size=(140, 180), views=3, surfaces=(6, 8), reflective=1, highlights=1)
    for lf in (
        render({-25: None, 20: DISC}, grid=3, size=(200, 240)),
        render({-1: None, 1: DISC}, grid=3, size=(200, 240), contrast=0.03, noise=0.05),
        render_scene(mirrors, 5, 0, star_only=True),
    ):
        measured = estimate_range(lf)
        assert measured is not None and measured.search_px == 32


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_flat_gray_has_no_range(noise: float, render: Renderer) -> None:
    assert estimate_range(render({0.5: None}, grid=3, contrast=0, noise=noise)) is None


def test_images_larger_than_working_size_are_measured_in_their_own_pixels(render: Renderer) -> None:
    lf = render({-2: None, 3: DISC}, grid=3, size=(300, 400))
    big = lf.views.repeat(2, axis=2).repeat(2, axis=3)
    measured = estimate_range(LightField(np.ascontiguousarray(big)))
    assert measured is not None
    assert (measured.min_px, measured.max_px) == pytest.approx((-4, 6), abs=0.5)
