"""The paper's recipe beside ours: the same scenes, the same machine, the same time.

    OMP_NUM_THREADS=1 python -m benchmarks.training_curves --minutes 10 --machine "2 vCPU Xeon" \\
        -o benchmarks/results/training_curves.json

Renders 16 scenes to train on (as many as the paper has) and validates on small rendered ones of
held-out kinds. The recipes train side by side, a process of one thread each, for the same CPU
time, which other work on the machine hardly changes. Ours, whose rate falls to zero, is told how
many steps that is by timing a few first; the paper's stays at the rate it starts with, as it would
for so small a part of its ten million steps. All compute in float32, since bf16 is faster on some
machines only. Also writes the curves as a picture beside the JSON.
"""

from __future__ import annotations

import json
import multiprocessing
import platform
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from matplotlib.figure import Figure

from benchmarks.real_light_fields import constant_map
from epinet.arguments import Parser
from epinet.synth.dataset import write_dataset
from epinet.synth.generator import VERSION
from epinet.synth.options import Options
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run
from epinet.train.validation import Validation

SEED = 2018
SCENES = 16
RECIPES: dict[str, dict[str, Any]] = {
    "paper-9x9": {"decay": "constant"},
    "fast-9x9": {},
    "narrow-9x9": {},
}
"""Recipes and what is changed of them."""
TIMED_STEPS = 12
VALIDATIONS = 12


def trained(
    data: Path, minutes: float, folder: Path, held_out: Validation, name: str
) -> dict[str, Any]:
    """Recipe and history of a run of about so many minutes, validations left out."""
    torch.set_num_threads(1)  # CPU time is time only then
    same: dict[str, Any] = {"data": [{"folder": str(data)}], "bf16": False}
    same |= RECIPES[name]
    recipe = load_recipe(name, same)
    with TemporaryDirectory() as trial:
        run = Run(recipe, Path(trial), validation=held_out)
        run._train_step()  # first calls are slow
        begun = time.process_time()
        for _ in range(TIMED_STEPS):
            run._train_step()
        per_step_s = (time.process_time() - begun) / TIMED_STEPS
    steps = max(VALIDATIONS, round(60 * minutes / per_step_s))
    changes = {"steps": steps, "validate_every": steps // VALIDATIONS}
    run = Run(load_recipe(name, same | changes), folder / name, validation=held_out)
    run.clock = time.process_time
    run.train()
    return {"recipe": run.recipe.as_dict(), "history": run.history}


def constant_maps(held_out: Validation) -> dict[str, float]:
    """Scores of each scene's best constant, averaged over the scenes."""
    each = [constant_map(lf.truth) for lf in held_out.scenes.values() if lf.truth is not None]
    return {key: round(sum(s[key] for s in each) / len(each), 3) for key in each[0]}


def plot(report: dict[str, Any], path: Path) -> None:
    """Both scores against steps and against time."""
    figure = Figure(figsize=(9, 6), layout="constrained", dpi=110)
    axes = figure.subplots(2, 2)
    scores = (("badpix_0.07", "BadPix(.07), %"), ("mse_x100", "MSE x100"))
    for row, (key, label) in zip(axes, scores, strict=True):
        for panel, (x, x_label) in zip(
            row, (("step", "steps"), ("minutes", "CPU minutes")), strict=True
        ):
            for name, run in report["runs"].items():
                points = [(h[x], h["scores"][key]) for h in run["history"]]
                panel.plot(*zip(*points, strict=True), marker=".", label=name)
            panel.axhline(report["constant_map"][key], color="gray", ls=":", label="constant map")
            panel.set_xlabel(x_label)
            panel.set_ylabel(label)
            panel.set_yscale("log")
            if x == "step":
                panel.set_xscale("log")
    axes[0, 0].legend()
    figure.savefig(path)


def main() -> None:
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=30.0, help="for each recipe")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--cache", type=Path, default=Path("out/training_curves"))
    args = parser.parse_args()
    data = args.cache / "scenes"
    write_dataset(data, Options(), SEED, SCENES, star_only=True, existing="resume")
    held_out = Validation.rendered(9, Options().disparity_px)
    work = partial(trained, data, args.minutes, args.cache, held_out)
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(RECIPES), spawned) as processes:
        runs = dict(zip(RECIPES, processes.map(work, RECIPES), strict=True))
    report = {
        "machine": args.machine,
        "generator": VERSION,
        "minutes": args.minutes,
        "scenes": SCENES,
        "constant_map": constant_maps(held_out),
        "runs": runs,
    }
    args.output.write_text(json.dumps(report, indent=1) + "\n")
    plot(report, args.output.with_suffix(".png"))


if __name__ == "__main__":
    main()
