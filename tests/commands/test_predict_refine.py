"""What `epinet predict` takes for a capture, and how `--refine` is asked for and recorded."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from epinet.errors import InputError
from epinet.io import LAYOUTS, read_light_field, write_light_field
from epinet.lightfield import LightField

ENDINGS = {"hci_hdf5": ".h5", "lftoolbox": ".mat", "array": ".npz"}


def predict(path: Path, *more: str) -> tuple[str, dict[str, object]]:
    """What it prints, and the run.json of the result."""
    done = subprocess.run(
        [sys.executable, "-m", "epinet", "predict", path, "-o", path.parent / "out", *more],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    run = json.loads((path.parent / "out" / path.name / "run.json").read_text())
    return done.stdout + done.stderr, run


@pytest.fixture
def lf() -> LightField:
    """A textured plane, 1 px per view nearer than the focus; one view is darker than the others."""
    texture = gaussian_filter(np.random.default_rng(0).normal(size=(66, 74, 3)), (1.5, 1.5, 0))
    texture = 0.5 + 0.12 * texture / texture.std()
    views = [[texture[r : r + 64, c : c + 72] for c in range(3)] for r in range(3)]
    views[0][0] = 0.8 * views[0][0]
    return LightField(np.round(255 * np.clip(views, 0, 1)).astype(np.uint8))


def test_a_capture_is_refined_unless_told_otherwise(lf, tmp_path):
    write_light_field(tmp_path / "shot", lf, "rows_cols")
    said, run = predict(tmp_path / "shot")
    assert ", refined," in said
    assert "note: shot: compensated: " in said and "exposures that differ by" in said
    assert run["settings"]["refine"] is True
    assert run["alignment"]["is_uneven"] and run["alignment"]["gains"][1] > 1.2
    assert any(note.startswith("compensated: ") for note in run["notes"])
    assert "done before" in predict(tmp_path / "shot")[0]
    said, run = predict(tmp_path / "shot", "--no-refine")
    assert ", refined," not in said and "done before" not in said and "compensated" not in said
    assert run["settings"]["refine"] is False and run["alignment"] is None


def test_a_rendered_scene_is_left_as_it_is_unless_asked(lf, tmp_path):
    write_light_field(tmp_path / "scene", lf, "hci")
    said, run = predict(tmp_path / "scene")
    assert ", refined," not in said and run["alignment"] is None
    said, run = predict(tmp_path / "scene", "--refine")
    assert ", refined," in said and run["settings"]["refine"] is True


WRITABLE = sorted(name for name, layout in LAYOUTS.items() if layout.write is not None)


@pytest.mark.parametrize("layout", sorted(set(WRITABLE) - {"eslf"}))  # which takes 9x9 views only
def test_what_a_camera_took_stays_so_in_every_layout(lf, tmp_path, layout):
    for captured in (True, False):
        path = tmp_path / f"{captured}{ENDINGS.get(layout, '')}"
        write_light_field(path, replace(lf, captured=captured), layout)
        expected = captured or layout not in ("hci", "hci_hdf5")
        assert read_light_field(path).captured == expected


def test_a_parameter_that_says_neither_is_refused(lf, tmp_path):
    write_light_field(tmp_path / "scene", replace(lf, captured=True), "hci")
    file = tmp_path / "scene" / "parameters.cfg"
    file.write_text(file.read_text().replace("captured = true", "captured = perhaps"))
    with pytest.raises(InputError, match=r"parameters\.cfg: captured = perhaps must be true"):
        read_light_field(tmp_path / "scene")


def test_info_says_how_views_are_aligned_and_exposed(lf, tmp_path):
    write_light_field(tmp_path / "shot", lf, "rows_cols")
    arguments = [sys.executable, "-m", "epinet", "info", tmp_path / "shot"]
    text = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    (line,) = (line for line in text.splitlines() if "alignment:" in line)
    assert "px (rms) out of place" in line and "exposures differ by" in line
    made = subprocess.run([*arguments, "--json"], capture_output=True, text=True, check=True)
    assert json.loads(made.stdout)["alignment"]["is_uneven"]
