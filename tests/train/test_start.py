"""What runs of EPINET begin with, and what of it their weights keep."""

from pathlib import Path

import pytest
import torch

from epinet.errors import InputError
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.epinet.classes import classes_of
from epinet.networks.weights import load_weights
from epinet.synth.dataset import write_dataset
from epinet.synth.options import Options
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import changed_recipe, load_recipe
from epinet.train.run import Run
from epinet.train.validation import Validation

TINY = load_recipe(
    "fast-9x9",
    {
        "views": 3,
        "width": 6,
        "batch": 2,
        "patch_px": 4,
        "steps": 4,
        "validate_every": 2,
        "identity": 0.7,
        "class_weight": 0.2,
    },
)


@pytest.fixture(scope="module")
def held_out(tmp_path_factory) -> Validation:
    options = Options(size=(48, 48), views=3, samples=1, held_out=True)
    folder = tmp_path_factory.mktemp("held_out") / "set"
    return Validation.of_folders(write_dataset(folder, options, 77, scenes=1), views=3)


def begun(folder: Path, held_out: Validation, **changes: object) -> Run:
    recipe = Recipe.of(TINY.as_dict() | changes)
    return Run(recipe, folder, validation=held_out)


def test_weights_are_the_published_network_s(tmp_path, held_out):
    """Neither norms nor classes are in them, and they give what the trained network gives."""
    run = begun(tmp_path, held_out, fixed_norms_from=0.0, averaging=0.0)
    run.train()
    saved = load_weights(tmp_path / "weights.safetensors").net
    assert isinstance(saved, Epinet)
    config = EpinetConfig(views=3, stream_width=6)
    assert saved.config == config
    assert set(saved.state_dict()) == set(Epinet(config).state_dict())
    assert sum(p.numel() for p in saved.parameters()) == config.parameters
    stacks = torch.rand(1, 4, 3, 40, 40)
    with torch.no_grad():
        trained = run.net.eval()(stacks)
        # Weights are stored in half precision.
        torch.testing.assert_close(saved(stacks), trained, rtol=2e-2, atol=2e-2)


def test_classes_learn_and_a_run_continues_with_them(tmp_path, held_out):
    whole = begun(tmp_path / "whole", held_out)
    before = classes_of(whole.net).last.weight.clone()
    whole.train()
    learned = classes_of(whole.net).last.weight
    assert not torch.equal(learned, before)
    first = begun(tmp_path / "parts", held_out)
    for _ in range(2):
        first._train_step()
    first.save()
    second = begun(tmp_path / "parts", held_out)
    second.train()
    assert torch.equal(classes_of(second.net).last.weight, learned)


def test_classes_change_what_is_learned(tmp_path, held_out):
    one, other = (
        begun(tmp_path / str(weight), held_out, class_weight=weight) for weight in (0.0, 0.2)
    )
    for run in (one, other):
        run._train_step()
    assert not torch.equal(one.net.merge[3][2].weight, other.net.merge[3][2].weight)


def test_a_wide_run_starts_from_what_a_narrow_one_learned(tmp_path, held_out):
    begun(tmp_path / "narrow", held_out).train()
    weights = tmp_path / "narrow" / "weights.safetensors"
    start = {"start": str(weights), "identity": 0.0, "fixed_norms_from": 0.0}
    wide = begun(tmp_path / "wide", held_out, width=9, **start)
    narrow = load_weights(weights).net
    stacks = torch.rand(1, 4, 3, 40, 40)
    with torch.no_grad():
        torch.testing.assert_close(wide.net.eval()(stacks), narrow(stacks), rtol=1e-3, atol=1e-3)
    wide.train()
    assert load_weights(tmp_path / "wide" / "weights.safetensors").net.config.stream_width == 9
    with pytest.raises(InputError, match="width of 6 are no start for one of 5"):
        begun(tmp_path / "narrower", held_out, width=5, **start)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("identity=1", "identity"),
        ("identity=-0.1", "identity"),
        ("width=0", "width"),
        ("class_weight=-1", "class_weight"),
    ],
)
def test_impossible_values_name_themselves(change, named):
    with pytest.raises(InputError, match=named):
        changed_recipe("fast-9x9", [change], [], [])


def test_the_identity_is_of_starts_from_scratch():
    with pytest.raises(InputError, match="identity: takes a start from scratch"):
        changed_recipe("fast-9x9", ["identity=0.5", "start=epinet_9x9"], [], [])


@pytest.mark.parametrize("change", ["identity=0.5", "width=16", "class_weight=0.1"])
def test_sweepnet_has_none_of_it(change):
    with pytest.raises(InputError, match=change.split("=")[0]):
        changed_recipe("sweepnet", [change], [], [])
