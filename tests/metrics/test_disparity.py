"""Scores on maps whose answers are known by hand."""

import numpy as np
import pytest

from epinet.metrics.disparity import score


def test_hand_computed_scores():
    truth = np.zeros((1, 8))
    estimate = np.array([[0, 0.005, 0.02, -0.02, 0.05, 0.08, -0.5, 0.07]])
    scores = score(estimate, truth, border_px=0)
    assert scores["badpix_0.07"] == pytest.approx(100 * 2 / 8)  # exactly .07 is good
    assert scores["badpix_0.03"] == pytest.approx(100 * 4 / 8)
    assert scores["badpix_0.01"] == pytest.approx(100 * 6 / 8)
    assert scores["mse_x100"] == pytest.approx(100 * np.mean(estimate**2))
    assert scores["mae_px"] == pytest.approx(np.mean(np.abs(estimate)))
    assert scores["q25_x100"] == pytest.approx(100 * np.percentile(np.abs(estimate), 25))


def test_a_missing_estimate_is_bad_and_told():
    truth = np.zeros((1, 4))
    scores = score(np.array([[0, 0, 0, np.nan]]), truth, border_px=0)
    assert scores["badpix_0.07"] == 25
    assert scores["missing"] == 25
    assert scores["mse_x100"] == 0


def test_pixels_without_truth_do_not_count():
    truth = np.array([[0, np.nan]])
    assert score(np.array([[0.0, 9.0]]), truth, border_px=0)["mse_x100"] == 0


def test_the_border_is_left_out():
    truth = np.zeros((40, 40))
    estimate = np.full((40, 40), 9.0)
    estimate[15:25, 15:25] = 0
    assert score(estimate, truth)["mse_x100"] == 0
    estimate[15, 15] = 1
    assert score(estimate, truth)["badpix_0.07"] == pytest.approx(1)


def test_what_cannot_be_scored_is_refused():
    with pytest.raises(ValueError, match="differ in shape"):
        score(np.zeros((40, 40)), np.zeros((40, 41)))
    with pytest.raises(ValueError, match="has truth"):
        score(np.zeros((30, 30)), np.zeros((30, 30)) * np.nan, border_px=0)
