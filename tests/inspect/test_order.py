"""The order of the views is found for each of the 8 arrangements, and owned up to when open."""

import itertools
from collections.abc import Callable
from dataclasses import asdict

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.inspect import Arrangement, check_order
from epinet.inspect.order import CLASSES
from epinet.lightfield import LightField

Renderer = Callable[..., LightField]

ARRANGEMENTS = [Arrangement(*choice) for choice in itertools.product([False, True], repeat=3)]


@pytest.fixture(scope="module", params=[9, 3])
def scene(request: pytest.FixtureRequest, render: Renderer) -> LightField:
    far, near = (-0.6, 0.9) if request.param == 9 else (-1.5, 2.0)
    layers = {far: None, 0.2: (0.25, 0.6, 0.17), near: (0.62, 0.4, 0.2)}
    return render(layers, grid=request.param, size=(80, 96), noise=0.005)


@pytest.mark.parametrize("shuffle", ARRANGEMENTS, ids=str)
def test_any_arrangement_is_found_and_corrected(scene: LightField, shuffle: Arrangement) -> None:
    shuffled = shuffle.apply(scene)
    check = check_order(shuffled)
    assert check.decided_grid and check.decided_sign
    assert check.is_consistent == (shuffle == Arrangement())
    corrected = shuffled.reordered(**asdict(check.correction))
    np.testing.assert_array_equal(corrected.views, scene.views)
    assert all(flag in check.verdict for flag in check.correction.flags)


def test_corrected_views_are_consistent(scene: LightField) -> None:
    shuffled = scene.reordered(flip_cols=True, transpose=True)
    assert check_order(check_order(shuffled).correction.apply(shuffled)).is_consistent


def test_without_occlusion_the_sign_stays_open(render: Renderer) -> None:
    plane = render({0.8: None}, size=(80, 96), noise=0.005).reordered(flip_rows=True)
    check = check_order(plane)
    assert check.decided_grid and not check.decided_sign
    assert check.correction == Arrangement(flip_rows=True)
    assert check.is_consistent is False
    assert "needs --flip-rows or --flip-cols" in check.verdict


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_flat_gray_tells_nothing(noise: float, render: Renderer) -> None:
    check = check_order(render({0.5: None}, grid=3, contrast=0, noise=noise))
    assert not check.decided_grid and not check.decided_sign
    assert check.is_consistent is None
    assert check.correction.flags == ()
    assert "too little" in check.verdict


def test_views_of_the_star_are_enough(scene: LightField) -> None:
    present = np.zeros(scene.grid, bool)
    index = np.arange(scene.grid[0])
    present[index, index] = present[index, index[::-1]] = True
    present[scene.centre[0]] = present[:, scene.centre[1]] = True
    views = scene.views * present[..., None, None, None]
    assert check_order(LightField(views, present)).is_consistent


def test_even_grids_are_taken_without_last_row_and_column(render: Renderer) -> None:
    layers = {-1.5: None, 2.0: (0.5, 0.4, 0.22)}
    odd = render(layers, grid=3, size=(80, 96))
    views = np.zeros((4, 4, 80, 96, 1), np.float32)
    views[:3, :3] = odd.views
    assert check_order(LightField(views)).is_consistent


def test_too_few_views_are_refused() -> None:
    with pytest.raises(InputError, match="3x3"):
        check_order(LightField(np.zeros((2, 2, 16, 16, 1), np.uint8)))


def test_arrangement_moves_offsets_as_reordered_moves_views() -> None:
    views = np.zeros((3, 3, 1, 1, 1), np.uint8)
    views[0, 1] = 1
    for arrangement in ARRANGEMENTS:
        row, col = arrangement.moves((-1, 0))
        assert arrangement.apply(LightField(views)).views[row + 1, col + 1] == 1
    assert {a for c in CLASSES for a in (c, c.reversed)} == set(ARRANGEMENTS)
