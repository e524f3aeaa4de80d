"""Tiling, the ensemble and scales are exact; the confidence tells right from wrong."""

import numpy as np
import pytest
import torch

from epinet.angular import SYMMETRIES
from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.tiling import even_tiles
from epinet.networks.weights import Weights
from epinet.predict.confidence import Calibration, agreement, support
from epinet.predict.estimator import Estimator, enlarge, shrink
from epinet.synth.generator import render_scene
from epinet.synth.options import Faults, Options


@pytest.fixture(scope="module")
def scene() -> LightField:
    """A rendered 5x5 light field with truth, 40 x 53 px."""
    options = Options(
        size=(40, 53),
        disparity_px=(-2, 2),
        views=5,
        contrast=(0.5, 1),
        textureless=0,
        reflective=0,
        highlights=0,
        surfaces=(30, 40),
        thin=0,
        clutter=0,
        faults=Faults.none(),
    )
    lf = render_scene(options, 11, 0)
    gray = np.stack([[lf.gray(r, c) for c in range(5)] for r in range(5)])[..., None]
    return LightField(gray, truth=lf.truth)


def turned(lf: LightField, symmetry) -> LightField:
    views = lf.views[..., 0]
    if symmetry.transposed:
        views = views.transpose(1, 0, 3, 2)
    views = np.rot90(views, symmetry.quarter_turns, (0, 1))
    views = np.rot90(views, symmetry.quarter_turns, (2, 3))
    return LightField(np.ascontiguousarray(views)[..., None])


def test_the_map_has_the_size_of_the_views_and_equals_the_network_inside(estimator, scene):
    result = estimator.predict(scene)
    assert result.disparity.shape == result.confidence.shape == (40, 53)
    stacks = torch.from_numpy(scene.stacks(5))[None]
    with torch.no_grad():
        inner = estimator.weights[0].net(stacks)[0, 0].numpy()
    np.testing.assert_allclose(result.disparity[11:-11, 11:-11], inner, atol=1e-5)
    assert np.std(inner) > 1e-2


@pytest.mark.parametrize("side", [11, 27, 52])
def test_tiled_equals_untiled(estimator, scene, side, monkeypatch):
    net, stacks = estimator.weights[0].net, torch.from_numpy(scene.stacks(5))
    whole, _ = net.predict(stacks, (-1, 1), 1000)
    shares: list[float] = []
    monkeypatch.setattr(Epinet, "tile_side_px", lambda self, memory_mb: side)
    tiled, _ = net.predict(stacks, (-1, 1), 1, shares.append)
    np.testing.assert_allclose(tiled, whole, atol=1e-5)
    assert sum(shares) == pytest.approx(1)
    assert len(shares) == len(even_tiles(40, side)) * len(even_tiles(53, side))


def test_tiles_cover_a_length_once_and_stay_below_the_bound():
    for length in range(1, 60):
        for side in (1, 5, 16, 59):
            tiles = even_tiles(length, side)
            assert [i for a, b in tiles for i in range(a, b)] == list(range(length))
            assert max(b - a for a, b in tiles) <= side


def test_more_memory_allows_larger_tiles(estimator):
    sides = [estimator.weights[0].net.tile_side_px(mb) for mb in (1, 10, 1000)]
    assert sides == sorted(sides)
    assert sides[0] < sides[-1]


def test_the_map_is_that_of_views_whose_edges_are_repeated(estimator):
    net, stacks = estimator.weights[0].net, np.random.default_rng(1).random((4, 5, 9, 12))
    padded = np.pad(stacks, ((0, 0), (0, 0), (11, 11), (11, 11)), mode="edge")
    seen, whole = (torch.from_numpy(a.astype(np.float32))[None] for a in (stacks, padded))
    with torch.no_grad():
        expected = net(whole)[0, 0]
        found, _ = net.estimate(seen, (-1, 1))
    assert torch.equal(found[0, 0], expected)
    assert torch.allclose(net.predict(seen[0], (-1, 1), 1000)[0], expected, atol=1e-5)


@pytest.mark.parametrize("symmetry", (SYMMETRIES[1], SYMMETRIES[4]), ids=str)  # generators
def test_the_ensemble_of_a_turned_scene_is_the_turned_ensemble(estimator, scene, symmetry):
    """Averaging over a group, undone exactly, commutes with the group; a single map does not."""
    ensemble = estimator.predict(scene, ensemble=True).disparity
    of_turned = estimator.predict(turned(scene, symmetry), ensemble=True).disparity
    np.testing.assert_allclose(of_turned, symmetry.apply(ensemble), atol=1e-4)
    single = estimator.predict(scene).disparity
    single_of_turned = estimator.predict(turned(scene, symmetry)).disparity
    assert np.abs(single_of_turned - symmetry.apply(single)).max() > 1e-2


def test_the_ensemble_is_the_mean_of_the_eight(estimator, scene):
    maps = [
        s.undo(np.ascontiguousarray(estimator.predict(turned(scene, s)).disparity))
        for s in SYMMETRIES
    ]
    ensemble = estimator.predict(scene, ensemble=True).disparity
    np.testing.assert_allclose(ensemble, np.mean(maps, axis=0), atol=1e-4)


@pytest.mark.parametrize(("scale", "size"), [(2, (40, 52)), (3, (41, 53))])
def test_a_shrunk_ramp_is_enlarged_to_itself(scale, size):
    """Disparity in full-size pixels, each block's centre where it belongs."""
    y, x = np.mgrid[: size[0], : size[1]]
    ramp = torch.from_numpy((0.02 * x - 0.03 * y).astype(np.float32))
    small = shrink(ramp[None], scale)[0] / scale  # what a perfect network says of the shrunk views
    back = enlarge(small, scale, size)
    assert back.shape == size
    inner = slice(2 * scale, -2 * scale)
    np.testing.assert_allclose(back[inner, inner], ramp[inner, inner], atol=1e-5)


@pytest.mark.parametrize("scale", [2, 3])
def test_views_shrunk_show_the_truth_divided(scene, scale):
    small = LightField(shrink(torch.from_numpy(scene.views[..., 0]), scale).numpy()[..., None])
    truth = shrink(torch.from_numpy(scene.truth)[None], scale)[0].numpy() / scale
    right = agreement(small, truth)[0].mean()
    assert right > agreement(small, truth * scale)[0].mean() + 0.02
    assert right > agreement(small, -truth)[0].mean() + 0.02


def test_a_scaled_prediction_has_full_size(estimator, scene):
    result = estimator.predict(scene, scale=2)
    assert result.disparity.shape == (40, 53)
    shrunk = LightField(shrink(torch.from_numpy(scene.views[..., 0]), 2).numpy()[..., None])
    small = estimator.predict(shrunk).disparity
    expected = enlarge(torch.from_numpy(small), 2, (40, 53))
    np.testing.assert_allclose(result.disparity, expected, atol=1e-4)


def test_confidence_prefers_the_truth(scene):
    assert scene.truth is not None
    right = agreement(scene, scene.truth)[0]
    assert right.shape == scene.size
    assert right.min() >= 0
    assert right.max() <= 1
    assert np.median(right) > 0.9
    for wrong in (scene.truth + 0.5, -scene.truth):
        assert agreement(scene, wrong)[0].mean() < right.mean() - 0.05


@pytest.mark.parametrize("level", [0, 1e-40, 0.02, 0.5, 0.99, 1, 1.03])
@pytest.mark.parametrize("noise", [0, 0.01, 0.05])
@pytest.mark.parametrize("side", [3, 9])
def test_nothing_is_sure_where_there_is_no_texture(level, noise, side):
    """Any disparity agrees there; noise is no texture either, clipped at white or black or not."""
    views = np.full((side, side, 40, 48, 1), level, np.float32)
    views += np.random.default_rng(0).normal(0, noise, views.shape).astype(np.float32)
    flat = LightField(views.clip(0, 1))
    for disparity in (0, 1.3):
        confidence = agreement(flat, np.full((40, 48), disparity, np.float32))[1]
        assert np.median(confidence) < 0.1


@pytest.mark.parametrize("gain", [1, 1.6])
def test_texture_is_seen_under_noise_and_beside_clipped_samples(scene, gain):
    noise = np.random.default_rng(0).normal(0, 0.01, scene.views.shape).astype(np.float32)
    noisy = LightField((gain * scene.views + noise).clip(0, 1))
    consistent, sure = agreement(noisy, scene.truth)
    assert np.median(sure) > 0.9 * np.median(consistent)


def test_texture_that_matches_nowhere_near_is_no_support(scene):
    assert np.median(support(scene, scene.truth)) == 1
    elsewhere = scene.truth + np.float32(3)
    assert np.median(support(scene, elsewhere)) < 0.5


def test_an_expected_error_without_bound_is_no_confidence():
    with np.errstate(all="raise"):
        sure = Calibration(0.07, 30.0).confidence(np.float32([0, 1e30, np.inf]))
    assert sure.tolist() == [1, 0, 0]


def test_confidence_in_bands_equals_confidence_at_once(scene, monkeypatch):
    from epinet.predict import confidence

    at_once = agreement(scene, scene.truth)[0]
    monkeypatch.setattr(confidence, "BAND_PX", 3 * 53)
    np.testing.assert_allclose(agreement(scene, scene.truth)[0], at_once, atol=1e-5)


def test_the_central_views_of_a_larger_grid_are_used(estimator, scene):
    views = np.pad(scene.views, ((1, 2), (1, 2), (0, 0), (0, 0), (0, 0)), mode="edge")
    larger = estimator.predict(LightField(views))  # 8x8: the last row and column go
    np.testing.assert_array_equal(larger.disparity, estimator.predict(scene).disparity)


def test_warnings_for_views_that_disagree_and_disparities_out_of_range(estimator):
    noise = np.random.default_rng(0).random((5, 5, 30, 30, 1), dtype=np.float32)
    assert any("disagree" in w for w in estimator.predict(LightField(noise)).warnings)
    estimator.weights[0].net.head[-1].bias.data += 50
    try:
        warnings = estimator.predict(LightField(noise)).warnings
    finally:
        estimator.weights[0].net.head[-1].bias.data -= 50
    assert any("exceed the -4..4 px" in w for w in warnings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scale": 0}, "at least 1"),
        ({"memory_mb": 0}, "must be positive"),
        ({"step": 2}, "every 2th view"),
    ],
)
def test_impossible_settings_are_refused(estimator, scene, settings, message):
    with pytest.raises(InputError, match=message):
        estimator.predict(scene, **settings)


def test_too_few_views_are_refused(estimator):
    with pytest.raises(InputError, match=r"has 3x3 views, the weights random need 5x5"):
        estimator.predict(LightField(np.zeros((3, 3, 30, 30, 1), np.uint8)))


def _constant(views: int, disparity: float) -> Weights:
    net = Epinet(EpinetConfig(views=views, stream_width=4)).eval()
    torch.nn.init.zeros_(net.head[-1].weight)
    torch.nn.init.constant_(net.head[-1].bias, disparity)
    return Weights(net, {}, f"constant {disparity}")


def test_a_light_field_is_shown_to_the_network_of_most_views_that_it_has():
    several = Estimator(_constant(3, 0.3), _constant(7, 0.7), _constant(5, 0.5), device="cpu")
    views = np.random.default_rng(0).random((9, 9, 30, 30, 1), dtype=np.float32)

    def chosen(lf: LightField, step: int = 1) -> float:
        return float(several.predict(lf, step=step).disparity.mean())

    assert chosen(LightField(views)) == pytest.approx(0.7)
    assert chosen(LightField(views[:6, :6])) == pytest.approx(0.5)
    assert chosen(LightField(views[:4, :9])) == pytest.approx(0.3)
    assert chosen(LightField(views), step=2) == pytest.approx(0.5)
    present = np.ones((9, 9), bool)
    present[1, 1] = False  # a corner of the 7x7 star
    assert chosen(LightField(views, present=present)) == pytest.approx(0.5)


def test_nothing_is_known_in_corners_that_are_black_in_every_view(estimator, scene):
    """A round stop that stands still, as of a plenoptic camera."""
    y, x = (np.arange(n) - (n - 1) / 2 for n in scene.size)
    shut = np.hypot(y[:, None], x) > 0.85 * np.hypot(y[0], x[0])
    views = np.where(shut[..., None], 0, np.maximum(scene.views, 0.1)).astype(np.float32)
    result = estimator.predict(LightField(views))
    assert shut[0, 0]
    assert (result.confidence[shut] == 0).all()
    assert (result.confidence[~shut] > 0).mean() > 0.9
    assert any("black in every view" in note for note in result.lightfield.notes)
    assert not any("black" in note for note in estimator.predict(scene).lightfield.notes)


@pytest.mark.parametrize(
    ("value", "says"), [(np.nan, "not finite"), (200.0, "if white is 255"), (-0.5, "-1..1")]
)
def test_float_views_that_no_camera_gives_are_refused(estimator, scene, value, says):
    """Rather than made into a map that is not finite."""
    views = scene.views.copy()
    views[2, 2, 5, 5] = value
    with pytest.raises(InputError, match=says):
        estimator.predict(LightField(views))
