"""The validation set: what is in it, and that it is made once and then kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.synth import dataset
from epinet.synth.generator import VERSION, render_scene
from epinet.synth.options import RANGES_PX, Options
from epinet.synth.validation import (
    VALIDATION_SEED,
    make_validation,
    validation_folder,
    validation_parts,
)


@pytest.fixture
def drawn(monkeypatch) -> list[tuple[Options, int, int]]:
    """(options, seed, index) of each scene that is rendered; the scenes are small."""
    asked = []

    def draw(options, seed, index, device, *, star_only, textures, truths=False):
        assert star_only
        asked.append((options, seed, index))
        return render_scene(replace(options, size=(24, 32)), seed, index, star_only=True)

    monkeypatch.setattr(dataset, "render_scene", draw)
    return asked


def test_parts():
    parts = validation_parts()
    assert {name: len(each) for name, each in parts.items()} == {
        "textured": 4,
        "textureless": 2,
        "reflective": 2,
        "thin": 2,
        "noisy": 2,
        "narrow": 2,
        "wide": 2,
    }
    every = [options for each in parts.values() for options in each]
    assert all(o.held_out and o.size == (512, 512) and o.views == 9 for o in every)
    for part, each in parts.items():
        range_ = RANGES_PX.get(part, RANGES_PX["hci"])
        assert all(o.disparity_px == range_ for o in each)
        assert all(o.faults.full == (part == "noisy") for o in each)
        assert all((o.thin > 0.5) == (part == "thin") for o in each)
        assert all((o.reflective >= 0.5) == (part == "reflective") for o in each)
        assert all((o.textureless >= 0.5) == (part == "textureless") for o in each)


def test_made_once_and_continued(tmp_path, drawn):
    parts = {name: validation_parts()[name][:2] for name in ("thin", "wide")}
    folder = make_validation(tmp_path / "set", parts=parts)
    assert [options for options, _, _ in drawn] == [*parts["thin"], *parts["wide"]]
    assert [(seed, index) for _, seed, index in drawn] == [(VALIDATION_SEED, i) for i in range(4)]
    scenes = {p.name: read_light_field(p) for p in folder.iterdir() if p.is_dir()}
    assert sorted(scenes) == ["thin_0", "thin_1", "wide_0", "wide_1"]
    assert all(lf.present.sum() == 33 for lf in scenes.values())
    assert len({lf.truth.tobytes() for lf in scenes.values()}) == 4

    (folder / "wide_0").rename(tmp_path / "gone")
    drawn.clear()
    make_validation(folder, parts=parts)
    assert [index for _, _, index in drawn] == [2]
    again = read_light_field(folder / "wide_0")
    np.testing.assert_array_equal(again.views, scenes["wide_0"].views)
    np.testing.assert_array_equal(again.truth, scenes["wide_0"].truth)


def test_a_changed_set_is_not_mixed_with_the_old_one(tmp_path, drawn):
    (thin,) = validation_parts()["thin"][:1]
    make_validation(tmp_path, parts={"thin": (thin,)})
    with pytest.raises(InputError, match=r"parts.* there, .* here"):
        make_validation(tmp_path, parts={"thin": (replace(thin, thin=1.0),)})
    make_validation(tmp_path, parts={"thin": (replace(thin, thin=1.0),)}, existing="replace")
    assert drawn[-1][0].thin == 1.0


def test_where_it_is_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert validation_folder() == tmp_path / "epinet" / f"validation-{VERSION}"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert validation_folder() == tmp_path / "home/.cache/epinet" / f"validation-{VERSION}"
