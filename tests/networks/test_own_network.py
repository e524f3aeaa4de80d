"""Nothing asks which network it has in hand, and a stranger's network does what ours do."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import epinet
from epinet.errors import InputError
from epinet.networks.registry import network_type
from epinet.networks.weights import load_weights
from epinet.synth.dataset import write_dataset
from epinet.synth.options import Options

SOURCE = Path(epinet.__file__).parent
EXAMPLES = SOURCE.parent.parent / "examples"
KERAS = Path("commands/weights.py")
"""Imports weights of the paper's own code, which are EPINET's."""


def test_only_a_networks_own_folder_knows_it():
    for file in SOURCE.rglob("*.py"):
        place = file.relative_to(SOURCE)
        if place.parts[0] == "networks":
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and place != KERAS:
                ours = ("epinet.networks.epinet", "epinet.networks.sweepnet")
                assert not (node.module or "").startswith(ours), place
            if isinstance(node, ast.Compare):
                compared = {n.value for n in ast.walk(node) if isinstance(n, ast.Constant)}
                assert not compared & {"epinet", "sweepnet"}, f"{place}:{node.lineno}"


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> Path:
    options = Options(size=(64, 64), views=3, samples=1, disparity_px=(-1, 1))
    folder = tmp_path_factory.mktemp("scenes") / "set"
    write_dataset(folder, options, 5, scenes=3)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory, scenes) -> Path:
    """Where a stranger has the example, and has trained it for a moment."""
    folder = tmp_path_factory.mktemp("stranger")
    for name in ("plane_sweep.py", "plane_sweep.yaml"):
        (folder / name).write_text((EXAMPLES / name).read_text())
    changes = ("steps=3", "views=3", "batch=2", "patch_px=8", "validate_every=3")
    sets = [part for change in changes for part in ("--set", change)]
    recipe = ("--recipe", "plane_sweep.yaml", "--data", str(scenes), "-o", "run")
    run(folder, "train", *recipe, *sets, "--set", "augmentations=[rotation]")
    return folder


def run(folder: Path, *arguments: str, status: int = 0) -> str:
    command = [sys.executable, "-m", "epinet", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done.stdout + done.stderr


WEIGHTS = ("--model", "plane_sweep:PlaneSweep", "--weights", "run/weights.safetensors")


def test_a_strangers_network_predicts_and_is_evaluated(folder, scenes):
    scene = sorted(p for p in scenes.iterdir() if p.is_dir())[0]
    run(folder, "predict", str(scene), "-o", "out", *WEIGHTS)
    map_ = np.load(folder / "out" / scene.name / "disparity.npy")
    assert map_.shape == (64, 64) and np.isfinite(map_).all()
    kept = json.loads((folder / "out" / scene.name / "run.json").read_text())
    assert kept["settings"]["range_px"] is not None  # of the views: it asks for a search


def test_its_code_runs_only_for_those_who_name_it(folder, scenes):
    said = run(folder, "predict", str(scenes), "-o", "no", *WEIGHTS[2:], status=2)
    assert "give --model 'plane_sweep:PlaneSweep'" in said
    assert not (folder / "no").exists()


def test_its_weights_hold_its_configuration(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    kind = network_type("plane_sweep:PlaneSweep")
    weights = load_weights(folder / "run" / "weights.safetensors")
    assert type(weights.net) is kind
    assert weights.net.config == kind.Config()
    assert weights.model == "plane_sweep:PlaneSweep"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("nowhere:Net", "No module named 'nowhere'"),
        ("json:JSONDecoder", "json has no class JSONDecoder that is a Network"),
        ("elsewhere", "there are sweepnet, epinet"),
    ],
)
def test_a_name_that_names_no_network(name, says):
    with pytest.raises(InputError, match=says):
        network_type(name)
