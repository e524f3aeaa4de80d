"""Views, selections and corrections of a light field."""

import itertools

import numpy as np
import pytest

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.lightfield import LightField


def labelled(rows: int, cols: int) -> LightField:
    """Each view has one gray value that tells its position."""
    values = 16 * np.arange(rows)[:, None] + np.arange(cols)
    views = np.broadcast_to(values[..., None, None, None], (rows, cols, 4, 5, 1))
    return LightField(np.ascontiguousarray(views.astype(np.uint8)))


def positions(lf: LightField) -> list[list[tuple[int, int]]]:
    return [[divmod(int(v), 16) for v in row] for row in lf.views[:, :, 0, 0, 0]]


def test_central_views_of_a_larger_grid():
    central = labelled(11, 11).central(9)
    assert positions(central)[0][0] == (1, 1)
    assert positions(central)[-1][-1] == (9, 9)
    assert central.reference == "row 5, column 5 (counted from 0)"


def test_an_even_grid_gives_up_its_last_row_and_column():
    lf = labelled(10, 10)
    assert positions(lf.central(9)) == [[(r, c) for c in range(9)] for r in range(9)]
    assert lf.centre == (4, 4)


def test_every_kth_view_keeps_the_centre_and_scales_what_is_per_view():
    camera = Camera(100, 35, 10, 2000, 5, 4, disparity_min_px=-1, disparity_max_px=2)
    lf = labelled(9, 9)
    truth = np.full((4, 5), 0.5, np.float32)
    lf = LightField(lf.views, truth=truth, camera=camera)
    stepped = lf.central(5, step=2)
    assert positions(stepped)[2][2] == (4, 4)
    assert positions(stepped)[0] == [(0, c) for c in range(0, 9, 2)]
    assert stepped.truth is not None and stepped.truth[0, 0] == 1.0
    assert stepped.camera is not None
    assert stepped.camera.baseline_mm == 20
    assert stepped.camera.disparity_max_px == 4
    depth = camera.depth_mm(truth)
    np.testing.assert_allclose(stepped.camera.depth_mm(stepped.truth), depth, rtol=1e-5)


def test_too_few_views_are_refused():
    with pytest.raises(InputError, match="9x9 views are needed, the grid has 7x7"):
        labelled(7, 7).central(9)
    with pytest.raises(InputError, match="every 2th view"):
        labelled(9, 9).central(9, step=2)


def test_corrections_of_the_order():
    lf = labelled(3, 3)
    assert positions(lf.reordered(flip_rows=True))[0][0] == (2, 0)
    assert positions(lf.reordered(flip_cols=True))[0][0] == (0, 2)
    assert positions(lf.reordered(transpose=True))[0][1] == (1, 0)
    # transposed first: the view that stood at (row 0, col 1) ends in the last row
    assert positions(lf.reordered(flip_rows=True, transpose=True))[1][0] == (0, 1)
    assert "transposed, rows flipped" in lf.reordered(flip_rows=True, transpose=True).notes[0]


def test_the_order_says_how_to_reach_it_at_once_however_it_was_reached():
    lf = labelled(3, 5)
    arrangements = list(itertools.product((False, True), repeat=3))

    def reordered(lf, rows, cols, transpose):
        return lf.reordered(flip_rows=rows, flip_cols=cols, transpose=transpose)

    for first, second in itertools.product(arrangements, repeat=2):
        twice = reordered(reordered(lf, *first), *second)
        once = reordered(lf, *twice.order)
        assert once.order == twice.order
        np.testing.assert_array_equal(once.views, twice.views)


def test_gray_is_the_references_luma_for_8_and_16_bits():
    rgb = np.random.default_rng(0).integers(0, 256, (3, 3, 4, 5, 3))
    lf8 = LightField(rgb.astype(np.uint8))
    lf16 = LightField((257 * rgb).astype(np.uint16))
    expected = (
        0.299 * rgb[1, 2, ..., 0] + 0.587 * rgb[1, 2, ..., 1] + 0.114 * rgb[1, 2, ..., 2]
    ) / 255
    np.testing.assert_allclose(lf8.gray(1, 2), expected, atol=1e-6)
    np.testing.assert_array_equal(lf8.gray(1, 2), lf16.gray(1, 2))


@pytest.mark.parametrize(
    "views",
    [
        np.zeros((3, 3, 4, 5), np.uint8),
        np.zeros((3, 3, 4, 5, 2), np.uint8),
        np.zeros((3, 3, 4, 5, 1)),
    ],
)
def test_shapes_and_types_that_are_no_views(views):
    with pytest.raises(InputError, match="views must"):
        LightField(views)


def test_truth_of_another_size_is_refused():
    with pytest.raises(InputError, match="truth is 6x4 px, the views are 5x4 px"):
        LightField(np.zeros((3, 3, 4, 5, 1), np.uint8), truth=np.zeros((4, 6), np.float32))


def test_the_reference_is_named_by_the_grid_that_was_read():
    assert labelled(13, 13).central(7, step=2).reference == "row 6, column 6 (counted from 0)"
    twice = labelled(13, 13).central(7, step=2).central(3, step=2)
    assert (twice.grid_origin, twice.grid_step) == ((2, 2), 4)
    assert positions(twice)[0][0] == (2, 2)


@pytest.mark.parametrize(("views", "step"), [(8, 1), (0, 1), (-3, 1), (3, 0)])
def test_views_that_have_no_centre_are_refused(views, step):
    with pytest.raises(InputError, match="must be odd"):
        labelled(9, 9).central(views, step)
