"""What is done to the views of a rendered light field is measured and undone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import shift

import epinet
from epinet.angular import star_positions
from epinet.inspect.alignment import Alignment, estimate_alignment
from epinet.lightfield import LightField
from epinet.metrics.disparity import score
from epinet.refine.compensation import compensated, moved
from epinet.synth.generator import render_scene
from epinet.synth.options import Faults, Options

SHIFT_PX, GAIN, BRIGHTER = 0.3, 0.06, 0.01


@pytest.fixture(scope="module")
def scene() -> LightField:
    """A rendered 9x9 light field with truth, 144 x 176 px."""
    options = Options(
        size=(144, 176),
        disparity_px=(-1, 1),
        contrast=(0.5, 1),
        textureless=0,
        reflective=0,
        highlights=0,
        thin=0,
        clutter=0,
        faults=Faults.none(),
    )
    return render_scene(options, 16, 0, star_only=True)


@pytest.fixture(scope="module")
def disturbed(scene: LightField) -> tuple[LightField, Alignment]:
    """Its views moved (by scipy) and exposed differently, and how."""
    rng = np.random.default_rng(3)
    row, col = scene.centre
    places = [p for p in star_positions(9) if p != scene.centre]
    offsets = tuple((r - row, c - col) for r, c in places)
    count = len(places)
    shifts = rng.normal(0, SHIFT_PX, (count, 2))
    p = np.array(offsets)
    shifts -= (shifts * p).sum() / (p * p).sum() * p  # another focus plane is not seen
    gains = 1 + GAIN * rng.uniform(-1, 1, (count, 3))
    brighter = BRIGHTER * rng.uniform(-1, 1, (count, 3))
    views = scene.views.copy()
    for k, place in enumerate(places):
        view = shift(scene.unit(*place), (*shifts[k], 0), order=3, mode="nearest")
        view = ((view - brighter[k]) / gains[k]).clip(0, 1)
        views[place] = np.round(255 * view)
    truth = (a.astype(np.float32) for a in (shifts, gains, brighter))
    return replace(scene, views=views), Alignment(offsets, *truth)


@pytest.fixture(scope="module")
def measured(disturbed: tuple[LightField, Alignment]) -> Alignment:
    found = estimate_alignment(disturbed[0])
    assert found is not None
    return found


def test_shifts_and_exposures_are_recovered(disturbed, measured):
    truth = disturbed[1]
    assert measured.offsets == truth.offsets
    error = measured.shifts_px - truth.shifts_px
    assert np.sqrt((error**2).sum(1).mean()) < 0.1 * SHIFT_PX
    assert np.abs(error).max() < 0.1
    grays = [0.5 * a.gains + a.brighter for a in (measured, truth)]
    assert np.abs(grays[0] - grays[1]).max() < 0.1 * (0.5 * GAIN + BRIGHTER)
    assert measured.is_misaligned and measured.is_uneven
    text = str(measured)
    assert "out of place" in text and "exposures" in text


def test_views_come_back(scene, disturbed, measured):
    views = compensated(disturbed[0], measured)
    assert views.views.dtype == np.uint8
    np.testing.assert_array_equal(views.views[views.centre], scene.views[scene.centre])
    inner = (slice(3, -3), slice(3, -3))
    before, after = (
        np.mean([np.abs(lf.unit(*p) - scene.unit(*p))[inner].mean() for p in star_positions(9)])
        for lf in (disturbed[0], views)
    )
    assert after < 0.2 * before
    assert views.notes[-1].startswith("compensated: views 0.")


def test_prediction_gets_better(scene, disturbed, measured):
    model = epinet.load_model(device="cpu")
    fields = (scene, disturbed[0], compensated(disturbed[0], measured))
    clean, wrong, right = (
        score(model.predict(lf).disparity, scene.truth)["badpix_0.07"] for lf in fields
    )
    assert right - clean < 0.5 * (wrong - clean), (clean, wrong, right)


def test_what_is_in_place_is_left_alone(scene):
    found = estimate_alignment(scene)
    assert found is not None
    assert compensated(scene, found) is scene
    assert str(found) == "views in their places and exposed alike"


def test_a_light_field_is_refined_if_a_camera_took_it_or_on_request(scene):
    model = epinet.load_model(device="cpu")
    small = replace(scene, views=scene.views[:, :, :64, :64], truth=None, masks={}, objects=None)
    plain, asked, taken, refused = (
        model.predict(lf, refine=wish)
        for lf, wish in (
            (small, None),
            (small, True),
            (replace(small, captured=True), None),
            (replace(small, captured=True), False),
        )
    )
    assert [r.settings["refine"] for r in (plain, asked, taken, refused)] == [0, 1, 1, 0]
    assert plain.alignment is None and taken.alignment is not None
    np.testing.assert_array_equal(plain.disparity, refused.disparity)
    np.testing.assert_array_equal(asked.disparity, taken.disparity)
    assert not np.array_equal(plain.disparity, taken.disparity)


def test_moving_by_whole_pixels_is_exact_and_by_parts_nearly_so():
    y, x = np.mgrid[:40, :50].astype(np.float32)

    def waves(y, x):
        return np.stack([0.5 + 0.2 * np.sin(0.9 * x + 0.4 * y), 0.5 + 0.2 * np.cos(y)], -1)

    inner = (slice(6, -6), slice(6, -6))
    view = waves(y, x).astype(np.float32)
    np.testing.assert_allclose(moved(view, 2, -1)[inner], waves(y + 2, x - 1)[inner], atol=1e-6)
    part = moved(view, -0.4, 1.3)
    np.testing.assert_allclose(part[inner], waves(y - 0.4, x + 1.3)[inner], atol=0.005)
    flat = np.full((20, 20, 3), 0.3, np.float32)
    np.testing.assert_allclose(moved(flat, 0.37, -0.21), flat, atol=1e-6)
