"""Exposures and vignetting that differ from view to view are found and undone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from epinet.angular import star_positions
from epinet.inspect.disparity_range import LONGER_SIDE_PX, range_match
from epinet.inspect.gains import estimate_gains, even
from epinet.inspect.sweep import Match, Star, load_star, star_of_stacks
from epinet.lightfield import LightField

Renderer = Callable[..., LightField]
LAYERS = {-0.6: None, 0.25: (0.3, 0.5, 0.2), 0.75: (0.65, 0.4, 0.2)}


def field(gain: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """What a view is multiplied by, (H, W)."""
    y, x = (np.linspace(-1 + 1 / side, 1 - 1 / side, side) for side in size)
    return 1 + gain[0] + gain[1] * x + gain[2] * y[:, None]


def disturbed(lf: LightField, gains: dict[tuple[int, int], NDArray[np.float64]]) -> LightField:
    """gains: of views by (row, column)."""
    views = lf.views.copy()
    for place, gain in gains.items():
        views[place] *= field(gain, lf.size)[..., None].astype(np.float32)
    return LightField(views)


def drawn(views: int) -> dict[tuple[int, int], NDArray[np.float64]]:
    """Up to .05, of all but the centre view of a star."""
    rng, half = np.random.default_rng(views), views // 2
    return {p: rng.uniform(-0.05, 0.05, 3) for p in star_positions(views) if p != (half, half)}


def looked_at(lf: LightField) -> tuple[torch.Tensor, Star, Match]:
    """Stacks, and as `predict` sees them: their star and its match."""
    stacks = torch.from_numpy(lf.stacks(lf.grid[0]))
    star = star_of_stacks(stacks, LONGER_SIDE_PX)
    match = range_match(star.exposed_alike())
    assert match is not None
    return stacks, star, match


@pytest.mark.parametrize("is_wrong", [False, True])
@pytest.mark.parametrize("views", [3, 5, 9])
def test_gains_are_found_and_undone(views: int, is_wrong: bool, render: Renderer) -> None:
    """Though another part of the match is wrong."""
    clean = render(LAYERS, views)
    true, half = drawn(views), views // 2
    stacks, star, match = looked_at(disturbed(clean, true))
    if is_wrong:
        disparity = match.disparity.clone()
        disparity[:40, :40] -= 1.5
        match = replace(match, disparity=disparity)
    gains = estimate_gains(star, match)
    wanted = np.stack([true[half + row, half + col] for row, col in star.offsets])
    assert np.abs(gains.numpy() - wanted).mean() < 0.15 * np.abs(wanted).mean()
    given = stacks.clone()
    even(stacks, gains)
    right = torch.from_numpy(clean.stacks(views))
    assert torch.equal(stacks[:, half], right[:, half])
    assert (stacks - right).square().mean() < 0.02 * (given - right).square().mean()


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_views_exposed_alike_stay_as_they_are(noise: float, render: Renderer) -> None:
    """To the last bit, though the match is coarse."""
    stacks, star, match = looked_at(render(LAYERS, size=(250, 230), noise=noise))
    given = stacks.clone()
    even(stacks, estimate_gains(star, match))
    assert torch.equal(stacks, given)


def test_gains_are_as_exact_where_a_training_run_rounds(render: Renderer) -> None:
    _, star, match = looked_at(disturbed(render(LAYERS, 5), drawn(5)))
    with torch.autocast("cpu", torch.bfloat16):
        rounded = estimate_gains(star, match)
    assert torch.equal(rounded, estimate_gains(star, match))


@pytest.mark.parametrize("size", [(96, 112), (250, 230)])
def test_the_star_of_stacks_is_that_of_their_light_field(
    size: tuple[int, int], render: Renderer
) -> None:
    lf = render(LAYERS, 5, size)
    made = star_of_stacks(torch.from_numpy(lf.stacks(5)), LONGER_SIDE_PX).exposed_alike()
    wanted = load_star(lf, LONGER_SIDE_PX)
    assert made.scale == wanted.scale and torch.equal(made.centre, wanted.centre)
    views = dict(zip(wanted.offsets, wanted.views, strict=True))
    assert sorted(made.offsets) == sorted(wanted.offsets)
    for offset, view in zip(made.offsets, made.views, strict=True):
        assert torch.allclose(view, views[offset], atol=1e-6)
