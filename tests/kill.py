"""`python -m tests.kill`: kill -9 at random moments, then again: as if nothing had been.

Predicts, renders, trains, converts and submits, 20 times each: the command is started, killed after
a random part of the time that it takes or that it writes, and run again until it ends. What it has
written must be what an uninterrupted run writes, and nothing may be left beside it. Ends with
status 1 otherwise.
"""

from __future__ import annotations

import importlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
import yaml

from epinet import cli
from epinet.arguments import Parser
from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.io.pfm import write_pfm
from epinet.networks.weights import load_weights

KILLS = 20
POLL_S = 0.005
IMPORTED = (
    "epinet.benchmark.submission",
    "epinet.predict.batch",
    "epinet.synth.dataset",
    "epinet.train.run",
    "scipy.io",
    "scipy.ndimage",
    "torch.utils.tensorboard",
)
TIMES = ("seconds", "minutes")
"""Keys of records that tell how long something took."""


@dataclass(frozen=True)
class Job:
    """A command that writes into its working folder."""

    command: tuple[str, ...]
    again: tuple[str, ...] = ()
    """Added when it is run again."""
    content: Callable[[Path], object] = lambda folder: files_of(folder)


def files_of(folder: Path) -> dict[str, object]:
    """Content by name of all that a command wrote; of records, without times."""
    found: dict[str, object] = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = str(path.relative_to(folder))
        found[name] = (
            timeless(json.loads(path.read_text())) if path.suffix == ".json" else path.read_bytes()
        )
    return found


def timeless(value: object) -> object:
    """A record without what differs from run to run."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if k not in TIMES}
    return [timeless(v) for v in value] if isinstance(value, list) else value


def trained(folder: Path) -> dict[str, object]:
    """Weights, their history and the log of a run; whatever else is there by its name."""
    out: dict[str, object] = {}
    for name in ("weights", "best"):
        weights = load_weights(folder / "run" / f"{name}.safetensors")
        out[name] = {n: t.numpy().tobytes() for n, t in weights.net.state_dict().items()}
        out[f"{name} says"] = timeless(weights.metadata)
    lines = (folder / "run" / "log.jsonl").read_text().splitlines()
    out["log"] = [timeless(json.loads(line)) for line in lines]
    names = (p for p in folder.rglob("*") if "tensorboard" not in p.parts)
    out["names"] = sorted(str(p.relative_to(folder)) for p in names)
    return out


def jobs(inputs: Path) -> dict[str, Job]:
    """The commands, with what they read."""
    scenes = inputs / "scenes"
    epinet(inputs, "synth", str(scenes), "--scenes", "1", "--size", "96x80", "--views", "5")
    maps = inputs / "maps"
    for name in BENCHMARK_SCENES:
        write_pfm(maps / f"{name}.pfm", np.ones((512, 512), np.float32))
        (maps / "runtimes").mkdir(exist_ok=True)
        (maps / "runtimes" / f"{name}.txt").write_text("1.5\n")
    recipe = {
        "base": "sweepnet", "start": "own", "steps": 6, "validate_every": 2, "batch": 4,
        "patch_px": 16, "large_patches": 0.0, "fewer_views": 0.0, "warmup_steps": 0, "views": 5,
        "start_share": 0.0, "frozen": [], "mirror_weight": 0.0,
        "data": [{"folder": str(scenes)}],
    }  # fmt: skip
    (inputs / "tiny.yaml").write_text(yaml.safe_dump(recipe))
    train = ("train", "--recipe", str(inputs / "tiny.yaml"), "--validation", str(inputs / "held"))
    held = ("--seed", "2", "--size", "96x80", "--views", "5")
    epinet(inputs, "synth", str(inputs / "held"), "--scenes", "1", *held)
    render = ("synth", "out", "--scenes", "3", "--size", "64x64", "--views", "3")
    return {
        "predict": Job(("predict", str(scenes), "-o", "out")),
        "synth": Job(render, ("--resume",)),
        "train": Job((*train, "-o", "run"), content=trained),
        "convert": Job(("convert", str(scenes / "scene_00000"), "a.npz", "--force")),
        "convert_folder": Job(("convert", str(scenes / "scene_00000"), "a", "--force")),
        "submit": Job(("submit", str(maps), "-o", "a.zip")),
    }


def epinet(folder: Path, *command: str, kill: Callable[[], bool] = lambda: False) -> bool:
    """Run a command in a folder, or kill it as soon as it is to be; whether it came to its end.

    It is a fork of this process, which has imported all that the commands need: most of the time
    would go there.
    """
    with tempfile.TemporaryFile("w+") as said:
        child = os.fork()
        if not child:
            os._exit(_status_of(folder, command, said.fileno()))
        while not (ended := os.waitpid(child, os.WNOHANG))[0]:
            if kill():
                os.kill(child, signal.SIGKILL)
                return os.waitpid(child, 0)[1] == 0
            time.sleep(POLL_S)
        said.seek(0)
        if ended[1]:
            raise SystemExit(f"epinet {' '.join(command)}: status {ended[1]}: {said.read()}")
    return True


def _status_of(folder: Path, command: tuple[str, ...], said: int) -> int:
    """Exit status of a command, run in this process."""
    try:
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        os.dup2(said, sys.stderr.fileno())
        sys.argv = ["epinet", *command]
        cli.main()
    except SystemExit as end:
        return int(end.code or 0)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


class Clock:
    """Seconds since a command began, and since its first file or folder appeared."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.begun, self.wrote = folder, time.monotonic(), float("inf")

    def passed(self) -> tuple[float, float]:
        now = time.monotonic()
        if self.wrote == float("inf") and any(self.folder.iterdir()):
            self.wrote = now
        return now - self.begun, now - self.wrote

    def is_past(self, seconds: float, *, of_writing: bool) -> bool:
        return self.passed()[of_writing] >= seconds


def problems_of(name: str, job: Job, kills: int, dice: random.Random, place: Path) -> list[str]:
    """Kill a job so many times, each time anew, and compare with what it writes undisturbed.

    Every second kill comes after its first file has appeared: most of a short command is start.
    """
    whole = place / "whole"
    whole.mkdir()
    clock = Clock(whole)
    epinet(whole, *job.command, kill=lambda: clock.passed()[0] < 0)
    took, due, problems, killed = clock.passed(), job.content(whole), [], 0
    while killed < kills:
        folder = place / "killed"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        writing = killed % 2 == 0
        after = dice.uniform(0.0 if writing else 0.2, 1.0) * took[writing]
        clock = Clock(folder)
        is_due = partial(clock.is_past, after, of_writing=writing)
        if epinet(folder, *job.command, kill=is_due):
            continue
        killed += 1
        left = sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))
        what = f"{name}, killed {after:.2f} s after its {'first file' if writing else 'start'}"
        try:
            epinet(folder, *job.command, *(job.again if left else ()))
        except SystemExit as error:
            problems.append(f"{what}: {error}; it left {left}")
            continue
        if job.content(folder) != due:
            problems.append(f"{what}: other results; it left {left}")
        hidden = [str(p) for p in folder.rglob(".*")]
        if hidden:
            problems.append(f"{what}: left for good: {hidden}")
    print(f"{name}: {killed} kills within {took[0]:.1f} s, {len(problems)} problems", flush=True)
    return problems


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=KILLS, help="of each command")
    parser.add_argument("--only", help="one of the commands")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    torch.set_num_threads(1)  # a fork has none of the others
    for name in IMPORTED:
        importlib.import_module(name)
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        (place / "inputs").mkdir()
        for name, job in jobs(place / "inputs").items():
            if chosen.only not in (None, name):
                continue
            (place / name).mkdir()
            dice = random.Random(f"{chosen.seed} {name}")
            problems += problems_of(name, job, chosen.kills, dice, place / name)
    for problem in problems:
        print(problem)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
