"""Holes take the values of what looks alike around them; what is trusted is left to the median."""

import numpy as np
import torch

import epinet
from epinet.metrics.disparity import score
from epinet.refine import refined
from epinet.refine.holes import HOLE_CONFIDENCE
from epinet.refine.median import weighted_median
from epinet.synth.generator import render_scene
from epinet.synth.options import Faults, Options


def two_surfaces(size=(60, 80)):
    """A map that follows the colours of its picture, and that picture."""
    right = torch.arange(size[1]).expand(size) > size[1] // 2
    guide = torch.where(right[..., None], torch.tensor([0.8, 0.6, 0.5]), torch.tensor(0.4))
    return torch.where(right, 1.5, -0.25), guide


def test_a_large_hole_across_an_edge_is_filled_on_either_side():
    truth, guide = two_surfaces()
    hole = torch.zeros(truth.shape, dtype=torch.bool)
    hole[18:43, 20:60] = True
    noise = torch.randn(truth.shape, generator=torch.Generator().manual_seed(0))
    confidence = torch.where(hole, 0.1, 0.9)
    assert torch.equal(refined(torch.where(hole, noise, truth), guide, confidence), truth)


def test_trusted_pixels_are_left_to_the_median():
    g = torch.Generator().manual_seed(1)
    values, confidence = torch.rand(2, 40, 50, generator=g)
    guide = torch.rand(40, 50, 3, generator=g) / 8
    found, median = refined(values, guide, confidence), weighted_median(values, guide, confidence)
    trusted = confidence >= HOLE_CONFIDENCE
    assert torch.equal(found[trusted], median.values[trusted])
    assert not torch.equal(found, median.values)


def test_a_hole_of_a_colour_of_its_own_keeps_the_median():
    truth, guide = two_surfaces()
    guide[20:40, 30:50] = 0
    values = truth.clone()
    values[20:40, 30:50] = 7
    confidence = torch.where(values == 7, 0.1, 0.9)
    assert torch.equal(refined(values, guide, confidence), values)


def test_without_any_trust_a_map_stays():
    values = torch.rand(20, 30, generator=torch.Generator().manual_seed(2))
    assert torch.equal(refined(values, torch.zeros(20, 30, 3), torch.zeros(20, 30)), values)


def test_maps_of_noisy_scenes_get_better():
    """EPINET's, as in the paper; what SweepNet's gain is measured in docs/refinement.md."""
    estimator = epinet.load_model(model="epinet", device="cpu")
    faults = Faults(0, 0, 0.6, 0, 0, 0, 0, full=True)
    before, after = [], []
    for index in range(2):
        options = Options(size=(128, 128), reflective=0, surfaces=(4, 8), faults=faults)
        lf = render_scene(options, 31, index, star_only=True)
        result = estimator.predict(lf)
        images = (result.disparity, lf.unit(*lf.centre), result.confidence)
        better = refined(*(torch.from_numpy(np.ascontiguousarray(i)) for i in images))
        before.append(score(result.disparity, lf.truth)["badpix_0.07"])
        after.append(score(better.numpy(), lf.truth)["badpix_0.07"])
    assert np.mean(after) < np.mean(before)
