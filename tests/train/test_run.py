"""Runs as people have them: interrupted, killed, shared by processes, diverging, on a full disk."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch import nn

from epinet.errors import InputError
from epinet.networks.epinet import Epinet, EpinetConfig
from epinet.networks.robust import FAR
from epinet.networks.weights import load_weights, save_weights
from epinet.synth.dataset import write_dataset
from epinet.synth.options import Options
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import load_recipe
from epinet.train.run import STATISTICS_BATCHES, DivergedError, Run, StoppedError
from epinet.train.validation import Validation

CHANGES = {
    "views": 3,
    "width": 8,
    "batch": 2,
    "patch_px": 4,
    "steps": 12,
    "warmup_steps": 2,
    "validate_every": 6,
}
TINY = load_recipe("fast-9x9", CHANGES)
CACHE = TemporaryDirectory()
"""Most runs learn from the same scenes, which take longer to render than the steps themselves."""


def command(**changes: object) -> list[str]:
    """`epinet train` of the small recipe, with changes."""
    values = [f"--set={key}={value}" for key, value in (CHANGES | changes).items()]
    fixed = ["--recipe", "fast-9x9", "--cache", CACHE.name]
    return [sys.executable, "-m", "epinet", "train", *fixed, *values]


COMMAND = command()
TOGETHER = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
QUICK = """
import json
import logging
import sys
from pathlib import Path
from epinet.train import run
from epinet.train.recipe import Recipe
from epinet.train.validation import Validation
logging.basicConfig(level=logging.INFO, stream=sys.stdout)
run.LOG_EVERY = 1
recipe = Recipe.of(json.loads(sys.argv[1]))
scenes = Validation.of_folders([Path(sys.argv[3])], recipe.views)
cache = Path(sys.argv[4])
run.Run(recipe, Path(sys.argv[2]), cache=cache, validation=scenes).train(save_every_s=0)
"""


@pytest.fixture(scope="module")
def held_out(tmp_path_factory) -> Path:
    """One small scene to validate on; the default's 16 take longer than these runs."""
    options = Options(size=(48, 48), views=3, samples=1, held_out=True)
    return write_dataset(tmp_path_factory.mktemp("held_out") / "set", options, 77, scenes=1)[0]


@pytest.fixture
def run(held_out):
    scenes = Validation.of_folders([held_out], views=3)

    def made(folder: Path, recipe: Recipe = TINY, **kwargs) -> Run:
        kwargs = {"cache": Path(CACHE.name)} | kwargs
        return Run(recipe, folder, validation=scenes, **kwargs)

    return made


def same_weights(a: Path, b: Path) -> bool:
    one, other = (load_weights(p / "weights.safetensors").net.state_dict() for p in (a, b))
    return all(torch.equal(one[name], other[name]) for name in one)


def losses(folder: Path) -> dict[int, float]:
    entries = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return {e["step"]: e["loss"] for e in entries if "loss" in e}


def wait_for_step(folder: Path, step: int, process: subprocess.Popen) -> None:
    for _ in range(1200):
        if (folder / "log.jsonl").exists() and len(losses(folder)) >= step:
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    raise AssertionError("the run does not get on")


def test_a_run_that_is_killed_goes_on_as_if_nothing_had_been(tmp_path, held_out):
    """kill -9, twice, at moments that nobody chose."""
    arguments = [sys.executable, "-c", QUICK, TINY.model_dump_json()]
    whole, parts = (
        [*arguments, str(tmp_path / f), str(held_out), CACHE.name] for f in ("whole", "parts")
    )
    subprocess.run(whole, check=True, capture_output=True)
    for step in (3, 8):
        process = subprocess.Popen(parts, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        wait_for_step(tmp_path / "parts", step, process)
        process.kill()
        process.communicate()
    last = subprocess.run(parts, capture_output=True, text=True)
    assert last.returncode == 0, last.stderr
    assert "continuing at step" in last.stdout
    assert losses(tmp_path / "parts") == losses(tmp_path / "whole")
    assert len(losses(tmp_path / "whole")) == 12
    assert same_weights(tmp_path / "parts", tmp_path / "whole")


@pytest.mark.parametrize("begun", [False, True])
def test_two_processes_do_what_one_does_with_two_shards(tmp_path, held_out, run, begun):
    """From the beginning, and from weights whose norms are set by the first batch."""
    arguments = [*COMMAND[2:], "--set=shards=2", "--device=cpu", f"--validation={held_out}"]
    start = {}
    if begun:
        run(tmp_path / "before").train()
        weights = str(tmp_path / "before" / "weights.safetensors")
        start = {"start": weights, "fixed_norms_from": 0.0}
        arguments += [f"--set={key}={value}" for key, value in start.items()]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    for launcher, folder in ((TOGETHER, "two"), ([sys.executable], "one")):
        done = subprocess.run(
            [*launcher, "-m", *arguments, "-o", str(tmp_path / folder)],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
    assert same_weights(tmp_path / "one", tmp_path / "two")
    one, two = (torch.load(tmp_path / f / "last.pt", weights_only=True) for f in ("one", "two"))
    assert one["history"][-1]["scores"] == two["history"][-1]["scores"]
    run(tmp_path / "whole", TINY.model_copy(update=start)).train()
    assert not same_weights(tmp_path / "one", tmp_path / "whole")


@pytest.mark.parametrize("step", [6, 12])
def test_a_run_stopped_before_a_validation_makes_up_for_it(tmp_path, run, monkeypatch, step):
    """At a step to validate at, and at the last one."""
    monkeypatch.setattr("epinet.train.run.pays", lambda *_: False)  # the signal comes in its turn
    run(tmp_path / "whole").train()
    stopped = run(tmp_path / "parts")
    make_batch = stopped.batches[0]

    def batch_and_signal(index: int):
        if index == step - 2:  # heard of at the next step, which is the last one made
            signal.raise_signal(signal.SIGTERM)
        return make_batch(index)

    stopped.batches = [batch_and_signal]
    with pytest.raises(StoppedError, match=f"stopped at step {step} of 12"):
        stopped.train()
    assert step not in [entry["step"] for entry in stopped.history]
    run(tmp_path / "parts").train()
    assert same_weights(tmp_path / "parts", tmp_path / "whole")
    whole, parts = (
        json.loads((tmp_path / f / "run.json").read_text())["history"] for f in ("whole", "parts")
    )
    for entry in (*whole, *parts):
        entry.pop("minutes")
    assert parts == whole
    done = (tmp_path / "parts" / "run.json").read_text()
    run(tmp_path / "parts").train()
    assert (tmp_path / "parts" / "run.json").read_text() == done


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_told_to_stop_saves_and_says_so(tmp_path, held_out, number):
    process = subprocess.Popen(
        [*command(steps=4000), f"--validation={held_out}", "-o", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for_step(tmp_path, 1, process)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "stopped at step" in said
    assert f"the same command continues {tmp_path}" in said
    assert "Traceback" not in said
    step = torch.load(tmp_path / "last.pt", weights_only=True)["step"]
    assert f"stopped at step {step} of 4000" in said


def test_a_loss_that_is_no_number_ends_the_run_and_keeps_the_checkpoint(tmp_path, run):
    run(tmp_path, TINY.model_copy(update={"steps": 6})).train()
    good = (tmp_path / "last.pt").read_bytes()
    going_on = run(tmp_path, TINY.model_copy(update={"steps": 6}))
    going_on.recipe = TINY
    with torch.no_grad():
        going_on.net.head[2].bias.fill_(float("nan"))
    with pytest.raises(DivergedError, match=r"the loss is nan at step 6.*last\.pt is from before"):
        going_on.train(save_every_s=0)
    assert (tmp_path / "last.pt").read_bytes() == good


@pytest.mark.parametrize(
    ("what", "wreck"),
    [
        ("norm of the gradient", lambda net: net.register_hook(lambda grad: grad * torch.nan)),
        ("sum of the weights", None),
    ],
)
def test_no_checkpoint_of_weights_that_are_no_numbers(tmp_path, run, what, wreck):
    """The loss still is finite in the step that spoils the weights."""
    run(tmp_path, TINY.model_copy(update={"steps": 6})).train()
    kept = {name: (tmp_path / name).read_bytes() for name in ("last.pt", "weights.safetensors")}
    going_on = run(tmp_path, TINY.model_copy(update={"steps": 6}))
    going_on.recipe = TINY.model_copy(update={"validate_every": 1})
    if wreck:
        wreck(going_on.net.head[2].weight)
    else:
        going_on.optimisers.step = lambda rate: going_on.net.head[2].weight.data.fill_(torch.inf)
    with pytest.raises(DivergedError, match=f"the {what} is (nan|inf) at step 6"):
        going_on.train(save_every_s=0)
    assert kept == {name: (tmp_path / name).read_bytes() for name in kept}


def test_divergence_on_the_command_line(tmp_path, held_out):
    wild = ["--set=learning_rate=1e38", "--set=gradient_clip=null"]
    done = subprocess.run(
        [*COMMAND, *wild, f"--validation={held_out}", "-o", str(tmp_path)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert re.search("the sum of the weights is (nan|inf) at step 0", done.stderr)
    assert "try --set learning_rate=5e+37" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")  # TensorBoard's
@pytest.mark.parametrize(("bytes_", "named"), [(1_000_000, r"last\.pt"), (1, r"log\.jsonl")])
def test_a_full_disk_keeps_the_last_checkpoint(tmp_path, run, monkeypatch, bytes_, named):
    """No room for the checkpoint, or not even for the log."""
    monkeypatch.setattr("epinet.train.run.LOG_EVERY", 1)
    recipe = TINY.model_copy(update={"steps": 8, "validate_every": 6})
    run(tmp_path, recipe.model_copy(update={"steps": 6})).train()
    good = (tmp_path / "last.pt").read_bytes()
    going_on = run(tmp_path, recipe.model_copy(update={"steps": 6}))
    going_on.recipe = recipe.model_copy(update={"validate_every": 100})
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    lead = going_on._lead

    def lead_on_a_full_disk(*arguments):
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_, before[1]))
        lead(*arguments)

    going_on._lead = lead_on_a_full_disk
    try:
        with pytest.raises(InputError, match=rf"{named}: cannot be written \(File too large\)"):
            going_on.train(save_every_s=0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert (tmp_path / "last.pt").read_bytes() == good
    assert {p.name for p in tmp_path.iterdir() if p.name.startswith(".")} == set()


def test_a_run_leaves_weights_that_say_what_they_are(tmp_path, run):
    run(tmp_path).train()
    weights = load_weights(tmp_path / "weights.safetensors")
    assert weights.net.config.views == 3
    assert weights.metadata["steps"] == 12
    assert weights.metadata["recipe"] == TINY.as_dict()
    assert weights.metadata["input"] == "local contrast"
    assert weights.disparity_range_px == (-4, 4)
    said = json.loads((tmp_path / "run.json").read_text())
    assert [h["step"] for h in said["history"]] == [6, 12]
    assert {"badpix_0.07", "mse_x100"} <= set(said["history"][0]["scores"])
    best = min(h["scores"]["badpix_0.07"] for h in said["history"])
    kept = load_weights(tmp_path / "best.safetensors").metadata["scores"]["badpix_0.07"]
    assert kept == best
    assert (tmp_path / "validation" / "scene_00000.png").exists()


def test_tensorboard_shows_scores_and_pictures(tmp_path, run, monkeypatch):
    """Once for each step, also where a part of the run is done again."""
    monkeypatch.setattr("epinet.train.run.LOG_EVERY", 1)
    run(tmp_path).train()
    kept = (tmp_path / "last.pt").read_bytes()
    recipe = TINY.model_copy(update={"steps": 18})
    for _ in range(2):
        (tmp_path / "last.pt").write_bytes(kept)
        longer = run(tmp_path)
        longer.recipe = recipe
        longer.train()
        assert longer.step == 18
    events = EventAccumulator(str(tmp_path / "tensorboard"), {"images": 0, "scalars": 0}).Reload()
    assert [e.step for e in events.Images("scene_00000")] == [6, 12, 18]
    assert [e.step for e in events.Scalars("loss")] == list(range(1, 19))
    shown = {e.step: e.value for e in events.Scalars("scores/badpix_0.07")}
    said = json.loads((tmp_path / "run.json").read_text())["history"]
    assert shown == pytest.approx({h["step"]: h["scores"]["badpix_0.07"] for h in said}, abs=1e-3)


def test_progress_tells_the_rate_and_the_time_left(tmp_path, held_out, monkeypatch, log):
    monkeypatch.setattr("epinet.train.run.SAY_EVERY_S", 0.0)
    scenes = Validation.of_folders([held_out], views=3)
    Run(TINY, tmp_path, validation=scenes).train()
    steps = [
        re.match(r"step (\d+) of 12, loss [\d.]+, [\d.]+ steps/s, \d:\d\d:\d\d left", s)
        for s in log.messages
    ]
    assert [int(found[1]) for found in steps if found] == [*range(1, 6), *range(7, 12)]


def test_statistics_are_means_over_the_last_batches(tmp_path, run):
    """Of the first batch-norm layer, against means over its inputs."""
    assert TINY.steps < STATISTICS_BATCHES
    recipe = TINY.model_copy(update={"norms": False, "fixed_norms_from": None})
    trained = run(tmp_path, recipe)
    trained.train()
    net: Epinet = trained.weights().net
    norm = net.streams[0][0][3]
    before = nn.Sequential(*net.streams[0][0][:3])
    means, variances = [], []
    for step in range(TINY.steps):
        stacks = trained.batches[0](step).stacks
        with torch.no_grad(), trained._autocast():
            features = before(stacks[:, 0]).float()
            means.append(features.mean((0, 2, 3)))
            variances.append(features.var((0, 2, 3)))
    assert torch.allclose(norm.running_mean, torch.stack(means).mean(0), atol=1e-4)
    assert torch.allclose(norm.running_var, torch.stack(variances).mean(0), rtol=1e-3)


def test_fixed_norms_keep_their_statistics_and_what_is_trained_is_what_is_used(tmp_path, run):
    recipe = load_recipe("fast-9x9", CHANGES | {"fixed_norms_from": 0.5, "averaging": 0.0})
    fixed = run(tmp_path / "run", recipe)
    seen = []
    while fixed.step < 12:
        fixed._train_step()
        seen.append(fixed.net.state_dict()["head.0.norm.running_mean"].clone())
    assert not torch.equal(seen[4], seen[5])
    assert all(torch.equal(s, seen[5]) for s in seen[6:])
    stacks = fixed.batches[0](12).stacks
    fixed._set_modes()
    with torch.no_grad():
        trained = fixed.net(stacks)
        used = fixed.weights().net(stacks)
    torch.testing.assert_close(used, trained, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("native", [False, True])
def test_a_cpu_without_bfloat16_computes_in_float32_and_says_so(
    tmp_path, held_out, monkeypatch, native, log
):
    """What weights say of their recipe stays as it is, so that a run may go on elsewhere."""
    monkeypatch.setattr("epinet.train.run.computes_bf16", lambda device: native)
    scenes = Validation.of_folders([held_out], views=3)
    assert TINY.bf16
    trained = Run(TINY, tmp_path / "run", validation=scenes)
    assert len([s for s in log.messages if "computing in float32" in s]) == (not native)
    plain = TINY.model_copy(update={"bf16": False})
    exact = Run(plain, tmp_path / "plain", validation=scenes)
    batch = exact.batches[0](0)
    assert torch.equal(trained._loss(batch), exact._loss(batch)) == (not native)
    assert trained.metadata()["recipe"]["bf16"]


@pytest.mark.parametrize("scale", [None, 0.2])
def test_the_loss_follows_its_definition(tmp_path, run, scale):
    recipe = TINY.model_copy(update={"loss_scale_px": scale, "bf16": False})
    trained = run(tmp_path, recipe)
    batch = trained.batches[0](0)
    trained.net.eval()
    error = (trained.net(batch.stacks) - batch.disparity).abs().detach().numpy()
    loss = error if scale is None else scale * np.log(1 + error / scale) + FAR * error
    expected = np.average(loss, weights=batch.weight.numpy())
    assert trained._loss(batch).item() == pytest.approx(expected, rel=1e-4)


def test_batches_made_ahead_change_nothing(tmp_path, run, monkeypatch):
    for ahead in (False, True):
        monkeypatch.setattr("epinet.train.run.pays", lambda *_, ahead=ahead: ahead)
        run(tmp_path / str(ahead), TINY.model_copy(update={"steps": 8})).train()
    assert same_weights(tmp_path / "False", tmp_path / "True")


def test_weights_that_are_not_averaged_are_the_last(tmp_path, run):
    last = run(tmp_path, TINY.model_copy(update={"averaging": 0.0, "steps": 4}))
    last.train()
    assert last.averaged is None
    kept = last.weights().net.state_dict()["head.2.weight"]
    assert torch.equal(kept, last.net.state_dict()["head.2.weight"])
    resumed = run(tmp_path, TINY.model_copy(update={"averaging": 0.0, "steps": 4}))
    assert torch.equal(kept, resumed.weights().net.state_dict()["head.2.weight"])


def test_averaged_weights_follow_their_definition(tmp_path, run):
    recipe = TINY.model_copy(update={"averaging": 0.5, "steps": 5})
    watched = run(tmp_path, recipe)
    expected = None
    for k in range(5):
        watched._train_step()
        now = watched.net.head[2].weight.detach().clone()
        decay = min(0.5, (1 + k) / (10 + k))
        expected = now if expected is None else decay * expected + (1 - decay) * now
    assert torch.allclose(watched.averaged.module.head[2].weight, expected, atol=1e-7)


def test_training_learns(tmp_path, run):
    """One small scene is learned by heart: its loss falls within a few steps."""
    out = write_dataset(
        tmp_path / "set", Options(size=(64, 64), views=3, samples=1), seed=1, scenes=1
    )
    recipe = load_recipe(
        "fast-9x9",
        {
            **CHANGES,
            "width": 70,
            "steps": 40,
            "data": [{"folder": str(out[0])}],
            "validate_every": 20,
        },
    )
    learner = run(tmp_path / "run", recipe)
    for _ in range(40):
        learner._train_step()
    assert sum(learner.losses[-8:]) < 0.7 * sum(learner.losses[:8])


def test_what_cannot_be_continued(tmp_path, run):
    run(tmp_path).train()
    with pytest.raises(InputError, match=r"another recipe \(batch is 2 there, 4 here\)"):
        run(tmp_path, TINY.model_copy(update={"batch": 4}))
    with pytest.raises(InputError, match="views is 3 there, 5 here"):
        run(tmp_path, TINY.model_copy(update={"views": 5}))
    (tmp_path / "last.pt").write_bytes((tmp_path / "last.pt").read_bytes()[:5000])
    with pytest.raises(InputError, match=r"last\.pt: not a checkpoint that can be continued"):
        run(tmp_path)
    for nothing in ({"recipe": TINY.as_dict()}, torch.zeros(3), None):
        torch.save(nothing, tmp_path / "last.pt")
        with pytest.raises(InputError, match=r"last\.pt: not a checkpoint"):
            run(tmp_path)


STEADY = TINY.model_copy(
    update={
        "decay": "constant",
        "widening": 0.0,
        "fixed_norms_from": None,
        "optimiser": "adamw",
        "steps": 4,
    }
)


def test_a_run_at_a_constant_rate_can_be_made_longer(tmp_path, run):
    """Which then is the run that was meant to be so long from the start."""
    assert STEADY.paced_by_steps == []
    for steps in (2, 4):
        run(tmp_path / "parts", STEADY.model_copy(update={"steps": steps})).train()
    run(tmp_path / "whole", STEADY).train()
    assert same_weights(tmp_path / "parts", tmp_path / "whole")
    with pytest.raises(InputError, match=r"has made 4 steps already, more than steps=3"):
        run(tmp_path / "parts", STEADY.model_copy(update={"steps": 3}))


@pytest.mark.parametrize(
    ("paced", "value"), [("decay", "cosine"), ("widening", 0.4), ("fixed_norms_from", 0.3)]
)
def test_a_run_whose_pace_follows_from_its_length_cannot_be_made_longer(
    tmp_path, run, paced, value
):
    recipe = STEADY.model_copy(update={paced: value, "steps": 1})
    run(tmp_path, recipe).train()
    message = rf"begun for 1 steps.* \({paced}={value}\); .*start={tmp_path}/weights.safetensors"
    with pytest.raises(InputError, match=message):
        run(tmp_path, recipe.model_copy(update={"steps": 2}))


def test_a_run_of_an_older_version_goes_on(tmp_path, run):
    """Whose recipe lacks a value that came since: it was made at what is now the default."""
    recipe = STEADY.model_copy(update={"steps": 1})
    run(tmp_path, recipe).train()
    state = torch.load(tmp_path / "last.pt", weights_only=True)
    del state["recipe"]["scene_weights"]
    torch.save(state, tmp_path / "last.pt")
    assert run(tmp_path, recipe).step == 1
    weighted = recipe.model_copy(update={"scene_weights": {"vinyl": 0.5}})
    with pytest.raises(InputError, match=r"scene_weights is .* there, .*vinyl.* here"):
        run(tmp_path, weighted)


def test_a_run_goes_on_with_the_scenes_that_it_was_validated_on(tmp_path, run, held_out):
    run(tmp_path).train()
    (scene,) = Validation.of_folders([held_out], views=3).scenes.values()
    with pytest.raises(InputError, match="was validated on scene_00000, not on another"):
        Run(TINY, tmp_path, validation=Validation({"another": scene}))


def test_processes_that_find_different_checkpoints_do_not_go_on(tmp_path, held_out):
    """As on two machines that do not share the folder."""
    apart = QUICK.replace("Path(sys.argv[2])", "Path(sys.argv[2]) / os.environ['RANK']").replace(
        "validation=scenes)", "validation=scenes, team=processes)"
    )
    head, _, last = apart.strip().rpartition("\n")
    script = tmp_path / "script.py"
    script.write_text(
        f"import os\nimport torch\nfrom epinet.train.parallel import team\n{head}\n"
        f"with team(torch.device('cpu')) as processes:\n    {last}\n"
    )
    recipe = TINY.model_copy(update={"shards": 2})
    scenes = Validation.of_folders([held_out], views=3)
    Run(recipe, tmp_path / "0", validation=scenes).train()
    done = subprocess.run(
        [
            *(*TOGETHER, str(script), recipe.model_dump_json()),
            *(str(tmp_path), str(held_out), CACHE.name),
        ],
        capture_output=True,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    assert done.returncode != 0
    assert "the processes of this run find different checkpoints there" in done.stderr


def test_weights_of_another_network_are_no_start(tmp_path, run):
    published = TINY.model_copy(update={"width": 70})

    def from_(weights: str | Path, recipe: Recipe = published) -> Run:
        return run(tmp_path / "run", recipe.model_copy(update={"start": str(weights)}))

    file = tmp_path / "weights.safetensors"
    contrast = {"input": "local contrast"}
    save_weights(file, Epinet(EpinetConfig(streams=2, views=9)), contrast)
    with pytest.raises(InputError, match="another network"):
        from_(file)
    merge = from_("epinet_9x9").net.merge[0][0].conv.weight
    assert torch.equal(merge, load_weights("epinet_9x9").net.merge[0][0].weight)
    save_weights(file, Epinet(EpinetConfig(views=3)), contrast)
    with pytest.raises(InputError, match="weights of 3 views are no start for 9"):
        from_(file, load_recipe("fast-9x9"))
    save_weights(file, Epinet(EpinetConfig(views=3)), {})
    with pytest.raises(InputError, match=r"see gray are no start .* sees local contrast"):
        from_(file)
    with pytest.raises(InputError, match="elsewhere: no such weights file"):
        from_("elsewhere")


def test_processes_must_share_the_shards_evenly(tmp_path, run):
    from epinet.train.parallel import Team

    with pytest.raises(InputError, match="--set shards=2"):
        run(tmp_path, team=Team(0, 2))


def test_validation_scenes_are_not_training_scenes(tmp_path):
    """Sorted into folders as HCI's are, and every --validation counts."""
    options = Options(size=(48, 48), views=3, samples=1)
    scenes = [
        write_dataset(tmp_path / "hci" / kind, options, seed, scenes=1)[0]
        for seed, kind in enumerate(("training", "stratified"))
    ]
    scenes[1] = scenes[1].rename(scenes[1].parent / "another")
    given = [f"--validation={scene.parent}" for scene in scenes]
    done = subprocess.run(
        [*COMMAND, f"--data={tmp_path / 'hci'}", *given, "-o", str(tmp_path / "run")],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    for scene in scenes:
        assert f"{scene}: is trained on" in done.stderr


def test_weights_may_keep_a_share_of_those_that_they_start_from(held_out, tmp_path):
    """What is kept is the mean of the start and of what the same run keeps without it."""
    scenes = Validation.of_folders([held_out], views=3)
    values = {"steps": 2, "batch": 2, "patch_px": 24, "large_patches": 0.0, "fewer_views": 0.0}
    values |= {"views": 3, "start": "sweepnet", "validate_every": 2, "averaging": 0.0}
    for share in (0.0, 0.25):
        recipe = load_recipe("sweepnet", values | {"start_share": share})
        Run(recipe, tmp_path / str(share), validation=scenes).train()
    start = load_weights("sweepnet").net.state_dict()
    plain, mixed = (
        load_weights(tmp_path / f / "weights.safetensors").net.state_dict() for f in ("0.0", "0.25")
    )
    assert any(not torch.equal(plain[name], start[name]) for name in start)
    for name, tensor in mixed.items():
        expected = 0.75 * plain[name] + 0.25 * start[name]
        torch.testing.assert_close(tensor, expected, rtol=2e-3, atol=1e-4)
    with pytest.raises(InputError, match="start_share"):
        load_recipe("sweepnet", {"start_share": 0.5})


def test_sweepnet_learns_from_folders_whose_range_is_known(held_out, tmp_path):
    scene = write_dataset(
        tmp_path / "set", Options(size=(64, 64), views=3, samples=1), seed=1, scenes=1
    )[0]
    values = {"steps": 2, "batch": 2, "patch_px": 24, "large_patches": 0.0, "views": 3}
    values |= {"start": "sweepnet", "validate_every": 2, "mirror_weight": 0.0}
    values["data"] = [{"folder": str(scene), "disparity_px": [-4, 4]}, {"generator": "narrow"}]
    scenes = Validation.of_folders([held_out], views=3)
    learner = Run(load_recipe("sweepnet", values), tmp_path, validation=scenes)
    learner.train()
    assert load_weights(tmp_path / "weights.safetensors").metadata["data"]["folders"] == [
        str(scene)
    ]
    with pytest.raises(InputError, match="mirror_weight: takes a least_weight and rendered scenes"):
        load_recipe("sweepnet", values | {"mirror_weight": 0.1})


def test_frozen_parts_keep_the_weights_they_start_from(held_out, tmp_path):
    scenes = Validation.of_folders([held_out], views=3)
    values = {"steps": 2, "batch": 2, "patch_px": 24, "large_patches": 0.0, "fewer_views": 0.0}
    values |= {"views": 3, "start": "sweepnet", "validate_every": 2, "frozen": ["sweep", "fill"]}
    recipe = load_recipe("sweepnet", values)
    Run(recipe, tmp_path, validation=scenes).train()
    start = load_weights("sweepnet").net.state_dict()
    after = load_weights(tmp_path / "weights.safetensors").net.state_dict()
    changed = {
        name.partition(".")[0] for name in start if not torch.equal(start[name], after[name])
    }
    assert changed == {"refine"}
    with pytest.raises(InputError, match="frozen: takes a start from weights"):
        load_recipe("sweepnet", {"frozen": ["sweep"]})
    with pytest.raises(InputError, match="frozen"):
        load_recipe("sweepnet", values | {"frozen": ["eyes"]})
