"""Scoring maps on disk: which truth and which masks are used, and what is absent."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from epinet.benchmark.evaluate import Method, enlarge, evaluate
from epinet.benchmark.maps import MapFile, find_maps
from epinet.benchmark.methods import named_targets, prepare
from epinet.benchmark.page import render
from epinet.benchmark.scenes import find_scenes
from epinet.benchmark.signs import opposite_signs
from epinet.benchmark.table import as_json, text_tables
from epinet.errors import InputError
from epinet.io import read_light_field, write_light_field, write_pfm
from epinet.io.images import write_png
from epinet.metrics.catalogue import benchmark_metrics
from epinet.metrics.disparity import score
from epinet.synth.generator import render_scene
from epinet.synth.options import Options

SIZE = (40, 48)
RNG = np.random.default_rng(0)
MAP = RNG.normal(size=SIZE).astype(np.float32)


def left(scale=1):
    mask = np.zeros(SIZE, bool)
    mask[:, :24] = True
    return mask.repeat(scale, 0).repeat(scale, 1)


def test_scores_are_those_of_the_function_that_everything_else_uses(add_scene, evaluated):
    truth = MAP + RNG.normal(0, 0.05, SIZE).astype(np.float32)
    add_scene("a", truth)
    found = evaluated({"ours": {"a": MAP}}, {"ours": 2.5})
    for id_, value in score(MAP, truth).items():
        assert found.scores["ours", "a", id_].value == pytest.approx(value)
    assert found.scores["ours", "a", "runtime"].value == 2.5


def test_the_border_can_be_chosen(add_scene, evaluated):
    add_scene("a")
    map_ = np.zeros(SIZE)
    map_[:5] = 1
    found = evaluated({"m": {"a": map_}}, border_px=4)
    assert found.scores["m", "a", "badpix_0.07"].value == pytest.approx(100 / 32)


def test_high_resolution_truth_is_used_where_the_site_uses_it(add_scene, evaluated):
    """Within each block of 2x2 the high truth differs to the right."""
    high = enlarge(MAP, 2)
    high[:, 1::2] += 1
    for name in ("stripes", "boxes", "dots"):
        add_scene(name, MAP, high=None if name == "dots" else high)
    found = evaluated({"m": dict.fromkeys(("stripes", "boxes", "dots"), MAP)})
    of = {name: found.scores["m", name, "badpix_0.07"] for name in ("stripes", "boxes", "dots")}
    assert (of["stripes"].value, of["stripes"].truth, of["stripes"].official) == (50, "high", True)
    assert (of["boxes"].value, of["boxes"].truth, of["boxes"].official) == (0, "low", True)
    assert (of["dots"].value, of["dots"].truth, of["dots"].official) == (0, "low", False)


def test_maps_are_enlarged_by_nearest_neighbour(add_scene, evaluated):
    add_scene("dots", MAP, high=MAP.repeat(10, 0).repeat(10, 1))
    found = evaluated({"m": {"dots": MAP}})
    assert found.scores["m", "dots", "mse_x100"].value == 0
    assert found.scores["m", "dots", "mse_x100"].truth == "high"


def test_masks_decide_what_is_scored_and_against_what(add_scene, evaluated):
    high = enlarge(MAP, 2)
    high[:, 1::2] += 1
    add_scene("both", MAP, high=high, masks={"mask_discontinuities_highres": left(2)})
    add_scene("low", MAP, high=high, masks={"mask_discontinuities_lowres": left()})
    add_scene("none", MAP, high=high)
    found = evaluated({"m": dict.fromkeys(("both", "low", "none"), MAP)})
    both, low, none = (
        found.scores["m", name, "discontinuities"] for name in ("both", "low", "none")
    )
    assert (both.value, both.truth, both.official) == (50, "high", True)
    assert (low.value, low.truth, low.official) == (0, "low", False)
    assert none.value is None
    assert none.absent == "no mask_discontinuities_lowres.png"
    metric = next(m for m in found.metrics if m.id == "discontinuities")
    assert found.mean(found.methods[0], metric) == (25, 2)


def test_metrics_of_one_scene_stay_there(add_scene, evaluated):
    """`background` is a mask of backgammon too, which has no background MSE."""
    for name in ("dots", "backgammon"):
        add_scene(name, MAP, masks={"mask_background_lowres": left()})
    found = evaluated({"m": dict.fromkeys(("dots", "backgammon"), MAP + 0.1)})
    assert found.scores["m", "dots", "dots_background_mse_x100"].value == pytest.approx(1, rel=1e-3)
    other = found.scores["m", "backgammon", "dots_background_mse_x100"]
    assert (other.value, other.absent) == (None, "only for the scene dots")


def test_numbered_masks_are_read_as_numbers(add_scene, evaluated):
    boxes = np.where(left(), 1, 2)
    sizes = np.zeros(SIZE)
    sizes[4:6, 4:6] = sizes[4:6, 30:32] = 3
    numbered = {"mask_boxes_lowres": boxes, "mask_dots_by_size_lowres": sizes}
    add_scene("dots", MAP, numbered=numbered)
    map_ = MAP.copy()
    map_[4:6, 4:6] += 1
    assert evaluated({"m": {"dots": map_}}).scores["m", "dots", "dots_missed"].value == 50


def test_scenes_of_synth_are_scored_by_part(tmp_path, evaluated):
    lf = render_scene(Options(size=(64, 64)), seed=1, index=0, star_only=True)
    write_light_field(tmp_path / "data" / "s", lf, "hci")
    lf = read_light_field(tmp_path / "data" / "s")
    found = evaluated({"m": {"s": lf.truth + 0.1}})
    parts = {
        "planes": "badpix_planes",
        "smooth_surfaces": "badpix_smooth_surfaces",
        "occluded": "badpix_occluded",
        "discontinuities": "discontinuities",
    }
    inside = np.zeros(lf.size, bool)
    inside[15:-15, 15:-15] = True
    for mask, id_ in parts.items():
        expected = 100 if (lf.masks[mask] & inside).any() else None
        assert found.scores["m", "s", id_].value == expected
    assert found.scores["m", "s", "normal_angle_planes"].value is not None


def test_scenes_are_found_alone_together_and_in_categories(tmp_path, add_scene):
    folder = add_scene("training/boxes")
    add_scene("antinous")
    data = tmp_path / "data"
    assert [scene.name for scene in find_scenes(data)] == ["antinous", "boxes"]
    assert [scene.name for scene in find_scenes(data, ["boxes"])] == ["boxes"]
    assert [scene.name for scene in find_scenes(folder)] == ["boxes"]


def test_everything_wrong_with_scenes_is_told_at_once(tmp_path, add_scene):
    add_scene("nan", np.full(SIZE, np.nan))
    add_scene("odd", high=np.zeros((81, 96)))
    add_scene("x/twin")
    add_scene("y/twin")
    with pytest.raises(InputError) as caught:
        find_scenes(tmp_path / "data")
    text = str(caught.value)
    for problem in (
        r"nan/gt_disp_lowres.pfm: truth is NaN at every pixel",
        r"odd/gt_disp_highres.pfm: 96x81 px",
        r"x/twin and",
    ):
        assert problem in text
    assert len(caught.value.problems) == 3
    with pytest.raises(InputError, match="scene boxes: not there; there are nan"):
        find_scenes(tmp_path / "data", ["boxes"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no scene in it"):
        find_scenes(tmp_path / "empty")


def without_truth(folder):
    (folder / "gt_disp_lowres.pfm").unlink()
    write_png(folder / "input_Cam000.png", np.zeros((*SIZE, 3), np.uint8))


def test_scenes_without_truth_are_left_out_unless_asked_for(tmp_path, add_scene, log):
    """As in the benchmark's tree, where test/ has none; a folder beside a scene's has none, too."""
    data = tmp_path / "data"
    add_scene("training/boxes")
    for name in ("test/herbs", "views/boxes"):
        without_truth(add_scene(name))
    assert [scene.name for scene in find_scenes(data)] == ["boxes"]
    assert log.messages == ["left out: herbs (no truth: gt_disp_lowres.pfm is missing)"]
    with pytest.raises(InputError, match="herbs: no truth to score against"):
        find_scenes(data, ["boxes", "herbs"])
    with pytest.raises(InputError, match="herbs: no truth to score against"):
        find_scenes(data / "test")


def test_scenes_and_maps_that_are_not_on_both_sides_are_left_out(tmp_path, add_scene, log):
    for name in "abc":
        add_scene(name)
    for method, names in {"one": "abx", "two": "bcy", "three": "c"}.items():
        for name in names:
            write_pfm(tmp_path / method / f"{name}.pfm", np.zeros(SIZE))
    one, two, three = (str(tmp_path / method) for method in ("one", "two", "three"))
    prepared = prepare([one, two], tmp_path / "data")
    assert [scene.name for scene in prepared.scenes] == ["b"]
    assert log.messages == [
        f"left out: c (no maps of them in {one})",
        f"left out: a (no maps of them in {two})",
        f"left out: maps of a, x in {one} (the scenes are b)",
        f"left out: maps of c, y in {two} (the scenes are b)",
    ]
    with pytest.raises(InputError, match=r"one: no map of scene c"):
        prepare([one], tmp_path / "data", ["b", "c"])
    with pytest.raises(InputError, match=r"three: no map of scene a") as caught:
        prepare([one, three], tmp_path / "data")
    assert len(caught.value.problems) == 2


def test_maps_of_the_reference_code_lack_a_border(tmp_path, add_scene, log):
    """11 px on each side, which the network does not see: they count as without an estimate."""
    truth = np.full((60, 70), 0.5, np.float32)
    add_scene("a", truth)
    write_pfm(tmp_path / "maps" / "a.pfm", truth[11:-11, 11:-11])
    prepared = prepare([str(tmp_path / "maps")], tmp_path / "data")
    assert "the maps of a in " in log.messages[0] and "11 px on each side" in log.messages[0]
    methods = list(prepared.methods.values())
    for border_px, bad in ((15, 0.0), (10, 100 * (1 - 38 * 48 / (40 * 50)))):
        scored = evaluate(methods, prepared.scenes, benchmark_metrics(), border_px=border_px)
        for id_ in ("badpix_0.07", "missing"):
            assert scored.scores["maps", "a", id_].value == pytest.approx(bad)
    with pytest.raises(InputError, match="are not finite; fill in an estimate"):
        find_maps(tmp_path / "maps", {"a": (60, 70)}, complete=True)
    write_pfm(tmp_path / "maps" / "a.pfm", truth[10:-10, 11:-11])
    with pytest.raises(InputError, match="the map is 48x40 px, it must be 70x60 px"):
        find_maps(tmp_path / "maps", {"a": (60, 70)})


def write_v73(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name] = np.asarray(array).T


@pytest.mark.parametrize("write", [lambda path, **arrays: savemat(path, arrays), write_v73])
def test_a_map_may_be_the_only_image_of_a_mat_file(tmp_path, write):
    write(tmp_path / "a.mat", estimate=MAP.astype(float), seconds=[[2.0]], views=np.zeros((2,) * 4))
    file = find_maps(tmp_path, {"a": SIZE})["a"]
    np.testing.assert_array_equal(file.read(SIZE), MAP)
    write(tmp_path / "a.mat", estimate=MAP, truth=MAP)
    with pytest.raises(InputError, match=r"the only \(H, W\) array .* estimate \(40, 48\), truth"):
        find_maps(tmp_path, {"a": SIZE})
    write(tmp_path / "a.mat", seconds=[[2.0]])
    with pytest.raises(InputError, match=r"the only \(H, W\) array .* seconds \(1, 1\)"):
        find_maps(tmp_path, {"a": SIZE})
    write_pfm(tmp_path / "a.pfm", MAP)
    assert find_maps(tmp_path, {"a": SIZE})["a"].path.suffix == ".pfm"


@pytest.mark.parametrize("place", [141, 177])
def test_a_damaged_mat_file_is_refused(tmp_path, place):
    """Of the flags' length and of the values' type: scipy alone would crash at the latter."""
    path = tmp_path / "a.mat"
    savemat(path, {"est": MAP})
    damaged = bytearray(path.read_bytes())
    damaged[place] = 0x88
    path.write_bytes(damaged)
    with pytest.raises(InputError, match=r"a\.mat: cannot be read as a \.mat file"):
        find_maps(tmp_path, {"a": SIZE})


def test_maps_of_opposite_sign_get_a_hint(add_scene, evaluated):
    for name in "abc":
        add_scene(name, MAP)
    noise = RNG.normal(0, 0.2, SIZE)
    maps = {
        "opposite": dict.fromkeys("abc", -MAP + noise),
        "mostly": {"a": -MAP, "b": -MAP, "c": MAP},
        "seldom": {"a": -MAP, "b": MAP, "c": MAP},
        "noisy": dict.fromkeys("abc", MAP + 5 * noise),
        "flat": dict.fromkeys("abc", np.zeros(SIZE)),
        "none": dict.fromkeys("abc", np.full(SIZE, np.nan)),
    }
    hints = opposite_signs(evaluated(maps))
    assert [hint.split(" seem ")[0] for hint in hints] == [
        "hint: the maps of opposite",
        "hint: the maps of mostly",
    ]
    assert "those of a, b come much nearer" in hints[1]


def test_masks_of_another_size_are_told(add_scene, evaluated):
    add_scene("a", masks={"mask_planes_lowres": left(2)})
    with pytest.raises(InputError, match=r"mask_planes_lowres\.png: the mask is 96x80 px"):
        evaluated({"m": {"a": MAP}})


def write_result(folder: Path, **settings: object) -> None:
    write_pfm(folder / "disparity.pfm", MAP)
    np.save(folder / "disparity.npy", MAP)
    run = {"settings": {"step": 1} | settings, "seconds": {"prepare": 0.5, "network": 1.0}}
    (folder / "run.json").write_text(json.dumps(run))


def test_maps_of_every_form_are_found(tmp_path):
    forms = {name: tmp_path / name for name in ("pfm", "npy", "results", "submission")}
    write_pfm(forms["pfm"] / "a.pfm", MAP)
    forms["npy"].mkdir()
    np.save(forms["npy"] / "a.npy", MAP)
    write_result(forms["results"] / "a")
    write_pfm(forms["submission"] / "disp_maps" / "a.pfm", MAP)
    (forms["submission"] / "runtimes").mkdir()
    (forms["submission"] / "runtimes" / "a.txt").write_text("1.5\nseconds\n")
    forms["one result"] = forms["results"] / "a"
    for name, folder in forms.items():
        file = find_maps(folder, {"a": SIZE})["a"]
        np.testing.assert_array_equal(file.read(SIZE), MAP)
        assert file.seconds == (None if name in ("pfm", "npy") else 1.5)


def test_maps_say_whether_they_were_kept_within_the_stated_range(tmp_path, add_scene):
    for name, settings in {"a": {"stated_px": [-1, 1]}, "b": {"stated_px": None}, "c": {}}.items():
        add_scene(name)
        write_result(tmp_path / "maps" / name, **settings)
        write_pfm(tmp_path / "theirs" / f"{name}.pfm", MAP)
    scenes = find_scenes(tmp_path / "data")
    sizes = {scene.name: scene.size for scene in scenes}
    found = find_maps(tmp_path / "maps", sizes)
    assert [found[name].bounded for name in "abc"] == [True, False, None]
    theirs = find_maps(tmp_path / "theirs", sizes)
    methods = [Method("ours", "", found), Method("theirs", "", theirs)]
    says = "of disparities: {} of ours, not recorded of theirs."
    for chosen, count in ((scenes, "not recorded"), (scenes[:2], "1 of 2"), (scenes[1:2], "none")):
        scored = evaluate(methods, chosen, benchmark_metrics())
        assert says.format(count) in "\n".join(text_tables(scored))
        assert says.format(count) in render(scored)
    kept = json.loads(as_json(scored))["kept_within_stated_range"]
    assert kept == {"ours": {"b": False}, "theirs": {"b": None}}


def test_everything_wrong_with_maps_is_told_at_once(tmp_path):
    write_pfm(tmp_path / "small.pfm", MAP[2:])
    write_pfm(tmp_path / "colour.pfm", np.zeros((*SIZE, 3)))
    write_pfm(tmp_path / "twice.pfm", MAP)
    np.save(tmp_path / "twice.npy", MAP)
    np.save(tmp_path / "complex.npy", MAP * 1j)
    write_result(tmp_path / "step", step=2)
    write_pfm(tmp_path / "slow.pfm", MAP)
    (tmp_path / "runtimes").mkdir()
    (tmp_path / "runtimes" / "slow.txt").write_text("ages")
    names = ("small", "colour", "twice", "complex", "step", "slow", "none")
    with pytest.raises(InputError) as caught:
        find_maps(tmp_path, dict.fromkeys(names, SIZE))
    text = str(caught.value)
    for problem in (
        "small.pfm: the map is 48x38 px, it must be 48x40 px",
        "colour.pfm: in colour",
        "more than one map of scene twice",
        "complex.npy: a map must be one (H, W) array of numbers",
        "run.json: predicted with --step 2",
        "slow.txt: the first line must be the run time",
        "no map of scene none",
    ):
        assert problem in text
    assert len(caught.value.problems) == 7


def test_a_folder_without_maps_is_told(tmp_path):
    with pytest.raises(InputError, match="no maps in it"):
        find_maps(tmp_path, {"a": SIZE})
    with pytest.raises(InputError, match="no such folder"):
        find_maps(tmp_path / "none", {"a": SIZE})


def test_methods_are_named_by_hand_or_by_what_they_are():
    texts = ["sweepnet", "runs/big.safetensors", "theirs=results/maps", "out/x=y/maps"]
    names = [target.name for target in named_targets(texts)]
    assert names == ["sweepnet", "big", "theirs", "maps"]
    models = [target.is_model for target in named_targets(texts)]
    assert models == [True, True, False, False]


def test_one_name_twice_hides_nothing_else(tmp_path, add_scene):
    """What is wrong with either folder's maps is told, too."""
    add_scene("a")
    write_pfm(tmp_path / "one" / "maps" / "a.pfm", np.zeros((2, 2)))
    write_pfm(tmp_path / "two" / "maps" / "a.pfm", np.zeros((*SIZE, 3)))
    with pytest.raises(InputError) as caught:
        prepare([str(tmp_path / k / "maps") for k in ("one", "two")], tmp_path / "data")
    name, size, colour = caught.value.problems
    assert "method maps: given more than once" in name
    assert "the map is 2x2 px" in size
    assert "in colour" in colour


def test_views_are_checked_before_a_model_runs(tmp_path, add_scene, log):
    (add_scene("blind") / "input_Cam040.png").unlink()
    write_png(add_scene("small") / "input_Cam000.png", np.zeros((9, 8, 3), np.uint8))
    with pytest.raises(InputError) as caught:
        prepare(["sweepnet"], tmp_path / "data", border_px=0)
    (small,) = caught.value.problems
    assert log.messages == ["left out: blind (no views for sweepnet to see)"]
    assert "small: views of 8x9 px; its truth has" in small
    with pytest.raises(InputError, match="blind: no views in it for a model to see"):
        prepare(["sweepnet"], tmp_path / "data", ["blind"], border_px=0)


@pytest.mark.parametrize("scale", [-2.0, 0.25])
def test_maps_are_read_as_the_site_reads_them(tmp_path, scale):
    """Its toolkit multiplies by the magnitude of a PFM's scale."""
    path = tmp_path / "a.pfm"
    write_pfm(path, MAP / abs(scale), big_endian=scale > 0)
    sign = scale / abs(scale)
    path.write_bytes(path.read_bytes().replace(f"{sign}".encode(), f"{scale}".encode(), 1))
    np.testing.assert_array_equal(MapFile(path).read(SIZE), MAP)


def test_a_scene_of_the_benchmark_is_read(real):
    (scene,) = find_scenes(real / "antinous")
    lf = read_light_field(real / "antinous")
    np.testing.assert_array_equal(scene.centre_view(), lf.views[4, 4])
    np.testing.assert_array_equal(scene.truth, lf.truth)


def test_what_an_interrupted_program_left_hidden_is_neither_scene_nor_map(tmp_path, add_scene):
    for name in ("box", ".box.0a1b2c3d"):
        add_scene(name)
    assert [scene.name for scene in find_scenes(tmp_path / "data")] == ["box"]
    for name in ("box", ".box.0a1b2c3d"):
        (tmp_path / "maps" / name).mkdir(parents=True)
        write_pfm(tmp_path / "maps" / name / "disparity.pfm", np.zeros(SIZE))
    assert list(find_maps(tmp_path / "maps", {"box": SIZE})) == ["box"]


def test_a_scene_asked_for_twice_counts_once(tmp_path, add_scene):
    for name in ("a", "b"):
        add_scene(name)
    found = find_scenes(tmp_path / "data", ["b", "a", "b"])
    assert [scene.name for scene in found] == ["b", "a"]


def test_a_link_is_a_scene_by_its_own_name(tmp_path, add_scene):
    target = add_scene("scene_00000")
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "cotton").symlink_to(target)
    assert [scene.name for scene in find_scenes(tmp_path / "linked")] == ["cotton"]


def test_maps_beside_those_of_a_submission_are_not_passed_over(tmp_path):
    write_pfm(tmp_path / "a.pfm", MAP)
    write_pfm(tmp_path / "disp_maps" / "b.pfm", MAP)
    assert set(find_maps(tmp_path, {"a": SIZE, "b": SIZE})) == {"a", "b"}
    write_pfm(tmp_path / "disp_maps" / "a.pfm", MAP)
    with pytest.raises(InputError, match="more than one map of scene a"):
        find_maps(tmp_path, {"a": SIZE, "b": SIZE})


def test_one_scene_takes_its_map_out_of_a_folder_of_many(tmp_path, add_scene):
    folder = add_scene("a")
    for name in ("a", "b"):
        write_pfm(tmp_path / "maps" / f"{name}.pfm", np.zeros(SIZE))
    prepared = prepare([str(tmp_path / "maps")], folder)
    assert list(prepared.methods["maps"].maps) == ["a"]


def test_pictures_are_checked_with_everything_else(tmp_path, add_scene):
    """Not after a model has run, nor one scene at a time."""
    add_scene("a", masks={"mask_planes_lowres": left(2)})
    (add_scene("b") / "input_Cam040.png").write_bytes(b"no picture")
    add_scene("c", np.full(SIZE, np.nan))
    for name in "abc":
        write_pfm(tmp_path / "maps" / f"{name}.pfm", np.zeros(SIZE))
    with pytest.raises(InputError) as caught:
        prepare([str(tmp_path / "maps")], tmp_path / "data", (), benchmark_metrics())
    text = str(caught.value)
    for fault in ("mask_planes_lowres.png", "input_Cam040.png", "c/gt_disp_lowres.pfm"):
        assert fault in text


def test_thresholds_that_read_alike_are_one():
    thresholds = (0.07, 0.07000001, 0.03)
    ids = [metric.id for metric in benchmark_metrics(thresholds)]
    assert ids[:2] == ["badpix_0.07", "badpix_0.03"] and len(ids) == len(set(ids))
