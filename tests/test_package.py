"""What is shipped: the wheel, and how good its weights are on a scene never trained on."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

import epinet
from epinet.lightfield import LightField
from epinet.networks.registry import OURS
from epinet.networks.weights import load_weights, shipped_weights

ROOT = Path(__file__).parent.parent


def test_the_wheel_carries_the_weights(tmp_path):
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "-o", tmp_path, ROOT]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    shipped = ["sweepnet", *(f"epinet_{n}x{n}" for n in (9, 7, 5))]
    assert {Path(name).stem for name in names if name.endswith(".safetensors")} == set(shipped)
    assert "epinet/train/recipes/fast-9x9.yaml" in names
    assert "epinet/py.typed" in names
    assert not any(name.startswith("tests") for name in names)


def test_public_names_are_shown_and_documented():
    assert set(epinet.__all__) == {*epinet._HOMES, *epinet._MODULES}
    assert set(epinet.__all__) <= set(dir(epinet))
    for name in epinet.__all__:
        assert getattr(epinet, name) is not None
    reference = "".join(path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md"))
    for name, home in epinet._HOMES.items():
        assert f"::: {home}.{name}\n" in reference, name
    with pytest.raises(AttributeError, match="no attribute 'predict_all'"):
        _ = epinet.predict_all


def test_import_is_cheap():
    """Neither torch nor anything else that is large is loaded before it is used."""
    code = "import sys, epinet; dir(epinet); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    large = {"torch", "numpy", "scipy", "matplotlib", "pydantic", "h5py", "typer", "PIL"}
    assert not large & set(run.stdout.split())


def test_what_is_imported_is_asked_for():
    """By pyproject.toml; OpenCV, of which there are several packages, is for films alone."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = {re.match(r"[\w-]+", line)[0] for line in declared["dependencies"]}
    others = {"PIL": "pillow", "yaml": "pyyaml", "fast_simplification": "fast-simplification"}
    optional = {"cv2", "drjit", "mitsuba", "tensorboard"}
    found = set()
    for file in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").split(".")[0])
            if isinstance(node, ast.Import) and any(a.name == "cv2" for a in node.names):
                assert file.name == "wiggle.py"
    found -= {"epinet", *sys.stdlib_module_names}
    assert {others.get(name, name) for name in found - optional} == wanted


@pytest.mark.parametrize("name", shipped_weights())
def test_shipped_weights_say_what_they_are(name):
    weights = load_weights(name)
    assert name.startswith(weights.model)
    assert weights.metadata["data"].keys() == {"generator", "seed"}
    assert weights.metadata["steps"] == weights.metadata["recipe"]["steps"]
    assert {"badpix_0.07", "mse_x100"} <= set(weights.metadata["scores"])


@pytest.mark.parametrize("model", OURS)
def test_antinous_beats_a_constant_map_tenfold(real, model):
    lf = epinet.read_light_field(real / "antinous")
    scores = epinet.load_model(model=model).predict(lf).scores
    assert lf.truth is not None and scores is not None
    inner = lf.truth[15:-15, 15:-15]
    assert scores["mse_x100"] < 0.1 * 100 * np.var(inner)


def test_the_python_of_the_readme(tmp_path, monkeypatch):
    """Runs as it stands, on a scene put where it expects one."""
    readme = (ROOT / "README.md").read_text()
    code = readme.split("```python\n")[1].split("```")[0]
    views = np.broadcast_to(
        np.random.default_rng(0).integers(0, 256, (24, 30, 3)), (9, 9, 24, 30, 3)
    )
    monkeypatch.chdir(tmp_path)
    lf = LightField(np.ascontiguousarray(views.astype(np.uint8)))
    epinet.write_light_field("scenes/scene_00000", lf, "hci")
    exec(compile(code, "README.md", "exec"), {})
    assert (tmp_path / "out" / "scene_00000" / "disparity.pfm").exists()
