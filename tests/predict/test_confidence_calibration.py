"""The fitted confidence is the probability that it says."""

import numpy as np
import pytest

from epinet.predict.confidence import WITHIN_PX, Calibration


def test_a_fit_finds_the_calibration_that_errors_were_drawn_from():
    rng = np.random.default_rng(3)
    true = Calibration(even_px=0.21, steepness=1.7)
    expected = np.exp(rng.normal(-2.5, 1.2, 60_000)).astype(np.float32)
    good = rng.random(expected.shape) < true.confidence(expected)
    found = Calibration.fitted(expected, np.where(good, 0.5, 2.0) * WITHIN_PX)
    assert found.even_px == pytest.approx(0.21, rel=0.05)
    assert found.steepness == pytest.approx(1.7, rel=0.05)


def test_of_the_estimates_with_a_confidence_so_many_are_good():
    """Whatever their errors are distributed like: here with tails far heavier than Laplace's."""
    rng = np.random.default_rng(4)
    expected = np.exp(rng.normal(-3, 1, 200_000))
    errors = 0.3 * expected * np.abs(rng.standard_t(1.2, expected.shape))
    confidence = Calibration.fitted(expected, errors).confidence(expected.astype(np.float32))
    for low in np.arange(0.1, 0.9, 0.2):
        chosen = (confidence >= low) & (confidence < low + 0.2)
        share = (errors[chosen] <= WITHIN_PX).mean()
        assert share == pytest.approx(confidence[chosen].mean(), abs=0.04)


def test_half_are_good_at_the_even_error_and_fewer_beyond_it():
    calibration = Calibration(even_px=0.1, steepness=2.0)
    confidence = calibration.confidence(np.array([1e-4, 0.1, 1.0], np.float32))
    assert confidence == pytest.approx([1.0, 0.5, 1 / 101], abs=1e-4)
