"""Train a recipe on a GPU that is lent for some minutes, and bring home all there is to know.

    python -m benchmarks.gpu_training -o OUT --minutes 9 --recipe fast-9x9 --set batch=64 \\
        [--set KEY=VALUE] [--light-fields FOLDER] [--device cuda]

Renders on the device, finds out how fast steps are, takes as many as the time allows (the recipe's
rate decays over just these), validates on held-out scenes, and predicts the light fields given.
Training is stopped where it would run over its share of the time, so that what has been learned is
always evaluated and written, to a new folder:

OUT/run/         the run: weights, run.json, checkpoint
OUT/maps/        a map and a preview of each light field
OUT/report.json  step rates, memory, scores
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
from epinet.io import read_light_field, write_pfm
from epinet.predict.batch import find_light_fields
from epinet.predict.estimator import Estimator, choose_device
from epinet.predict.pictures import save_preview
from epinet.train.log import Log
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import changed_recipe
from epinet.train.run import Run, StoppedError
from epinet.train.sources import SLOTS, STEPS_PER_POOL
from epinet.train.validation import Validation

TRAINING = 0.8
"""Share of the time by whose end training is stopped; the rest is for scores and maps."""
PLANNED = 0.85
"""Share of what is left for training that the steps should take, as far as they can be foreseen."""
VALIDATIONS = 4
VALIDATION = 0.04
"""Largest share of the time that each of them may take; by it held-out scenes are left out."""


def _steps(run: Run, first: int, count: int) -> float:
    """Seconds that steps take."""
    begun = time.perf_counter()
    for run.step in range(first, first + count):
        run._train_step()
    return time.perf_counter() - begun


def speed(
    recipe: Recipe, device: torch.device, validation_s: float
) -> tuple[dict[str, float], Validation]:
    """Seconds of a step whose scenes are there, and of the scenes of a pool; and so many of the
    scenes that the recipe is validated on as can be predicted in `validation_s`."""
    with TemporaryDirectory() as folder:
        run = Run(recipe, Path(folder), device=device)
        _steps(run, 0, 1)  # first calls are slow, and draw the textures
        with_scenes_s = _steps(run, 1, SLOTS - 1) / (SLOTS - 1)
        step_s = _steps(run, SLOTS, SLOTS) / SLOTS
        scenes = list(run.validation.scenes.items())
        weights, begun = run.weights(), time.perf_counter()
        Validation(dict(scenes[:1])).predict(weights, device, bf16=run.bf16)
        count = max(1, int(validation_s / (time.perf_counter() - begun)))
    found = {"step_s": step_s, "pool_s": max(0.0, with_scenes_s - step_s)}
    return found, Validation(dict(scenes[:count]))


def train(run: Run, end: float) -> float:
    """Train until `end` at the latest, and validate what there is; seconds of the steps."""
    begun, step = time.perf_counter(), run._train_step

    def step_in_time(stop: bool = False) -> None:
        step(stop or time.perf_counter() > end)

    run._train_step = step_in_time  # type: ignore[method-assign]
    try:
        run.train()
    except StoppedError as stop:
        if not stop.resumable:
            raise
        print(f"{stop}: the time is up", flush=True)
    took_s = time.perf_counter() - begun
    if not run.history or run.history[-1]["step"] < run.step:
        with Log(run.folder, run.step) as log:
            run._validate(log)
    return took_s


def evaluate(run: Run, paths: list[Path], out: Path, end: float) -> dict[str, Any]:
    """Scores and maps of light fields, of as many as can be predicted until `end`."""
    estimator = Estimator(run.weights(), device=str(run.device))
    report: dict[str, Any] = {}
    for path in paths:
        if time.perf_counter() > end:
            report[path.name] = "no time was left"
            continue
        result = estimator.predict(read_light_field(path))
        folder = out / path.name
        folder.mkdir(parents=True, exist_ok=True)
        write_pfm(folder / "disparity.pfm", result.disparity)
        save_preview(folder / "preview.png", result)
        report[path.name] = {"scores": result.scores, "seconds": result.seconds}
    return report


def main() -> None:
    begun = time.perf_counter()
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=9.0, help="of everything")
    parser.add_argument("--recipe", default="fast-9x9")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--light-fields", type=Path, action="append", default=[])
    parser.add_argument("--device")
    args = parser.parse_args()
    if args.output.exists():
        parser.error(f"{args.output}: is there already; name a new folder")
    keep_freed_memory()  # as the command line does
    device = choose_device(args.device)
    paths = find_light_fields(args.light_fields)
    end = begun + 60 * args.minutes
    recipe = changed_recipe(args.recipe, args.set, [], [])
    found, held_out = speed(recipe, device, VALIDATION * 60 * args.minutes)
    per_step_s = found["step_s"] + found["pool_s"] / STEPS_PER_POOL
    trained = begun + TRAINING * (end - begun)
    left_s = trained - time.perf_counter()
    steps = max(VALIDATIONS, round(PLANNED * left_s / per_step_s))
    changes = [*args.set, f"steps={steps}", f"validate_every={-(-steps // VALIDATIONS)}"]
    print(f"{steps} steps of {per_step_s:.3f} s", flush=True)
    recipe = changed_recipe(args.recipe, changes, [], [])
    run = Run(recipe, args.output / "run", device=device, validation=held_out)
    took_s = train(run, trained)
    gpu = device.type == "cuda"
    report = {
        "machine": torch.cuda.get_device_name(device) if gpu else platform.processor(),
        "torch": torch.__version__,
        "python": platform.python_version(),
        "recipe": recipe.as_dict(),
        "foreseen": {name: round(value, 4) for name, value in found.items()},
        "steps": run.step,
        "steps_per_s": round(run.step / took_s, 3),
        "patches_per_s": round(recipe.batch * run.step / took_s, 1),
        "peak_gpu_memory_mb": round(torch.cuda.max_memory_allocated() / 2**20) if gpu else None,
        "held_out_scenes": len(held_out.scenes),
        "history": run.history,
        "light_fields": evaluate(run, paths, args.output / "maps", end),
        "minutes": round((time.perf_counter() - begun) / 60, 2),
    }
    (args.output / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps({k: v for k, v in report.items() if k != "recipe"}, indent=1))


if __name__ == "__main__":
    main()
