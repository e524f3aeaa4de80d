"""`python -m tests.kill`: kill -9 at random moments, then again: as if nothing had been.

Predicts, renders, trains, converts and submits, 20 times each: the command is started, killed after
a random part of the time that it takes, and run again until it ends. What it has written must be
what an uninterrupted run writes, and nothing may be left beside it. Ends with status 1 otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.io.pfm import write_pfm
from epinet.model.checkpoint import load_weights

KILLS = 20
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
    epinet(
        inputs,
        "synth",
        str(inputs / "held"),
        "--scenes",
        "1",
        "--seed",
        "2",
        "--size",
        "96x80",
        "--views",
        "5",
    )
    render = ("synth", "out", "--scenes", "3", "--size", "64x64", "--views", "3")
    return {
        "predict": Job(("predict", str(scenes), "-o", "out")),
        "synth": Job(render, ("--resume",)),
        "train": Job((*train, "-o", "run"), content=trained),
        "convert": Job(("convert", str(scenes / "scene_00000"), "a.npz", "--force")),
        "convert_folder": Job(("convert", str(scenes / "scene_00000"), "a", "--force")),
        "submit": Job(("submit", str(maps), "-o", "a.zip")),
    }


def epinet(folder: Path, *command: str, kill_after_s: float | None = None) -> bool:
    """Run a command in a folder; whether it came to its end."""
    run = subprocess.Popen(
        [sys.executable, "-m", "epinet", *command],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        _, said = run.communicate(timeout=kill_after_s)
    except subprocess.TimeoutExpired:
        os.kill(run.pid, signal.SIGKILL)
        run.communicate()
        return False
    if run.returncode:
        raise SystemExit(f"epinet {' '.join(command)}: status {run.returncode}: {said}")
    return True


def problems_of(name: str, job: Job, kills: int, dice: random.Random, place: Path) -> list[str]:
    """Kill a job so many times, each time anew, and compare with what it writes undisturbed."""
    whole = place / "whole"
    whole.mkdir()
    begun = time.monotonic()
    epinet(whole, *job.command)
    took, due, problems, killed = time.monotonic() - begun, job.content(whole), [], 0
    while killed < kills:
        folder = place / "killed"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        after = dice.uniform(0.2, 1.0) * took
        if epinet(folder, *job.command, kill_after_s=after):
            continue
        killed += 1
        left = [str(p.relative_to(folder)) for p in folder.rglob("*")]
        again = job.again if left else ()
        try:
            epinet(folder, *job.command, *again)
        except SystemExit as error:
            problems.append(f"{name}, killed after {after:.2f} s: {error}")
            continue
        if job.content(folder) != due:
            problems.append(f"{name}, killed after {after:.2f} s: other results; it left {left}")
        hidden = [str(p) for p in folder.rglob(".*")]
        if hidden:
            problems.append(f"{name}, killed after {after:.2f} s: left for good: {hidden}")
    print(f"{name}: {killed} kills within {took:.1f} s, {len(problems)} problems", flush=True)
    return problems


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=KILLS, help="of each command")
    parser.add_argument("--only", help="one of the commands")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
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
    print("\n".join(problems))
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
