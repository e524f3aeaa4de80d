"""Misalignment is told from disparity, and not seen where there is none."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from epinet.angular import star_positions
from epinet.inspect.alignment import _exposures, _shift_step, estimate_alignment
from epinet.io import read_light_field
from epinet.lightfield import LightField

Renderer = Callable[..., LightField]


@pytest.mark.parametrize("views", [9, 3])
def test_shifts_are_exact_whatever_the_disparities_and_but_for_the_focus(views: int) -> None:
    """Linear views: differences follow from shifts and errors of disparity exactly."""
    g = torch.Generator().manual_seed(views)
    half = views // 2
    offsets = [(r - half, c - half) for r, c in star_positions(views) if (r, c) != (half, half)]
    places = torch.tensor(offsets, dtype=torch.float32)
    shifts = 0.3 * torch.randn(len(places), 2, generator=g)
    shifts -= (shifts * places).sum() / places.square().sum() * places
    gradient = torch.randn(2, 900, generator=g)
    disparity_error, focus = 0.5 * torch.randn(900, generator=g), 0.2
    moves = shifts + focus * places
    difference = -moves @ gradient + (places @ gradient) * disparity_error
    found = _shift_step(difference, gradient, places)
    torch.testing.assert_close(found, shifts, atol=1e-4, rtol=0)


def test_of_stripes_only_what_they_show_is_told() -> None:
    """Vertical edges show no vertical shift; it is left at 0, not invented."""
    places = torch.tensor([(0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0)])
    gradient = torch.stack([torch.zeros(50), torch.linspace(-1, 1, 50)])
    shifts = torch.tensor([(0.2, 0.0), (-0.1, 0.0), (0.0, 0.3), (0.3, -0.1)])
    found = _shift_step(-shifts @ gradient, gradient, places)
    torch.testing.assert_close(found[:, 0], torch.zeros(4), atol=1e-6, rtol=0)
    torch.testing.assert_close(found[2:, 1], shifts[2:, 1], atol=1e-5, rtol=0)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_views_in_their_places_are_found_there(noise: float, render: Renderer) -> None:
    lf = render({-0.6: None, 0.25: (0.3, 0.5, 0.2), 0.75: (0.65, 0.4, 0.2)}, 5, noise=noise)
    found = estimate_alignment(lf)
    assert found is not None
    assert not found.is_misaligned and not found.is_uneven
    assert np.abs(found.shifts_px).max() < 0.05
    np.testing.assert_allclose(found.gains, 1, atol=0.02)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_flat_gray_tells_nothing(noise: float, render: Renderer) -> None:
    assert estimate_alignment(render({0.5: None}, 3, contrast=0, noise=noise)) is None


def test_exposure_is_exact_though_highlights_differ_and_unity_where_nothing_is_seen() -> None:
    g = torch.Generator().manual_seed(0)
    centre = 0.1 + 0.3 * torch.rand(64, 64, generator=g)
    view = (centre - 0.02) / 1.3
    view[:24, :40] += 0.4
    used = torch.ones(64, 64, dtype=torch.bool)
    gains, brighter = _exposures(torch.stack([view, centre]), centre, used)
    torch.testing.assert_close(gains.flatten(), torch.tensor([1.3, 1.0]), atol=1e-3, rtol=0)
    torch.testing.assert_close(brighter.flatten(), torch.tensor([0.02, 0.0]), atol=1e-3, rtol=0)
    gains, brighter = _exposures(view[None], centre, ~used)
    assert gains == 1 and brighter == 0


@pytest.mark.parametrize(("name", "is_off"), [("dino", False), ("lytro_2067", True)])
def test_a_lenslet_camera_is_told_from_a_renderer(name: str, is_off: bool, real: Path) -> None:
    found = estimate_alignment(read_light_field(real / name))
    assert found is not None
    assert (found.is_misaligned, found.is_uneven) == (is_off, is_off)
