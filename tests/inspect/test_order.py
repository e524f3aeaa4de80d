"""The order of the views is found for each of the 8 arrangements, and owned up to when open."""

import itertools
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.inspect import Arrangement, check_order
from epinet.inspect.order import CLASSES
from epinet.inspect.spacing import resized
from epinet.lightfield import LightField

Renderer = Callable[..., LightField]

ARRANGEMENTS = [Arrangement(*choice) for choice in itertools.product([False, True], repeat=3)]


@pytest.fixture(scope="module", params=[9, 3])
def scene(request: pytest.FixtureRequest, render: Renderer) -> LightField:
    far, near = (-0.6, 0.9) if request.param == 9 else (-1.5, 2.0)
    layers = {far: None, 0.2: (0.25, 0.6, 0.17), near: (0.62, 0.4, 0.2)}
    return render(layers, grid=request.param, size=(80, 96), noise=0.005)


def in_wrong_order(lf: LightField, shuffle: Arrangement) -> LightField:
    """As if read so from disk: not by the user's wish."""
    return replace(shuffle.apply(lf), order=(False, False, False))


@pytest.mark.parametrize("shuffle", ARRANGEMENTS, ids=str)
def test_any_arrangement_is_found_and_corrected(scene: LightField, shuffle: Arrangement) -> None:
    shuffled = in_wrong_order(scene, shuffle)
    check = check_order(shuffled)
    assert check.decided_grid and check.decided_sign
    assert check.is_consistent == (shuffle == Arrangement())
    corrected = shuffled.reordered(**asdict(check.correction))
    np.testing.assert_array_equal(corrected.views, scene.views)
    assert all(flag in check.verdict for flag in check.flags)


def test_corrected_views_are_consistent(scene: LightField) -> None:
    shuffled = scene.reordered(flip_cols=True, transpose=True)
    assert check_order(check_order(shuffled).correction.apply(shuffled)).is_consistent


def test_flags_are_named_in_place_of_those_given(scene: LightField) -> None:
    """What a user is told to give is right from the beginning, whatever was given before."""
    read = in_wrong_order(scene, Arrangement(flip_rows=True, transpose=True))
    for given in ARRANGEMENTS[1:]:
        check = check_order(given.apply(read))
        asked = Arrangement(**{flag[2:].replace("-", "_"): True for flag in check.flags})
        np.testing.assert_array_equal(asked.apply(read).views, scene.views)
        if not check.is_consistent:
            assert check.remedy == f"{asked} in place of {given}"
    needless = check_order(Arrangement(flip_rows=True).apply(scene))
    assert "it needs no flag in place of --flip-rows" in needless.verdict


def test_one_arrangement_after_another_is_what_reordered_makes_of_both() -> None:
    lf = LightField(np.arange(9, dtype=np.uint8).reshape(3, 3, 1, 1, 1))
    for first, then in itertools.product(ARRANGEMENTS, repeat=2):
        twice, once = then.apply(first.apply(lf)), then.after(first).apply(lf)
        np.testing.assert_array_equal(once.views, twice.views)
        assert once.order == twice.order


def test_without_occlusion_the_sign_stays_open(render: Renderer) -> None:
    plane = render({0.8: None}, size=(80, 96), noise=0.005)
    check = check_order(in_wrong_order(plane, Arrangement(flip_rows=True)))
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


@pytest.mark.parametrize("grid", [9, 5])
def test_no_flip_is_advised_for_a_serpentine_scan(grid: int, render: Renderer) -> None:
    far, near = (-0.6, 0.9) if grid == 9 else (-1.5, 2.0)
    layers = {far: None, 0.2: (0.25, 0.6, 0.17), near: (0.62, 0.4, 0.2)}
    lf = render(layers, grid=grid, size=(80, 96), noise=0.005)
    views = lf.views.copy()
    views[1::2] = views[1::2, ::-1].copy()
    for flip in (False, True):
        check = check_order(LightField(views).reordered(flip_cols=flip))
        assert not check.is_grid and check.is_consistent is False
        assert "--flip" not in check.verdict and "serpentine" in check.verdict


def test_a_straight_track_is_no_grid(render: Renderer) -> None:
    lf = render({-1.5: None, 2.0: (0.5, 0.4, 0.22)}, grid=9, size=(80, 96))
    track = lf.views[4].reshape(3, 3, *lf.views.shape[2:])
    assert not check_order(LightField(track)).is_grid


@pytest.mark.parametrize("spacing", [0.5, 0.8, 1.0, 1.25, 2.0])
@pytest.mark.parametrize("shuffle", [Arrangement(), Arrangement(flip_rows=True)], ids=str)
def test_the_spacing_of_rows_is_measured(
    spacing: float, shuffle: Arrangement, render: Renderer
) -> None:
    """A picture as high as `spacing` asks, shrunk to the same height, moves so much less."""
    height = round(96 / spacing)
    layers = {-1.0: None, 1.5: (0.5, 0.4, 0.2)}
    tall = render(layers, grid=5, size=(height, 112))
    views = np.stack(
        [[resized(view, (96, 112)) for view in row] for row in tall.views.astype(np.float32)]
    )
    check = check_order(in_wrong_order(LightField(views), shuffle))
    assert check.spacing is not None and check.is_grid
    assert check.spacing.factor == pytest.approx(spacing, abs=0.04)
    assert check.spacing.is_square == (spacing == 1)
    assert check.correction == shuffle


def test_faint_samples_tell_the_same(scene: LightField) -> None:
    """Such as 10 bits in a file of 16."""
    faint = LightField(np.round(1023 * scene.views).astype(np.uint16))
    shuffled = in_wrong_order(faint, Arrangement(transpose=True))
    assert check_order(shuffled).flags == ("--transpose",)
    note = faint.brightened().notes[-1]
    assert "% of white" in note
    assert scene.brightened() is scene


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
