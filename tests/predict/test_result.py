"""The result folder, and batches that resume."""

import json
import os
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from PIL import Image
from scipy.io import savemat

import epinet
from epinet.benchmark.scenes import scene_folders
from epinet.errors import InputError
from epinet.io import read_light_field, read_pfm, write_light_field
from epinet.lightfield import LightField
from epinet.predict.batch import (
    Options,
    Reading,
    check_name,
    check_names,
    find_light_fields,
    predict_all,
)
from epinet.predict.ownership import files_of
from epinet.predict.result import FILES


@contextmanager
def silent(label):
    yield lambda share: None


@pytest.fixture
def lf() -> LightField:
    rng = np.random.default_rng(0)
    views = np.repeat(rng.integers(0, 256, (1, 34, 40, 3)), 25, 0).reshape(5, 5, 34, 40, 3)
    return LightField(views.astype(np.uint8), truth=np.zeros((34, 40), np.float32))


def test_a_result_folder_holds_everything(estimator, lf, tmp_path):
    result = estimator.predict(lf)
    folder = result.save(tmp_path / "new" / "out")
    assert {p.name for p in folder.iterdir()} == FILES
    np.testing.assert_array_equal(read_pfm(folder / "disparity.pfm"), result.disparity)
    np.testing.assert_array_equal(np.load(folder / "disparity.npy"), result.disparity)
    confidence = np.asarray(Image.open(folder / "confidence.png")) / 65535
    np.testing.assert_allclose(confidence, result.confidence, atol=1e-5)
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "centre.png")), lf.views[2, 2])
    coloured = Image.open(folder / "disparity.png")
    assert coloured.height >= 34 and coloured.width > 40
    run = json.loads((folder / "run.json").read_text())
    assert run["size_px"] == {"height": 34, "width": 40}
    assert run["scores"]["mse_x100"] == pytest.approx(result.scores["mse_x100"])
    assert set(run["seconds"]) == {"align", "prepare", "network", "confidence", "refine"}


def test_without_truth_there_are_no_scores(estimator, lf):
    assert estimator.predict(LightField(lf.views)).scores is None


def test_only_a_result_is_replaced(estimator, lf, tmp_path):
    result = estimator.predict(lf)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "holiday.jpg").write_text("dear to someone")
    with pytest.raises(InputError, match="a folder with other things in it"):
        result.save(tmp_path / "photos")
    assert (tmp_path / "photos" / "holiday.jpg").exists()
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="a file stands where"):
        result.save(tmp_path / "file")
    result.save(tmp_path / "twice")
    result.save(tmp_path / "twice")
    (tmp_path / "run").mkdir()
    for name in ("run.json", "last.pt"):  # a training run
        (tmp_path / "run" / name).write_text("{}")
    with pytest.raises(InputError, match=r"other things in it \(last\.pt\)"):
        result.save(tmp_path / "run")
    assert {p.name for p in tmp_path.iterdir()} == {"photos", "file", "twice", "run"}


def batch(estimator, paths, out, ensemble=False, force=False, range_px=None, names=()):
    return list(
        predict_all(
            estimator,
            paths,
            out,
            reading=Reading(),
            options=Options(ensemble=ensemble, range_px=range_px),
            names=names,
            force=force,
            progress=silent,
        )
    )


def test_a_batch_skips_what_is_done_and_goes_on_after_a_failure(estimator, lf, tmp_path):
    for name in "abc":
        write_light_field(tmp_path / "in" / name, lf, "hci")
    (tmp_path / "in" / "b" / "input_Cam012.png").write_bytes(b"broken")
    paths = find_light_fields([tmp_path / "in"])
    assert [p.name for p in paths] == ["a", "b", "c"]
    out = tmp_path / "out"
    first = batch(estimator, paths, out)
    assert [o.run is None for o in first] == [False, True, False]
    assert "input_Cam012.png" in first[1].problems[0]
    assert {p.name for p in out.iterdir()} == {"a", "c"}

    write_light_field(tmp_path / "in" / "b", lf, "hci", overwrite=True)
    again = batch(estimator, paths, out)
    assert [o.skipped for o in again] == [True, False, True]
    assert not any(o.skipped for o in batch(estimator, paths, out, force=True))
    assert not any(o.skipped for o in batch(estimator, paths, out, ensemble=True))


def test_a_folder_stands_for_the_light_fields_inside(lf, tmp_path, log):
    write_light_field(tmp_path / "views", lf, "hci")
    write_light_field(tmp_path / "stack.npz", lf, "array")
    lenslets = Image.fromarray(np.zeros((14 * 24, 14 * 30, 3), np.uint8))
    lenslets.save(tmp_path / "flower_eslf.png")
    Image.fromarray(lf.views[0, 0]).save(tmp_path / "photo.png")
    (tmp_path / "other").mkdir()
    (tmp_path / "readme.txt").touch()
    found = find_light_fields([tmp_path])
    assert [p.name for p in found] == ["flower_eslf.png", "stack.npz", "views"]
    assert len(log.messages) == 2
    assert str(tmp_path / "other") in log.messages[0]
    assert "photo.png, readme.txt in" in log.messages[1]


def stray_files(folder):
    """Files with the endings of light fields that hold something else; and one of no ending."""
    folder.mkdir(exist_ok=True)
    np.save(folder / "map.npy", np.ones((40, 50), np.float32))
    np.savez(folder / "maps.npz", a=np.ones((40, 50)), b=np.ones((40, 50, 3)))
    savemat(folder / "maps.mat", {"disparity": np.ones((40, 50))})
    for ending in ("h5", "hdf5"):
        with h5py.File(folder / f"weights.{ending}", "w") as file:
            file["kernel"] = np.ones((3, 3))
    with h5py.File(folder / "v73.mat", "w", userblock_size=512) as file:
        file["disparity"] = np.ones((40, 50))
    for name in (
        "text.npy",
        "text.npz",
        "text.mat",
        "text.h5",
        "notes",
        "photo.raw",
        "MOD_0001.RAW",
    ):
        (folder / name).write_text("No light field at all, whatever the ending says.\n" * 9)
    (folder / "empty.npy").touch()
    return {path.name for path in folder.iterdir()}


def test_files_that_hold_no_light_field_are_left_out_unless_they_are_alone(lf, tmp_path, log):
    strays = stray_files(tmp_path / "strays")
    endless = {"notes"}
    alone = find_light_fields([tmp_path / "strays"])
    assert {p.name for p in alone} == strays - endless
    assert find_light_fields([tmp_path / "strays" / "map.npy"]) == [tmp_path / "strays" / "map.npy"]
    for path in alone:
        with pytest.raises(InputError, match=path.name):
            read_light_field(path)

    stray_files(tmp_path / "mixed")
    write_light_field(tmp_path / "mixed" / "scene", lf, "hci")
    log.clear()
    found = find_light_fields([tmp_path / "mixed"])
    assert [p.name for p in found] == ["scene"]
    assert len(log.messages) == 1 and "and 4 more" in log.messages[0]


@pytest.mark.parametrize(
    ("name", "layout"),
    [("a.npy", "array"), ("a.npz", "array"), ("a.mat", "lftoolbox"), ("a.h5", "hci_hdf5")],
)
def test_a_damaged_light_field_is_not_left_out(lf, tmp_path, name, layout):
    write_light_field(tmp_path / "scene", lf, "hci")
    write_light_field(tmp_path / name, lf, layout)
    whole = (tmp_path / name).read_bytes()
    for damaged in (whole, whole[: len(whole) // 2], b"version https://git-lfs.github.com/spec/v1"):
        (tmp_path / name).write_bytes(damaged)
        assert [p.name for p in find_light_fields([tmp_path])] == [name, "scene"]


def test_light_fields_may_be_sorted_into_folders(lf, tmp_path, log):
    """As `evaluate` finds the benchmark's; but what lies in results there is none."""
    for name in ("boxes", "training/cotton", "full/additional/dots", "much/too/deep/vinyl"):
        write_light_field(tmp_path / name, lf, "hci")
    (tmp_path / "out" / "boxes").mkdir(parents=True)
    np.save(tmp_path / "out" / "boxes" / "disparity.npy", lf.views[0, 0, ..., 0])
    found = find_light_fields([tmp_path])
    assert sorted(p.name for p in found) == sorted(scene_folders(tmp_path))
    assert {p.name for p in found} == {"boxes", "cotton", "dots"}
    assert len(log.messages) == 2
    assert f"left out: {tmp_path / 'much'} " in log.messages[0]
    assert f"left out: {tmp_path / 'out'} " in log.messages[1]


def test_a_changed_input_is_predicted_again(estimator, lf, tmp_path):
    write_light_field(tmp_path / "a", lf, "hci")
    paths, out = [tmp_path / "a"], tmp_path / "out"
    batch(estimator, paths, out)
    assert batch(estimator, paths, out)[0].skipped
    later = (out / "a" / "run.json").stat().st_mtime + 5
    os.utime(tmp_path / "a" / "input_Cam000.png", (later, later))
    assert not batch(estimator, paths, out)[0].skipped


def test_what_a_raw_capture_is_read_with_counts_as_input(tmp_path):
    (tmp_path / "shot.raw").touch()
    assert files_of(tmp_path / "shot.raw") == [tmp_path / "shot.raw"]
    (tmp_path / "shot.json").touch()
    (tmp_path / "white").mkdir()
    assert files_of(tmp_path / "shot.raw") == [
        tmp_path / name for name in ("shot.raw", "shot.json", "white")
    ]
    assert files_of(tmp_path / "views.npz") == [tmp_path / "views.npz"]


def test_results_are_never_written_over_the_input(estimator, lf, tmp_path):
    write_light_field(tmp_path / "a", lf, "hci")
    outcome = batch(estimator, [tmp_path / "a"], tmp_path)[0]
    assert "other things" in outcome.problems[0]
    assert (tmp_path / "a" / "input_Cam012.png").exists()


def test_inputs_of_one_name_are_refused(lf, tmp_path):
    for parent in "xy":
        write_light_field(tmp_path / parent / "same", lf, "hci")
    with pytest.raises(InputError, match="another light field is also named same"):
        check_names([tmp_path / "x" / "same", tmp_path / "y" / "same"])


def test_a_result_belongs_to_its_light_field(estimator, lf, tmp_path):
    """Another one of the same name leaves it alone; the same one, moved, may replace it."""
    other = replace(lf, views=255 - lf.views)
    write_light_field(tmp_path / "x" / "same", lf, "hci")
    write_light_field(tmp_path / "y" / "same", other, "hci")
    out = tmp_path / "out"
    batch(estimator, [tmp_path / "x" / "same"], out)
    before = (out / "same" / "run.json").read_bytes()
    (apart,) = batch(estimator, [tmp_path / "y" / "same"], out)
    assert apart.folder == out / "y_same" and apart.run["input_sha256"]
    assert batch(estimator, [tmp_path / "y" / "same"], out)[0].skipped
    (refused,) = batch(estimator, [tmp_path / "y" / "same"], out, names=["same"])
    assert str(tmp_path / "x" / "same") in refused.problems[0]
    assert "--name" in refused.problems[0] and (out / "same" / "run.json").read_bytes() == before
    (named,) = batch(estimator, [tmp_path / "y" / "same"], out, names=["another"])
    assert named.folder == out / "another"
    (tmp_path / "x").rename(tmp_path / "z")
    (moved,) = batch(estimator, [tmp_path / "z" / "same"], out)
    assert moved.folder == out / "same"
    assert moved.run["input"] == str(tmp_path / "z" / "same")
    (forced,) = batch(estimator, [tmp_path / "y" / "same"], out, force=True)
    assert forced.folder == out / "same"


@pytest.mark.parametrize("name", ["", "..", "a/b", "a\0b", "a\x1b[2J"])
def test_a_name_that_is_none_of_a_folder_is_refused(name):
    with pytest.raises(InputError, match="--name"):
        check_name(name)


def test_a_link_is_named_as_itself(estimator, lf, tmp_path):
    """As in caches that keep content by its hash, and folders of links to scenes."""
    write_light_field(tmp_path / "x.npz", lf, "array")
    (tmp_path / "x.npz").rename(tmp_path / "5fe3a1c0ffee")
    (tmp_path / "kitchen.npz").symlink_to("5fe3a1c0ffee")
    for place in ("a", "b"):
        write_light_field(tmp_path / "store" / place / "views", lf, "hci")
        (tmp_path / f"scene_{place}").symlink_to(tmp_path / "store" / place / "views")
    paths = [tmp_path / name for name in ("kitchen.npz", "scene_a", "scene_b")]
    done = batch(estimator, paths, tmp_path / "out")
    assert [outcome.name for outcome in done] == ["kitchen", "scene_a", "scene_b"]
    assert [outcome.run["input"] for outcome in done] == [str(path) for path in paths]
    assert all(outcome.skipped for outcome in batch(estimator, paths, tmp_path / "out"))


def test_a_result_of_a_stated_range_is_done_for_that_range_alone(lf, tmp_path):
    write_light_field(tmp_path / "in" / "a", lf, "hci")
    model, paths, out = epinet.load_model(device="cpu"), [tmp_path / "in" / "a"], tmp_path / "out"
    ranges = [None, (-1.0, 1.0), (-1.0, 1.0), (-2.0, 1.0)]
    done = [batch(model, paths, out, range_px=range_px)[0].skipped for range_px in ranges]
    assert done == [False, False, True, False]


def test_what_others_put_beside_a_result_stays_and_does_not_undo_it(estimator, lf, tmp_path):
    write_light_field(tmp_path / "in" / "a", lf, "hci")
    out = tmp_path / "out"
    batch(estimator, [tmp_path / "in" / "a"], out)
    (out / "a" / "mesh.glb").write_text("made of it")
    (done,) = batch(estimator, [tmp_path / "in" / "a"], out)
    assert done.skipped
    (refused,) = batch(estimator, [tmp_path / "in" / "a"], out, force=True)
    assert "mesh.glb" in refused.problems[0] and (out / "a" / "mesh.glb").exists()
    (out / "a" / "mesh.glb").rename(out / "a" / ".DS_Store")  # which nobody misses
    (done,) = batch(estimator, [tmp_path / "in" / "a"], out, force=True)
    assert done.run is not None and not done.skipped


def test_names_that_are_one_on_some_systems_are_refused(estimator, lf, tmp_path):
    for place in ("x/boxes", "y/Boxes"):
        write_light_field(tmp_path / place, lf, "hci")
    with pytest.raises(InputError, match="another light field is also named"):
        batch(estimator, [tmp_path / "x" / "boxes", tmp_path / "y" / "Boxes"], tmp_path / "out")


def test_what_an_interrupted_program_left_hidden_is_no_light_field(lf, tmp_path):
    for name in ("scene", ".scene.0a1b2c3d"):
        write_light_field(tmp_path / name, lf, "hci")
    assert [p.name for p in find_light_fields([tmp_path])] == ["scene"]


def test_a_named_layout_does_not_take_files_for_its_folders(lf, tmp_path):
    write_light_field(tmp_path / "scene", lf, "hci")
    write_light_field(tmp_path / "scene.npz", lf, "array")
    assert [p.name for p in find_light_fields([tmp_path], "hci")] == ["scene"]
    assert [p.name for p in find_light_fields([tmp_path], "array")] == ["scene.npz"]


def test_a_name_that_is_no_text_does_not_stop_the_preview(estimator, lf, tmp_path):
    """As on disks written with another encoding: the bytes are kept, but cannot be drawn."""
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.npz"))
    write_light_field(path, lf, "array")
    (done,) = batch(estimator, [path], tmp_path / "out")
    assert done.run is not None, done.problems
    assert (done.folder / "preview.png").exists()


def test_too_little_memory_fails_one_light_field_and_names_the_remedy(estimator, lf, tmp_path):
    """Real allocations, of more than any machine has."""

    def of_torch():
        torch.empty(1 << 50)

    def of_numpy():
        np.empty(1 << 50)

    def of_a_bug():
        torch.empty(2).reshape(3)

    allocations = {"a": of_torch, "b": of_numpy, "c": lambda: None, "d": of_a_bug}

    @contextmanager
    def allocating(label):
        yield lambda share: allocations[label]()

    for name in allocations:
        write_light_field(tmp_path / "in" / name, lf, "hci")
    outcomes = predict_all(
        estimator,
        find_light_fields([tmp_path / "in"]),
        tmp_path / "out",
        reading=Reading(),
        options=Options(),
        progress=allocating,
    )
    for name in "ab":
        outcome = next(outcomes)
        assert f"{name}: the memory does not suffice" in outcome.problems[0]
        assert "--memory" in outcome.problems[0]
    assert next(outcomes).run is not None
    with pytest.raises(RuntimeError, match="shape"):
        next(outcomes)
