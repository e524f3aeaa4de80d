"""Batches, the schedule, and a run that is interrupted and goes on."""

import json

import numpy as np
import pytest
import torch

from epinet.angular import direction_positions
from epinet.errors import InputError
from epinet.model.checkpoint import load_weights
from epinet.synth.generator import star_offsets
from epinet.train import loop
from epinet.train.batches import BatchSource, stack_star, textured
from epinet.train.loop import Recipe, Run

TINY = Recipe(views=3, steps=4, batch=2, patch=4, warmup_steps=2, validate_every=2)


@pytest.fixture(autouse=True)
def _small_validation(monkeypatch):
    stacks, truth = torch.rand(2, 4, 3, 26, 26), torch.zeros(2, 1, 4, 4)
    monkeypatch.setattr(loop, "validation_set", lambda *_: (stacks, truth))


def test_stacks_hold_each_view_where_the_network_expects_it():
    offsets = star_offsets(5)
    star = torch.arange(len(offsets)).view(1, -1, 1, 1).float()
    stacks = stack_star(star, 5)[0, :, :, 0, 0]
    for stack, direction in zip(stacks, (90, 0, 45, -45), strict=True):
        expected = [offsets.index((r - 2, c - 2)) for r, c in direction_positions(direction, 5)]
        assert stack.tolist() == expected


def test_a_batch_depends_on_seed_and_step_alone():
    bounds = (-1.0, 1.0)
    walked = BatchSource(3, 2, 4, seed=1)
    for step in range(3):
        last = walked(step, bounds)
    jumped = BatchSource(3, 2, 4, seed=1)(2, bounds)
    assert torch.equal(last.stacks, jumped.stacks)
    assert torch.equal(last.disparity, jumped.disparity)
    other = BatchSource(3, 2, 4, seed=2)(2, bounds)
    assert not torch.equal(last.stacks, other.stacks)


def test_batches_are_light_fields_with_their_truth():
    """The middle of each stack is the centre view, and truth explains its neighbours."""
    batch = BatchSource(3, 8, 24, seed=4)(0, (-2.0, 2.0))
    assert batch.stacks.shape == (8, 4, 3, 46, 46)
    assert batch.disparity.shape == (8, 1, 24, 24)
    assert all(torch.equal(batch.stacks[:, 0, 1], batch.stacks[:, s, 1]) for s in range(4))
    residuals = {}
    for sign in (1, -1):
        d = sign * batch.disparity[:, 0]
        y, x = torch.meshgrid(torch.arange(24.0), torch.arange(24.0), indexing="ij")
        at = torch.stack([(x + 11 - d) / 45 * 2 - 1, (y + 11).expand_as(d) / 45 * 2 - 1], -1)
        right = batch.stacks[:, 1, 2:3]  # the view one column to the right
        seen = torch.nn.functional.grid_sample(right, at, align_corners=True)[:, 0]
        residuals[sign] = (seen - batch.stacks[:, 1, 1, 11:-11, 11:-11]).abs().mean()
    assert residuals[1] < 0.6 * residuals[-1]


def test_textureless_surroundings_are_rejected_as_published():
    """Against the definition in plain loops: mean |p - p_centre| over 23x23, at least .02."""
    centre = torch.rand(1, 1, 26, 25, generator=torch.Generator().manual_seed(0)) * 0.07
    weights = textured(centre, threshold=0.02)
    assert weights.shape == (1, 1, 4, 3)
    image = centre[0, 0].numpy()
    for row in range(4):
        for col in range(3):
            patch = image[row : row + 23, col : col + 23]
            expected = np.mean(np.abs(patch - patch[11, 11])) >= 0.02
            assert bool(weights[0, 0, row, col]) == expected
    assert 0 < weights.mean() < 1


def test_the_range_widens_and_the_rate_falls():
    recipe = Recipe()
    assert recipe.disparity_range(0) == (-recipe.narrow_px, recipe.narrow_px)
    assert recipe.disparity_range(recipe.steps) == pytest.approx((-4.0, 4.0))
    assert recipe.rate(0) < recipe.rate(recipe.warmup_steps)
    assert recipe.rate(recipe.steps - 1) < 1e-3 * recipe.learning_rate


def test_an_interrupted_run_equals_an_uninterrupted_one(tmp_path):
    whole = Run(TINY, tmp_path / "whole", say=lambda line: None)
    whole.train()

    class InterruptedRunError(Exception):
        pass

    first = Run(TINY, tmp_path / "parts", say=lambda line: None)
    step = first._train_step

    def stop_after_three(batch):
        if first.step == 3:
            raise InterruptedRunError
        return step(batch)

    first._train_step = stop_after_three
    with pytest.raises(InterruptedRunError):
        first.train(save_every_s=0)
    second = Run(TINY, tmp_path / "parts", say=lambda line: None)
    assert second.step == 3
    second.train()
    for a, b in zip(whole.net.parameters(), second.net.parameters(), strict=True):
        assert torch.equal(a, b)


def test_a_run_leaves_weights_that_say_what_they_are(tmp_path):
    Run(TINY, tmp_path, say=lambda line: None).train()
    weights = load_weights(tmp_path / "weights.safetensors")
    assert weights.net.config.views == 3
    assert weights.metadata["steps"] == 4
    assert weights.metadata["recipe"]["patch"] == 4
    assert weights.disparity_range_px == (-4, 4)
    history = json.loads((tmp_path / "run.json").read_text())["history"]
    assert [h["step"] for h in history] == [2, 4]
    assert {"badpix_0.07", "mse_x100"} <= set(history[0]["scores"])
    with pytest.raises(InputError, match="another recipe"):
        Run(Recipe(views=3, steps=5), tmp_path, say=lambda line: None)
