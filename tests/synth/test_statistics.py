"""Statistics of maps made by hand, where every number is known."""

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.synth.statistics import Histogram, Statistics, local_contrast, steps

H, W = 40, 50
Y, X = np.mgrid[:H, :W].astype(np.float64)


def light_field(truth, gray=0.5, masks=None) -> LightField:
    views = np.empty((3, 3, H, W, 1), np.float32)
    views[:] = np.broadcast_to(gray, (H, W))[..., None]
    return LightField(views, truth=truth.astype(np.float32), masks=masks or {})


def report(*scenes: LightField):
    statistics = Statistics()
    for scene in scenes:
        statistics.add(scene)
    return statistics.report()


def test_a_slanted_plane():
    numbers = report(light_field(0.03 * X - 0.04 * Y + 1))
    slant = numbers["slant_px_per_px"]
    assert slant["count"] == H * W
    for name in ("min", "percentile_10", "percentile_50", "max"):
        assert slant[name] == pytest.approx(0.05, rel=1e-3)
    assert numbers["step_px"]["count"] == 0
    assert numbers["step_px"]["percentile_50"] is None
    disparity = numbers["disparity_px"]
    assert disparity["min"] == pytest.approx(1 - 0.04 * (H - 1))
    assert disparity["max"] == pytest.approx(1 + 0.03 * (W - 1))
    assert numbers["share_beside_steps"] == 0


def test_a_step_between_two_slanted_planes():
    truth = np.where(X < 20, 0.01 * X, 0.01 * X + 0.75)
    numbers = report(light_field(truth))
    assert numbers["step_px"]["count"] == H
    assert numbers["step_px"]["min"] == pytest.approx(0.76, rel=1e-4)
    assert numbers["step_px"]["max"] == pytest.approx(0.76, rel=1e-4)
    assert numbers["share_beside_steps"] == 2 / W
    assert numbers["slant_px_per_px"]["count"] == H * (W - 2)
    assert numbers["slant_px_per_px"]["max"] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("transposed", [False, True])
def test_both_edges_of_a_thin_thing_are_steps(width, transposed):
    truth = np.where(np.isin(X, range(20, 20 + width)), 2.0, 0.0)
    heights, beside = steps((truth.T if transposed else truth).astype(np.float32))
    assert heights.tolist() == [2.0] * (2 * H)
    beside = beside.T if transposed else beside
    assert (beside == np.isin(X, [19, 20, 19 + width, 20 + width])).all()


def test_creases_and_curved_surfaces_are_no_steps():
    crease = np.maximum(0.0, 0.1 * (X - 20))
    ball = np.sqrt(np.maximum(0.0, 60.0**2 - (X - 25) ** 2 - (Y - 20) ** 2)) / 4
    for truth in (crease, ball):
        heights, beside = steps(truth.astype(np.float32))
        assert heights.size == 0
        assert not beside.any()


def test_unknown_truth_is_left_out():
    truth = 0.02 * X
    truth[10:20, 10:20] = np.nan
    numbers = report(light_field(truth))
    assert numbers["disparity_px"]["count"] == H * W - 100
    assert numbers["step_px"]["count"] == 0
    assert numbers["slant_px_per_px"]["max"] == pytest.approx(0.02, rel=1e-3)
    with pytest.raises(InputError, match="truth"):
        Statistics().add(LightField(np.zeros((3, 3, H, W, 1), np.float32)))


def test_contrast_of_a_chessboard():
    board = (0.4 + 0.2 * ((X + Y) % 2)).astype(np.float32)
    inner = local_contrast(board)[3:-3, 3:-3]
    dark = 25 / 49  # of a window of 7x7
    np.testing.assert_allclose(inner, 0.2 * np.sqrt(dark * (1 - dark)), rtol=1e-4)
    assert local_contrast(np.full((H, W), 0.7, np.float32)).max() < 1e-6


def test_shares():
    half = np.where(X < W // 2, 0.5, 0.4 + 0.2 * ((X + Y) % 2))
    occluded = Y < 10
    truth = np.zeros((H, W))
    numbers = report(light_field(truth, half, {"occluded": occluded}), light_field(truth))
    assert numbers["share_occluded"] == 0.25  # of the scene that says
    assert numbers["share_textureless"] == pytest.approx((0.5 + 1) / 2, abs=4 / W)
    assert report(light_field(truth))["share_occluded"] is None


def test_percentiles_of_scenes_added_one_at_a_time():
    rng = np.random.default_rng(0)
    # Two heaps with nothing between them, and values beyond the bins.
    parts = [rng.normal(-3, 0.2, 5000), rng.normal(6, 0.5, 9000), np.array([40.0])]
    histogram = Histogram(np.linspace(-32, 32, 1281))
    for part in parts:
        histogram.add(part)
    numbers, values = histogram.describe(), np.concatenate(parts)
    for p in (1, 10, 25, 50, 75, 90, 99):
        assert numbers[f"percentile_{p}"] == pytest.approx(np.percentile(values, p), abs=0.051)
    assert (numbers["count"], numbers["max"]) == (14001, 40)


def test_lines_and_plot(tmp_path):
    statistics = Statistics()
    statistics.save_plot(tmp_path / "none.png")  # of nothing at all
    statistics.add(light_field(np.where(X < 20, 0, 1.5)))
    lines = statistics.lines()
    assert any("step" in line and "1.5" in line for line in lines)
    assert "beside a step 4.0 %" in lines[-1]
    statistics.save_plot(tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > (tmp_path / "none.png").stat().st_size
