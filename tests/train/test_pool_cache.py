"""Kept scenes are those that would be rendered, and other scenes are never taken for them."""

from pathlib import Path

import pytest
import torch

from epinet.errors import InputError
from epinet.synth.generator import generator
from epinet.synth.options import Options
from epinet.train import sources
from epinet.train.batches import batches_of
from epinet.train.recipe_files import load_recipe
from epinet.train.sources import Needs, Rendered

TINY = {"views": 3, "batch": 2, "patch_px": 4}


def cut(cache: Path | None, step: int = 0, **changes):
    values = {"seed": 1, "count": 2, "side_px": 16} | changes
    kinds = [(Options(samples=1), 1.0)]
    source = Rendered(kinds, Needs(values.pop("views", 3)), cache=cache, **values)
    frames = source.draw(generator(1), step, torch.tensor([16, 16]))
    return source.cut(step, frames, source.needs.offsets)


def no_rendering(*args, **kwargs):
    raise AssertionError("rendered")


def test_kept_scenes_are_those_that_are_rendered(tmp_path, monkeypatch):
    rendered = cut(None)
    first = cut(tmp_path / "new")
    monkeypatch.setattr(sources, "pools", no_rendering)
    again = cut(tmp_path / "new")
    for name in ("views", "disparity", "usable"):
        assert torch.equal(getattr(rendered, name), getattr(first, name))
        assert torch.equal(getattr(rendered, name), getattr(again, name))
    with pytest.raises(AssertionError, match="rendered"):
        cut(None)


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 2},
        {"count": 3},
        {"side_px": 18},
        {"views": 5},
        {"gray": False},
        {"reach": lambda step: 0.5},
        {"step": 1},
    ],
)
def test_other_scenes_are_rendered(tmp_path, monkeypatch, changes):
    cut(tmp_path)
    monkeypatch.setattr(sources, "pools", no_rendering)
    with pytest.raises(AssertionError, match="rendered"):
        cut(tmp_path, **changes)


def test_a_damaged_file_names_itself(tmp_path):
    cut(tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(InputError, match=rf"{file.name}: .*remove the file"):
        cut(tmp_path)


def test_photographs_are_not_kept(tmp_path):
    recipe = load_recipe("fast-9x9", TINY | {"textures": str(tmp_path)})
    with pytest.raises(InputError, match="photographs"):
        batches_of(recipe, [0], cache=tmp_path / "cache")
