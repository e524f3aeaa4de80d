"""Recipes: what the paper states, what is derived, and what is refused."""

import re
import subprocess
import sys

import pytest
import yaml

from epinet.errors import InputError
from epinet.synth.generator import VERSION
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import changed_recipe, load_recipe, parse_changes, shipped_recipes


def test_every_shipped_recipe_is_whole_and_described():
    names = set(shipped_recipes())
    for name in names:
        recipe = load_recipe(name)
        assert recipe.name == name
        assert len(recipe.about) > 20
        assert Recipe.of(recipe.as_dict()) == recipe
    assert {"paper-9x9", "paper-7x7", "fast-9x9", "fast-7x7", "fast-5x5"} <= names


def test_the_papers_recipe_is_the_papers():
    recipe = load_recipe("paper-9x9")
    assert (recipe.views, recipe.streams, recipe.batch, recipe.patch_px) == (9, 4, 16, 1)
    assert recipe.network().config.parameters == 5_118_681
    assert recipe.optimiser == "rmsprop"
    assert recipe.steps == Recipe.of({}).steps == 10_000_000  # figure 3's caption
    assert recipe.rate(0) == pytest.approx(1e-5)
    assert recipe.rate(recipe.steps) == pytest.approx(1e-6)
    assert recipe.texture_threshold == 0.02
    assert recipe.least_weight is None
    assert not recipe.local_contrast
    assert load_recipe("paper-7x7").shifted
    assert load_recipe("paper-5x5").shifted  # the reference code's 5-view run has no shift


def test_the_recipe_of_the_reference_code_is_its():
    code = load_recipe("paper-code-9x9")
    assert (code.patch_px, code.texture_threshold, code.rate(999)) == (3, 0.01, 1e-4)
    names = [a.name for a in code.chosen_augmentations()]
    assert names == ["turn_or_flip", "scale", "gray_weights", "gamma"]
    assert code.scale_weights == (8, 6, 3)
    assert code.scene_weights == dict.fromkeys(("kitchen", "museum", "vinyl"), 0.25)
    assert code.paced_by_steps == []


@pytest.mark.parametrize(("name", "streams"), [("paper-1-stream", 1), ("paper-2-streams", 2)])
def test_fewer_streams_have_as_many_parameters(name, streams):
    config = load_recipe(name).network().config
    assert config.streams == streams
    assert config.parameters == pytest.approx(5_118_681, rel=0.02)


def test_ablations_differ_from_the_whole_in_their_augmentations_alone():
    whole = load_recipe("paper-7x7")
    for name in ("colour", "view-shift", "rotation", "scale"):
        ablation = load_recipe(f"paper-7x7-{name}")
        assert set(ablation.augmentations) < set(whole.augmentations)
        same = {"augmentations": (), "name": "", "about": ""}
        assert ablation.model_copy(update=same) == whole.model_copy(update=same)


def test_our_range_widens_and_our_rate_falls():
    recipe = load_recipe("fast-9x9")
    assert recipe.reach(0) == recipe.narrow
    assert recipe.reach(recipe.steps) == 1
    assert recipe.rate(0) < recipe.rate(recipe.warmup_steps)
    assert recipe.rate(recipe.steps - 1) < 1e-3 * recipe.learning_rate
    assert load_recipe("paper-9x9").reach(0) == 1


def test_values_can_be_changed_by_name():
    recipe = changed_recipe(
        "paper-7x7",
        ["learning_rate=1e-4", "decay=constant", "gradient_clip=null"],
        ["wide", "/data/hci"],
        ["view_shift"],
    )
    assert recipe.learning_rate == 1e-4
    assert recipe.decay == "constant"
    assert [(d.generator, d.folder and str(d.folder)) for d in recipe.data] == [
        ("wide", None),
        (None, "/data/hci"),
    ]
    assert not recipe.shifted
    assert "rotation" in recipe.augmentations


def test_data_that_is_a_range_and_a_folder_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert changed_recipe("fast-9x9", [], ["hci"], []).data[0].generator == "hci"
    (tmp_path / "hci").mkdir()
    with pytest.raises(InputError, match=r"--data hci: .*--data \./hci .*generator: hci"):
        changed_recipe("fast-9x9", [], ["hci"], [])
    (folder,) = changed_recipe("fast-9x9", [], ["./hci"], []).folders
    assert folder.resolve() == tmp_path / "hci"
    (rendered,) = changed_recipe("fast-9x9", ["data=[{generator: hci}]"], [], []).data
    assert rendered.generator == "hci"


def test_a_recipe_file_may_be_based_on_another(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("base: paper-9x9\nbatch: 4\nlearning_rate: 1e-3\n")
    recipe = load_recipe(str(path))
    assert (recipe.name, recipe.batch, recipe.learning_rate) == ("mine", 4, 1e-3)
    assert recipe.augmentations == load_recipe("paper-9x9").augmentations
    whole = tmp_path / "whole.yaml"
    whole.write_text(yaml.safe_dump(recipe.as_dict()))
    assert load_recipe(str(whole)) == recipe
    path.write_text(f"base: {path}\n")
    with pytest.raises(InputError, match="based on it"):
        load_recipe(str(path))


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        (
            ["bach=4"],
            "bach is not known; there are views, .*, validate_every, .*, class_weight$",
        ),
        (["model=net"], "model 'net': there are sweepnet, epinet"),
        (["decay=linear"], "decay: .*'constant', 'exponential' or 'cosine'"),
        (
            ["model=sweepnet", "start=own", "patch_px=2", "shape={depth: 3}"],
            "shape: depth is not known; there are spacing_px, .*, half, full",
        ),
        (
            ["model=sweepnet", "start=own", "patch_px=2", "shape={half: {width: 3}}"],
            "shape: half.width is not known; there are ",
        ),
        (["streams=3"], "streams: Input should be 1, 2 or 4, not 3"),
        (["batch=0"], "batch: .*greater than or equal to 1.*not 0"),
        (["batch=16", "shards=3"], "a batch of 16 cannot be split in 3 shards"),
        (["views=4"], r"views must be one of \(3, 5, 7, 9\), not 4"),
        (["augmentations=[spin]"], "spin unknown; there are view_shift"),
        (["optimiser=sgd"], "optimiser: .*'rmsprop', 'adamw' or 'muon'"),
        (["learning_rate=-1"], "learning_rate"),
        (["final_learning_rate=1"], "final_learning_rate is greater"),
        (["data=[{generator: huge}]"], "data.0.generator: .*'narrow', 'hci' or 'wide', not 'huge'"),
        (["data=[{share: 1}]"], "data.0: give either generator or folder"),
        (["data=[]"], "at least one source"),
        (["data=[{generator: hci, options: {thin: 2}}]"], "data.0: options: thin is a share of 0"),
        (
            ["data=[{generator: hci, options: {thick: 2}}]"],
            "options: thick is not known; there are size",
        ),
        (
            ["data=[{generator: hci, folders: x}]"],
            "folders is not known; there are generator,",
        ),
        (["data=[{generator: hci, options: {gloss: high}}]"], "options: gloss: Input should be"),
        (["data=[{folder: x, options: {thin: 0.1}}]"], "options are the generator's"),
        (["data=[{generator: hci, options: {size: [9, 9]}}]"], "options: size cannot be chosen"),
        (["data=[{generator: hci, options: {held_out: true}}]"], "held_out cannot be chosen"),
        (["data=[{generator: hci, options: {surfaces: 3}}]"], "data.0: options: "),
        (["data=[{generator: hci, options: {faults: {noise: -1}}}]"], "the strength of noise"),
        (
            ["data=[{generator: hci, options: {faults: {dust: 1}}}]"],
            "faults.dust is not known; there",
        ),
        (["data=[{generator: hci, disparity_px: [-1, 1]}]"], "disparity_px is a folder's"),
        (["data=[{folder: x, disparity_px: [1, -1]}]"], "disparity_px: the range is empty"),
        (["learning_rate=.inf"], "learning_rate: Input should be a finite number"),
        (["data=[{generator: hci, share: .inf}]"], "data.0.share: Input should be a finite number"),
        (["scene_weights={vinyl: -1}"], "scene_weights.vinyl: .*greater than or equal to 0"),
        (["mirror_weight=0.1"], "mirror_weight: takes a least_weight and rendered scenes"),
        (["batch=6", "large_patches=0.5"], r"a batch of 1\.5 large patches \(a quarter of 6\)"),
    ],
)
def test_impossible_values_are_named(changes, found):
    with pytest.raises(InputError, match=found):
        load_recipe("paper-9x9", parse_changes(changes))


def test_all_impossible_values_are_named_at_once():
    with pytest.raises(InputError) as caught:
        load_recipe("paper-9x9", {"batch": -1, "steps": 0, "colour": 1})
    assert len(caught.value.problems) == 3


def test_recipes_that_are_none(tmp_path):
    with pytest.raises(InputError, match="none of the recipes fast-5x5"):
        load_recipe("paper-8x8")
    path = tmp_path / "list.yaml"
    path.write_text("- 1\n")
    with pytest.raises(InputError, match="a mapping"):
        load_recipe(str(path))
    path.write_text("a: [1\n")
    with pytest.raises(InputError, match=r"list\.yaml: cannot be read"):
        load_recipe(str(path))
    path.write_text("base: paper-9x9\non: 3\n")  # YAML takes "on" for "true"
    with pytest.raises(InputError, match=r"list\.yaml: "):
        load_recipe(str(path))
    with pytest.raises(InputError, match="KEY=VALUE"):
        parse_changes(["batch"])
    with pytest.raises(InputError, match="--without spin: no such augmentation"):
        changed_recipe("paper-9x9", [], [], ["spin"])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("streams=2", "streams"),
        ("local_contrast=true", "local_contrast"),
        ("norms=true", "norms"),
        ("start=glorot", "start"),
        ("patch_px=5", "patch_px"),
    ],
)
def test_what_sweepnet_cannot_do_is_refused(change, named):
    with pytest.raises(InputError, match=named):
        changed_recipe("sweepnet", [change], [], [])
    for shape in ("sweep_width: -3", "sweep_width: wide", "depth: 2"):
        with pytest.raises(InputError, match="shape: "):
            changed_recipe("sweepnet", [f"shape={{{shape}}}"], [], [])
    with pytest.raises(InputError, match="frozen: nothing is left to learn"):
        load_recipe("sweepnet", {"start": "sweepnet", "frozen": ["sweep", "fill", "refine"]})
    with pytest.raises(InputError, match="epinet sees a fixed number of views"):
        changed_recipe("fast-9x9", ["fewer_views=0.1"], [], [])
    with pytest.raises(InputError, match="there are sweepnet, epinet"):
        changed_recipe("fast-9x9", ["model=other"], [], [])


def test_the_command_lists_them():
    command = [sys.executable, "-m", "epinet", "train", "--list", "-o", "unused"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    for name in shipped_recipes():
        assert re.search(rf"^{name} +\w", listed, re.MULTILINE)


def test_limits_are_those_of_what_is_shown():
    """Sign reversal shows the range mirrored, too, scale a part of it."""
    wide = {"data": [{"generator": "wide"}], "scale_weights": [0, 0, 0, 0, 0, 1]}
    assert load_recipe("paper-9x9", wide).limits_px == pytest.approx((-25 / 6, 25 / 6))
    upright = load_recipe("paper-9x9", wide | {"augmentations": ["scale"]})
    assert upright.limits_px == pytest.approx((-25 / 6, 5 / 6))
    both = {"data": [{"generator": "narrow"}, {"folder": "x", "disparity_px": [-2, 0.5]}]}
    assert load_recipe("fast-9x9", both).limits_px == (-2, 1)
    assert changed_recipe("fast-9x9", [], ["x"], []).limits_px is None


def test_faults_can_be_chosen():
    options = {"faults": {"noise": 0}, "surfaces": [1, 2]}
    recipe = load_recipe("fast-9x9", {"data": [{"generator": "hci", "options": options}]})
    (rendered,) = (data.rendered() for data in recipe.data)
    assert (rendered.faults.noise, rendered.faults.blur, rendered.surfaces) == (0, 1, (1, 2))


def test_weights_name_the_scenes_that_they_learned_from(tmp_path):
    rendered = Recipe.of({"data": [{"generator": "hci"}]})
    assert rendered.provenance == {"generator": VERSION, "seed": rendered.seed}
    on_disk = Recipe.of({"data": [{"folder": tmp_path}]})
    assert on_disk.provenance == {"folders": [str(tmp_path)]}
    mixed = Recipe.of(
        {"data": [{"generator": "hci", "share": 0.5}, {"folder": tmp_path, "share": 0.5}]}
    )
    assert mixed.provenance == rendered.provenance | on_disk.provenance
