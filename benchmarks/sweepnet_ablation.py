"""What each part of SweepNet is worth: trained without it, from scratch, for as many steps.

    python benchmarks/sweepnet_ablation.py --machine "2 vCPU Xeon" \\
        -o benchmarks/results/sweepnet_ablation.json

Every variant sees the same scenes in the same order and trains with one thread in a process of its
own, `--jobs` of them at once; those already in the report are kept. Scores are means over small
held-out scenes and over the path-traced set (`make pathtraced`). A variant's run is far shorter
than that of the shipped weights: read the table for what helps, not for how good it gets.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import platform
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import Tensor

from epinet import read_light_field
from epinet.metrics.disparity import score
from epinet.model import matching, sweepnet
from epinet.predict.estimator import Estimator
from epinet.synth.validation import validation_folder
from epinet.train import losses, recipe
from epinet.train.run import Run

RECIPE = "sweepnet"
KEYS = ("badpix_0.07", "badpix_0.03", "mse_x100")


@dataclass(frozen=True)
class Variant:
    says: str
    changes: dict[str, Any] = field(default_factory=dict)
    """To the recipe."""
    patch: Callable[[], None] = lambda: None
    """To the code, in a process of its own."""


def _whole_directions() -> None:
    """Both arms of a direction are shown the mean of the two."""
    costs = matching.Views.costs

    def mixed(self: matching.Views, disparities: Any) -> Tensor:
        cost = costs(self, disparities)
        pairs = cost.unflatten(2, (4, 2, 4)).mean(3, keepdim=True)
        return pairs.expand(-1, -1, -1, 2, -1, -1, -1).flatten(2, 4)

    least_squares = matching.Views.least_squares

    def mixed_squares(self: matching.Views, *args: Any) -> tuple[list[Tensor], Tensor, Tensor]:
        residuals, slopes, matches = least_squares(self, *args)
        eight = torch.cat(residuals, 1).unflatten(1, (4, 2, -1)).mean(2, keepdim=True)
        slopes, matches = (
            t.unflatten(1, (4, 2)).mean(2, keepdim=True).expand(-1, -1, 2, -1, -1).flatten(1, 2)
            for t in (slopes, matches)
        )
        return [eight.expand(-1, -1, 2, -1, -1, -1).flatten(1, 3)], slopes, matches

    matching.Views.costs = mixed  # type: ignore[method-assign]
    matching.Views.least_squares = mixed_squares  # type: ignore[method-assign,assignment]


def _no_gathered_costs() -> None:
    def nothing(cost: Tensor, spacing_px: float) -> tuple[Tensor, Tensor]:
        wide, distinct = matching.gathered(cost, spacing_px)
        return torch.zeros_like(wide), torch.zeros_like(distinct)

    sweepnet.gathered = nothing


def _upright_only() -> None:
    matching.LEANS = matching.LEANS[:1]


def _no_half_refinement() -> None:
    class Skipping(sweepnet.SweepNet):
        def __init__(self, config: sweepnet.SweepNetConfig) -> None:
            super().__init__(config)
            self.refine[0].forward = lambda views, disparity, *_: (disparity, None)

    recipe.SweepNet = Skipping  # type: ignore[misc]


def _no_context() -> None:
    forward = sweepnet._Fill.forward

    def without(self: sweepnet._Fill, *args: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        filled, context, weights = forward(self, *args)
        return filled, torch.zeros_like(context), weights

    sweepnet._Fill.forward = without  # type: ignore[assignment]


def _no_classes() -> None:
    losses.CLASSES = 0.0


VARIANTS = {
    "all": Variant("all of it"),
    "all again": Variant("all of it, another seed", {"seed": 2}),
    "directions": Variant(
        "four directions instead of eight arms: opposite sides not told apart",
        patch=_whole_directions,
    ),
    "spacing": Variant("hypotheses 1 px apart instead of .5", {"shape": {"spacing_px": 1.0}}),
    "gathered": Variant("no costs gathered over wide squares", patch=_no_gathered_costs),
    "leaning": Variant("gathered over upright squares only", patch=_upright_only),
    "half": Variant("no refinement at half resolution", patch=_no_half_refinement),
    "last": Variant(
        "no last refinement (.08 px)",
        {"shape": {"spreads_px": [0.25, 0.25], "neighbours": [[3, 2], [5, 2]]}},
    ),
    "neighbours": Variant(
        "no choice among neighbours", {"shape": {"neighbours": [[1, 1], [1, 1], [1, 1]]}}
    ),
    "surroundings": Variant(
        "no views moved by the extremes of the surroundings",
        {"shape": {"surroundings_px": [1, 1, 1]}},
    ),
    "context": Variant("no context passed to the refinements", patch=_no_context),
    "plain": Variant("plain absolute error instead of the robust one", {"loss_scale_px": None}),
    "classes": Variant("no classification of the hypotheses in the loss", patch=_no_classes),
    "floors": Variant("no scenes with floors", {"data": [{"generator": "hci"}]}),
    "alike": Variant("all pixels count alike", {"least_weight": 1.0}),
}


def trained(name: str, steps: int) -> dict[str, Any]:
    """Scores of a variant, in this process."""
    torch.set_num_threads(1)
    variant = VARIANTS[name]
    variant.patch()
    begun = time.process_time()
    changes: dict[str, Any] = {
        "steps": steps,
        "validate_every": steps,
        "patch_px": 58,
        "large_patches": 0.0,
    }
    with TemporaryDirectory() as folder:
        chosen = recipe.load_recipe(RECIPE, changes | variant.changes)
        run = Run(chosen, Path(folder), say=lambda line: None)
        run.train()
        minutes = (time.process_time() - begun) / 60
        estimator = Estimator(run.weights(), device="cpu")
        small = run.history[-1]["scores"]
    each = []
    traced = validation_folder().parent / "pathtraced"
    for scene in json.loads((traced / "dataset.json").read_text())["scenes"]:
        lf = read_light_field(traced / scene)
        assert lf.truth is not None
        each.append(score(estimator.predict(lf).disparity, lf.truth))
    return {
        "says": variant.says,
        "cpu_minutes": round(minutes, 1),
        "held-out": {key: round(small[key], 2) for key in KEYS},
        "path-traced": {key: round(sum(s[key] for s in each) / len(each), 2) for key in KEYS},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--only", nargs="*", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    args = parser.parse_args()
    report: dict[str, Any] = {"machine": args.machine, "steps": args.steps, "variants": {}}
    if args.output.exists():
        saved = json.loads(args.output.read_text())
        if saved["steps"] != args.steps:
            parser.error(f"{args.output}: holds runs of {saved['steps']} steps; name another file")
        report["variants"] = saved["variants"]
    missing = [name for name in args.only if name not in report["variants"]]
    spawning = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.jobs, spawning, max_tasks_per_child=1) as pool:
        for run in as_completed(jobs := {pool.submit(trained, n, args.steps): n for n in missing}):
            report["variants"][jobs[run]] = run.result()
            args.output.write_text(json.dumps(report, indent=1) + "\n")
            print(jobs[run], json.dumps(report["variants"][jobs[run]]), flush=True)


if __name__ == "__main__":
    main()
