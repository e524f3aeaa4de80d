"""SweepNet's loss against its definition, written out pixel by pixel."""

import math

import numpy as np
import pytest
import torch

from epinet.networks.robust import FAR
from epinet.networks.sweepnet.estimates import Estimates
from epinet.networks.sweepnet.loss import CLASSES, EARLIER, ERROR, MARGIN_PX, sweepnet_loss

SIDE_PX = 4
SCALE_PX = 0.05
HYPOTHESES = np.linspace(-1, 1, 5)


@pytest.fixture(params=[2, 4, 8])
def example(request):
    """Of a sweep whose pixels are so many wide and high."""
    g = torch.Generator().manual_seed(3)
    whole = SIDE_PX + 2 * MARGIN_PX
    estimates = Estimates(
        [torch.randn(2, 1, whole, whole, generator=g) for _ in range(3)],
        0.3 * torch.randn(2, 1, whole, whole, generator=g),
        torch.randn(2, 5, *2 * [math.ceil(whole / request.param)], generator=g),
        torch.tensor(HYPOTHESES, dtype=torch.float32),
    )
    truth = torch.randn(2, 1, SIDE_PX, SIDE_PX, generator=g)
    weight = torch.rand(2, 1, SIDE_PX, SIDE_PX, generator=g)
    return estimates, truth, weight


def slow(estimates: Estimates, truth, weight) -> float:
    total = weight.sum().item()
    side = 2 ** round(math.log2(estimates.maps[0].shape[-1] / estimates.scores.shape[-1]))
    loss = 0.0
    for b, y, x in np.ndindex(2, SIDE_PX, SIDE_PX):
        share = weight[b, 0, y, x].item() / total
        row, col = y + MARGIN_PX, x + MARGIN_PX
        t = truth[b, 0, y, x].item()
        errors = [abs(m[b, 0, row, col].item() - t) for m in estimates.maps]
        for error, w in zip(errors, (EARLIER, EARLIER, 1.0), strict=True):
            loss += share * w * (SCALE_PX * math.log(1 + error / SCALE_PX) + FAR * error)
        log_b = estimates.log_error[b, 0, row, col].item()
        loss += share * ERROR * (errors[-1] / math.exp(log_b) + log_b)
        wanted = np.exp(-2 * abs(HYPOTHESES - t) / 0.5)
        wanted /= wanted.sum()
        scores = estimates.scores[b, :, row // side, col // side].numpy()
        loss += share * CLASSES * -(wanted * (scores - np.log(np.exp(scores).sum()))).sum()
    return loss


def test_the_loss_follows_its_definition(example):
    assert sweepnet_loss(*example, SCALE_PX).item() == pytest.approx(slow(*example), rel=1e-4)


def test_pixels_without_weight_do_not_count(example):
    estimates, truth, weight = example
    weight[:, :, 0] = 0
    changed = truth.clone()
    changed[:, :, 0] += 100
    one, other = (sweepnet_loss(estimates, t, weight, SCALE_PX).item() for t in (truth, changed))
    assert one == pytest.approx(other, rel=1e-6)


def test_the_expected_error_is_least_unlikely_at_the_mean_error(example):
    """Per pixel of the same prediction; and its gradient leaves the map alone."""
    estimates, truth, weight = example
    final = estimates.maps[-1][..., MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
    mean = ((final - truth).abs() * weight).sum() / weight.sum()
    losses = [
        sweepnet_loss(
            estimates._replace(log_error=torch.full_like(estimates.log_error, mean.log() + by)),
            truth,
            weight,
            SCALE_PX,
        ).item()
        for by in (-0.1, 0.0, 0.1)
    ]
    assert losses[1] < min(losses[0], losses[2])
