"""What changes of EPINET's recipe are worth: short runs of equal CPU time, one change each.

    OMP_NUM_THREADS=1 python -m benchmarks.training_levers --minutes 4 12 --machine "2 vCPU Xeon"

Every run begins from scratch and goes through its whole schedule within the CPU time given, which
other work on the machine hardly changes; steps are as many as fit by a timing of the first ones.
Scenes are rendered once, kept in a cache and not counted. Two lengths show slopes: what starts
faster need not end lower. Judged by the small rendered scenes of held-out kinds that runs are
validated on. Each run is saved as it ends; the same command goes on with what is missing, and
`--only NAME` with one change alone.
"""

from __future__ import annotations

import json
import platform
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch

from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.io.atomic import atomic_path
from epinet.synth.generator import VERSION
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run
from epinet.train.sources import STEPS_PER_POOL
from epinet.train.validation import Validation

BASE = "narrow-9x9"
"""The recipe that is changed: at its width, runs as short as these learn most."""

LEVERS: dict[str, dict[str, Any]] = {
    "the recipe": {},
    "without the identity": {"identity": 0.0},
    "half the identity": {"identity": 0.35},
    "without classes": {"class_weight": 0.0},
    "five times the classes' weight": {"class_weight": 1.0},
    "half the rate": {"learning_rate": 1.5e-3},
    "twice the rate": {"learning_rate": 6.0e-3},
    "plain gray views": {"local_contrast": False},
    "width 10": {"width": 10},
    "width 24": {"width": 24},
    "width 35": {"width": 35},
    "width 70, as published": {"width": 70},
    "patches of 32 px, 6 a batch": {"patch_px": 32, "batch": 6},
    "48 patches a batch": {"batch": 48},
    "all scenes with floors": {
        "data": [
            {
                "generator": "hci",
                "options": {
                    "floors": 1.0,
                    "surfaces": [0, 16],
                    "clutter": 0.2,
                    "contrast": [0.0, 0.7],
                },
            }
        ]
    },
    "easier scenes": {
        "data": [
            {
                "generator": "hci",
                "options": {
                    "contrast": [0.3, 1.0],
                    "textureless": 0.0,
                    "reflective": 0.02,
                    "clutter": 0.2,
                    "surfaces": [4, 20],
                    "floors": 0.3,
                    "faults": {"noise": 0.3, "blur": 0.5, "defocus": 0.5},
                },
            }
        ]
    },
    "the range opens in the first 40 %": {"narrow": 0.25, "widening": 0.4},
    "norms never fixed": {"fixed_norms_from": None},
    "averages a quarter as long": {"averaging": 0.98},
    "plain absolute error": {"loss_scale_px": None},
}

TIMED_STEPS = 3
VALIDATIONS = 3


def steps_within(recipe: Recipe, minutes: float, held_out: Validation, cache: Path) -> int:
    """How many steps fit, scenes rendered."""
    with TemporaryDirectory() as trial:
        run = Run(recipe, Path(trial), validation=held_out, cache=cache)
        run._train_step()  # renders, and first calls are slow
        run.step = 0
        begun = time.process_time()
        for _ in range(TIMED_STEPS):
            run._train_step()
            run.step = 0  # of the scenes that are there
        per_step_s = (time.process_time() - begun) / TIMED_STEPS
    return max(VALIDATIONS, round(60 * minutes / per_step_s))


def measured(
    changes: dict[str, Any], minutes: float, held_out: Validation, cache: Path
) -> dict[str, Any]:
    """What a run of so many CPU minutes gives."""
    recipe = load_recipe(BASE, changes | {"bf16": False})
    steps = steps_within(recipe, minutes, held_out, cache)
    last = {"steps": steps, "validate_every": -(-steps // VALIDATIONS)}
    recipe = load_recipe(BASE, changes | {"bf16": False} | last)
    with TemporaryDirectory() as folder:
        run = Run(recipe, Path(folder), validation=held_out, cache=cache)
        run.clock = time.process_time
        run.train()
        return {"history": run.history}


def main() -> None:
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("benchmarks/results/training_levers.json")
    )
    parser.add_argument("--minutes", type=float, nargs="+", default=[4.0, 12.0])
    parser.add_argument("--only", choices=LEVERS, nargs="+", default=list(LEVERS))
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--cache", type=Path, default=Path("out/training_levers"))
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
    torch.set_num_threads(1)  # CPU time is time only then
    held_out = Validation.rendered(9, (-4.0, 4.0))
    for minutes in args.minutes:
        for name in args.only:
            report = json.loads(args.output.read_text()) if args.output.exists() else {"runs": []}
            settings = {
                "lever": name,
                "recipe": load_recipe(BASE, LEVERS[name]).model_dump(
                    mode="json", exclude_defaults=True
                ),
                "minutes": minutes,
                "machine": args.machine,
                "generator": VERSION,
                "steps_per_pool": STEPS_PER_POOL,
            }
            if any(settings.items() <= run.items() for run in report["runs"]):
                continue
            print(f"{name}, {minutes:g} minutes", flush=True)
            run = settings | measured(LEVERS[name], minutes, held_out, args.cache)
            report["runs"].append(run)
            with atomic_path(args.output) as temporary:
                temporary.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
