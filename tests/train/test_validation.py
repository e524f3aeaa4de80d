"""Scenes that a training is validated on: taken as they are, or refused before it begins."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from epinet.errors import InputError
from epinet.io import read_light_field, write_light_field
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.weights import Weights
from epinet.synth.generator import render_scene
from epinet.synth.options import Options
from epinet.train.validation import Validation


@pytest.fixture(scope="module")
def scene():
    return render_scene(Options(size=(64, 72), views=3, samples=1, held_out=True), 5, 0)


def test_a_captured_scene_scores_the_networks_own_map(scene, tmp_path):
    """Neither compensated before nor smoothed after, under the autocast of training, too."""
    np.savez(tmp_path / "shot.npz", views=scene.views, truth=scene.truth)
    lf = read_light_field(tmp_path / "shot.npz")
    assert lf.captured
    weights = Weights(Epinet(EpinetConfig(views=3)).eval(), {}, "made here")
    results = Validation({"shot": lf}).predict(weights, torch.device("cpu"), bf16=True)
    assert results["shot"].settings["refine"] is False


def test_scenes_that_cannot_score_are_named_before_training(scene, tmp_path):
    unknown = np.full_like(scene.truth, np.nan)
    unknown[0] = 1.0  # within the border that is left out
    write_light_field(tmp_path / "unknown", replace(scene, truth=unknown), "hci")
    black = scene.views.copy()
    black[0, 0] = 0
    write_light_field(tmp_path / "black.npz", replace(scene, views=black), "array")
    with pytest.raises(InputError) as error:
        Validation.of_folders([tmp_path / "unknown", tmp_path / "black.npz"], views=3)
    text = "\n".join(error.value.problems)
    assert "unknown: no truth" in text and "black" in text and "(0, 0)" in text


def test_scenes_of_one_name_are_refused(scene, tmp_path):
    """One would take the other's place."""
    folders = [tmp_path / kind / "boxes" for kind in ("a", "b")]
    for folder in folders:
        write_light_field(folder, scene, "hci")
    assert len(Validation.of_folders(folders[:1], views=3).scenes) == 1
    with pytest.raises(InputError, match="b/boxes: another scene to validate on is named boxes"):
        Validation.of_folders(folders, views=3)


def test_a_scene_that_is_all_border_is_refused(tmp_path):
    small = render_scene(Options(size=(30, 40), views=3, samples=1, held_out=True), 5, 0)
    write_light_field(tmp_path / "small", small, "hci")
    with pytest.raises(InputError, match="small: no truth to validate with"):
        Validation.of_folders([tmp_path / "small"], views=3)


def test_mirrors_do_not_count(scene, tmp_path):
    """Where a mirror shows something else, no network can know the truth."""
    mirror = np.zeros(scene.size, bool)
    mirror[20:40, 20:40] = True
    write_light_field(tmp_path / "mirror", replace(scene, masks={"invalid": mirror}), "hci")
    (judged,) = Validation.of_folders([tmp_path / "mirror"], views=3).scenes.values()
    np.testing.assert_array_equal(np.isnan(judged.truth), mirror)
    everywhere = np.ones(scene.size, bool)
    write_light_field(tmp_path / "all", replace(scene, masks={"invalid": everywhere}), "hci")
    with pytest.raises(InputError, match="all: no truth"):
        Validation.of_folders([tmp_path / "all"], views=3)


def test_rendered_scenes_are_no_mirrors():
    scenes = Validation.rendered(3, (-4.0, 4.0), number=8).scenes
    assert len(scenes) == 8
    for lf in scenes.values():
        known = np.isfinite(lf.truth)
        np.testing.assert_array_equal(known, ~lf.masks["invalid"])
        assert known[15:-15, 15:-15].mean() >= 0.5
    assert not all(np.isfinite(lf.truth).all() for lf in scenes.values())  # the law was put to use


def test_of_a_folder_scenes_that_do_not_apply_are_left_out(scene, tmp_path, caplog):
    caplog.set_level("INFO", "epinet.train.scenes")
    folder = tmp_path / "all" / "hci"
    write_light_field(folder / "training" / "boxes", scene, "hci")
    write_light_field(folder / "training" / "taken", scene, "hci")
    write_light_field(folder / "test" / "herbs", replace(scene, truth=None), "hci")
    np.save(folder / "map.npy", np.ones((40, 50)))
    taken = [folder / "training" / "taken"]
    found = Validation.of_folders([tmp_path / "all"], 3, taken)
    assert list(found.scenes) == ["boxes"]
    assert sorted(record.message for record in caplog.records) == [
        f"left out: {folder / 'test' / 'herbs'}: no truth to validate with inside the border of 15 "
        "px",
        f"left out: {folder / 'training' / 'taken'}: is trained on; validate on other scenes",
    ]
    with pytest.raises(InputError, match="herbs: no truth"):
        Validation.of_folders([folder, folder / "test" / "herbs"], 3)
    with pytest.raises(InputError, match="herbs: no truth"):
        Validation.of_folders([folder / "test"], 3)
    with pytest.raises(InputError, match="3x3"):
        Validation.of_folders([folder], 5)
