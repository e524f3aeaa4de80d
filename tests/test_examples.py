"""The tutorials run as they stand, on what they render themselves, at a small size."""

import os
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
LEAVES = {
    "01": "result/expected_error.pfm",
    "02": "mesh.glb",
    "03": "near.png",
    "04": "report/scores.tex",
    "05": "run/weights.safetensors",
}
"""A file that each leaves."""


def test_tutorials_are_numbered_and_told_of():
    page = (ROOT / "docs" / "tutorials.md").read_text()
    assert [path.name[:2] for path in EXAMPLES] == [f"{n:02}" for n in range(1, len(EXAMPLES) + 1)]
    assert all(f"`{path.name}`" in page for path in EXAMPLES)


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_a_tutorial_runs_as_it_stands(script, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path), "64"])
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p not in ("", os.fspath(ROOT))])
    runpy.run_path(str(script), run_name="__main__")
    number = script.name[:2]
    assert (tmp_path / number / LEAVES[number]).exists()
    assert capsys.readouterr().out
