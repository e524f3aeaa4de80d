"""Prediction by SweepNet with the weights that are shipped."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

import epinet
from epinet.angular import SYMMETRIES, direction_positions
from epinet.errors import InputError
from epinet.inspect import estimate_range
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.sweepnet import SweepNet
from epinet.networks.weights import Weights
from epinet.predict.estimator import Estimator, _run, search_range
from epinet.synth.generator import render_scene
from epinet.synth.options import RANGES_PX, Faults, Options


@pytest.fixture(scope="module")
def model():
    return epinet.load_model(device="cpu")


@pytest.fixture(scope="module")
def scene() -> LightField:
    """A rendered 9x9 light field with truth, 96 x 112 px."""
    options = Options(
        size=(96, 112),
        disparity_px=(-2, 2),
        contrast=(0.5, 1),
        textureless=0,
        reflective=0,
        thin=0,
        clutter=0,
        faults=Faults.none(),
    )
    return render_scene(options, 16, 0, star_only=True)


def plane(disparity: float, views: int = 9, side: int = 96) -> LightField:
    """A textured plane, exact: a formula drawn for every view."""
    rng = np.random.default_rng(5)
    waves = [(*rng.normal(0, 0.25, 2), rng.uniform(0, 7)) for _ in range(40)]
    y, x = np.mgrid[:side, :side].astype(np.float32)
    out = np.zeros((views, views, side, side, 1), np.float32)
    positions = {p for d in (90, 0, 45, -45) for p in direction_positions(d, views)}
    for row, col in positions:
        u, v = x + disparity * (col - views // 2), y + disparity * (row - views // 2)
        out[row, col, ..., 0] = 0.5 + 0.04 * sum(np.sin(a * u + b * v + c) for a, b, c in waves)
    present = np.zeros((views, views), bool)
    for p in positions:
        present[p] = True
    return LightField(out.clip(0, 1), present=present)


@pytest.mark.parametrize("views", [9, 7, 5, 3])
def test_a_scene_is_seen_whatever_the_number_of_views(model, scene, views):
    seen = scene.central(views)
    result = model.predict(seen)
    assert result.disparity.shape == seen.size
    scores = result.scores
    assert scores is not None and seen.truth is not None
    constant = 100 * np.var(seen.truth[15:-15, 15:-15])
    assert scores["mse_x100"] < (0.2 if views > 3 else 0.5) * constant


@pytest.mark.parametrize(("disparity", "side"), [(0.37, 96), (-3.2, 96), (-18.3, 288)])
def test_a_plane_lies_where_it_is_near_or_far(model, disparity, side):
    """Far beyond what training showed, by searching smaller pictures first."""
    lf = plane(disparity, side=side)
    margin = round(min(4 * abs(disparity), 0.3 * side))
    found = model.predict(lf).disparity[margin:-margin, margin:-margin]
    assert np.median(np.abs(found - disparity)) < 0.03


def test_the_search_covers_the_disparities_of_the_views(scene):
    low, high = search_range(estimate_range(scene))
    assert low < np.percentile(scene.truth, 1) and high > np.percentile(scene.truth, 99)
    assert high - low < 8
    flat = LightField(np.full((9, 9, 64, 64, 1), 100, np.uint8))
    assert search_range(estimate_range(flat)) == RANGES_PX["hci"]


def test_the_map_stays_within_the_range_that_is_stated(model, scene):
    """By the scene's file or the user; what lay beyond is known to be wrong."""
    free = model.predict(replace(scene, camera=None))
    camera = replace(scene.camera, disparity_min_px=-0.5, disparity_max_px=0.5)
    for result in (
        model.predict(replace(scene, camera=camera)),
        model.predict(replace(scene, camera=None), range_px=(-0.5, 0.5)),
    ):
        assert np.abs(result.disparity).max() == pytest.approx(0.6)
        assert any("beyond the stated -0.5..0.5 px" in w for w in result.warnings)
        far = np.abs(scene.truth) > 1.2
        assert np.median(result.confidence[far]) < 0.3
    bounded = model.predict(replace(scene, camera=camera))
    beyond = np.abs(free.disparity - free.disparity.clip(-0.6, 0.6))
    np.testing.assert_allclose(bounded.disparity, free.disparity.clip(-0.6, 0.6), atol=1e-6)
    np.testing.assert_allclose(
        bounded.expected_error, free.expected_error + beyond, rtol=1e-4, atol=1e-6
    )
    assert not any("stated" in w for w in model.predict(scene).warnings)


def test_the_map_need_not_stay_within_the_range(model, scene):
    camera = replace(scene.camera, disparity_min_px=-0.5, disparity_max_px=0.5)
    free = model.predict(replace(scene, camera=camera), bounded=False)
    unstated = model.predict(replace(scene, camera=None))
    np.testing.assert_array_equal(free.disparity, unstated.disparity)
    assert free.settings["stated_px"] is None and not any("stated" in w for w in free.warnings)


def test_epinets_map_is_bounded_only_where_that_is_asked_for(scene):
    """Its published scores know no range."""
    net = Epinet(EpinetConfig(views=9, stream_width=4))
    torch.nn.init.constant_(net.head[2].bias, 3.0)
    estimator = Estimator(Weights(net.eval(), {}, "made here"))
    camera = replace(scene.camera, disparity_min_px=-0.5, disparity_max_px=0.5)
    stated = replace(scene, camera=camera)
    free = estimator.predict(stated)
    assert free.disparity.max() > 2 and free.settings["stated_px"] is None
    for result in (
        estimator.predict(stated, bounded=True),
        estimator.predict(replace(scene, camera=None), range_px=(-0.5, 0.5)),
    ):
        np.testing.assert_allclose(result.disparity, free.disparity.clip(-0.6, 0.6))
        assert result.settings["stated_px"] == [-0.5, 0.5]


@pytest.mark.parametrize("symmetry", (SYMMETRIES[1], SYMMETRIES[4]), ids=str)  # generators
def test_the_ensemble_of_turned_views_is_the_turned_ensemble(model, scene, symmetry):
    net = model.weights[0].net
    stacks = torch.from_numpy(scene.stacks(9))

    def ensemble(views):
        return _run(net, views, (-2, 2), True, 1000, lambda share: None)

    for one, other in zip(
        ensemble(symmetry.apply_to_stacks(stacks)), ensemble(stacks), strict=True
    ):
        assert torch.allclose(one, symmetry.apply(other), atol=2e-3)


def test_tiles_give_nearly_what_the_whole_gives(model, scene, monkeypatch):
    net = model.weights[0].net
    stacks = torch.from_numpy(scene.stacks(9))
    whole, error = net.predict(stacks, (-2.0, 2.0), 4000)
    monkeypatch.setattr(SweepNet, "overlap_px", 32)
    shares: list[float] = []
    tiled, _ = net.predict(stacks, (-2.0, 2.0), 1, shares.append)
    assert len(shares) == 4
    assert sum(shares) == pytest.approx(1)
    assert (tiled - whole).abs().median() < 1e-3
    assert ((tiled - whole).abs() < 0.02).float().mean() > 0.9
    assert error.min() > 0


@pytest.mark.parametrize(("range_px", "bound_px"), [((-2.0, 2.0), 1e-5), ((-2.0, 14.0), 3e-5)])
def test_tiles_begin_where_the_smallest_pictures_have_pixels(model, range_px, bound_px):
    """Or means of pixels, and so all that follows, would differ from the whole's everywhere."""
    net = model.weights[0].net
    stacks = torch.from_numpy(plane(0.37, side=139).stacks(9))
    whole, _ = net.predict(stacks, range_px, 4000)
    tiled, _ = net.predict(stacks, range_px, 1)
    difference = (tiled - whole).abs()
    assert difference.median() < bound_px and difference.max() < 0.02


def test_errors_are_small_where_the_confidence_is_high(model, scene):
    result = model.predict(scene)
    inner = (slice(15, -15), slice(15, -15))
    error = np.abs(result.disparity - scene.truth)[inner]
    confidence = result.confidence[inner]
    sure = confidence > np.median(confidence)
    assert error[sure].mean() < 0.3 * error[~sure].mean()


def test_a_model_and_the_weights_of_another_are_refused():
    assert epinet.load_model(model="epinet", device="cpu").weights[0].model == "epinet"
    with pytest.raises(InputError, match="weights of epinet, not of sweepnet"):
        epinet.load_model("epinet_9x9", model="sweepnet")
    with pytest.raises(InputError, match="model 'other': there are sweepnet, epinet"):
        epinet.load_model(model="other")


def test_views_that_may_be_otherwise_than_taken_to_be_are_warned_of():
    """Views far out of place, as in a wrong order, and disparities beyond the search."""
    rng = np.random.default_rng(0)
    texture = gaussian_filter(rng.normal(size=(200, 200, 1)), (1.5, 1.5, 0))
    texture = np.round(255 * (0.5 + 0.12 * texture / texture.std()).clip(0, 1)).astype(np.uint8)

    def plane(step_px):
        places = [100 - 30 + step_px * k for k in range(-1, 2)]
        return np.array([[texture[r : r + 60, c : c + 60] for c in places] for r in places])

    model = epinet.load_model(device="cpu")
    near = plane(2)
    assert not model.predict(LightField(near), refine=True).warnings
    strewn = near.copy()
    for place in ((0, 0), (0, 2), (1, 0), (2, 1)):
        strewn[place] = np.roll(strewn[place], (1, -1), (0, 1))
    assert any("out of place" in w for w in model.predict(LightField(strewn), refine=True).warnings)
    for captured in (True, False):  # no parameters.cfg vouches for either
        upside_down = LightField(near[::-1], captured=captured)
        warnings = model.predict(upside_down, refine=False).warnings
        assert any("needs --flip-rows" in w for w in warnings)
    far = LightField(plane(20))
    assert any("may exceed the 20 px" in w for w in model.predict(far, refine=False).warnings)
    told = model.predict(far, refine=False, range_px=(16, 24))
    assert np.median(told.disparity) == pytest.approx(20, abs=0.1)
    assert not any("exceed" in w for w in told.warnings)


def test_something_beyond_the_search_is_found_before_a_background_within_it(model):
    """3x3 views of 200x200 px, half a pixel of error at most in both."""
    rng = np.random.default_rng(0)
    texture = gaussian_filter(rng.normal(size=(2, 320, 320)), (0, 1.5, 1.5))
    far, near = (0.5 + 0.12 * texture / texture.std()).clip(0, 1).astype(np.float32)
    views = np.empty((3, 3, 200, 200, 1), np.float32)
    for row, col in np.ndindex(3, 3):
        down, right = 45 * (row - 1), 45 * (col - 1)
        views[row, col, ..., 0] = far[60 + row : 260 + row, 60 + col : 260 + col]
        box = slice(70 - down, 130 - down), slice(70 - right, 130 - right)
        views[row, col, ..., 0][box] = near[70:130, 70:130]
    result = model.predict(LightField(views))
    assert not result.warnings
    assert np.median(np.abs(result.disparity[70:130, 70:130] - 45)) < 0.1
    truth = np.full((200, 200), 1.0)
    truth[70:130, 70:130] = 45
    assert (np.abs(result.disparity - truth) < 0.5).mean() > 0.9


def test_a_stated_range_is_what_is_looked_for(model, scene):
    """In px of the map, whatever the scale that the network sees."""
    measured = model.predict(scene)
    for scale in (1, 2):
        told = model.predict(scene, scale=scale, range_px=(-2.5, 2.5))
        assert told.settings["range_px"] == [-2.5, 2.5]
        assert np.nanmedian(np.abs(told.disparity - measured.disparity)) < 0.02 * scale
    far = model.predict(plane(-40.3, views=3, side=320), range_px=(-50, -30)).disparity
    assert np.median(np.abs(far[100:-100, 100:-100] + 40.3)) < 0.1
    with pytest.raises(InputError, match="a lesser and a greater disparity, not 2,-2"):
        model.predict(scene, range_px=(2, -2))
