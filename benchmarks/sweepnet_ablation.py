"""What each part of SweepNet is worth: the shipped weights learn to do without it.

    python -m benchmarks.sweepnet_ablation --machine "2 vCPU Xeon" \\
        -o benchmarks/results/sweepnet_ablation.json

Every variant starts from the shipped weights with a part taken out, and learns for `--steps` steps
of their recipe in small patches: the same scenes in the same order, one thread in a process of its
own, `--jobs` of them at once; those already in the report are kept. With nothing taken out as many
steps are taken, too. Scores are means over small held-out scenes and over the path-traced set
(`make pathtraced`), whose stated ranges are kept back. Longer training would win back more of what
is lost.
"""

from __future__ import annotations

import json
import multiprocessing
import platform
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet import read_light_field
from epinet.arguments import Parser
from epinet.metrics.disparity import score
from epinet.networks import weights
from epinet.networks.sweepnet import layers, loss, matching, network
from epinet.predict import estimator
from epinet.synth.generator import VERSION
from epinet.synth.validation import validation_folder
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run

RECIPE = "sweepnet"
KEYS = ("badpix_0.07", "badpix_0.03", "mse_x100")
Shown = tuple[Tensor, matching.Squares, matching.Squares, matching.Squares]


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

    def mixed(self: matching.Views, disparities: Any) -> tuple[Tensor, Tensor]:
        shown, distinct = costs(self, disparities)
        pairs = shown[:, :, : matching.PARTS].unflatten(2, (4, 2, 4)).mean(3, keepdim=True)
        eight = pairs.expand(-1, -1, -1, 2, -1, -1, -1).flatten(2, 4)
        return torch.cat([eight, shown[:, :, matching.PARTS :]], 2), distinct

    least_squares = matching.Views.least_squares

    def mixed_squares(self: matching.Views, *args: Any, **options: Any) -> Shown:
        residuals, *squares = least_squares(self, *args, **options)
        eight = residuals.unflatten(1, (4, 2, -1)).mean(2, keepdim=True)
        pairs = ([t.unflatten(1, (4, 2)).mean(2, keepdim=True) for t in arms] for arms in squares)
        own, wide, fine = (
            matching.Squares(*(t.expand(-1, -1, 2, -1, -1).flatten(1, 2) for t in pair))
            for pair in pairs
        )
        return eight.expand(-1, -1, 2, -1, -1, -1).flatten(1, 3), own, wide, fine

    matching.Views.costs = mixed
    matching.Views.least_squares = mixed_squares


def _no_gathered_costs() -> None:
    gathered = matching.gathered

    def nothing(cost: Tensor) -> tuple[Tensor, Tensor]:
        wide, distinct = gathered(cost)
        return torch.zeros_like(wide), torch.zeros_like(distinct)

    matching.gathered = nothing


def _without(skipped: int) -> Callable[[], None]:
    """A refinement that passes on its map, and the error that the one before it expects."""

    def patch() -> None:
        forward = layers.Refine.forward
        expected = torch.zeros(1, 1, 1, 1)

        def skipping(
            self: layers.Refine, views: Any, disparity: Tensor, *args: Any, **options: Any
        ) -> Any:
            nonlocal expected
            if self.place == skipped:
                return disparity, F.interpolate(expected, disparity.shape[-2:])
            disparity, expected = forward(self, views, disparity, *args, **options)
            return disparity, expected

        begin = network.SweepNet.__init__

        def numbered(self: network.SweepNet, *config: layers.SweepNetConfig) -> None:
            begin(self, *config)
            for place, refine in enumerate(self.refine):
                refine.place = place

        network.SweepNet.__init__ = numbered
        layers.Refine.forward = skipping

    return patch


def _shaped(
    change: Callable[[layers.SweepNetConfig], layers.SweepNetConfig],
) -> Callable[[], None]:
    """A network of the same weights that works by another configuration."""

    def patch() -> None:
        hypotheses = network.SweepNet.hypotheses

        def shaped(self: network.SweepNet, *args: Any) -> tuple[int, Tensor]:
            self.config = change(self.config)
            return hypotheses(self, *args)

        network.SweepNet.hypotheses = shaped

    return patch


def _once(config: layers.SweepNetConfig) -> layers.SweepNetConfig:
    return replace(config, full=replace(config.full, rounds=1))


def _no_fill() -> None:
    forward = layers.Fill.forward

    def without(self: layers.Fill, swept: Tensor, *args: Tensor) -> tuple[Tensor, ...]:
        return swept, *forward(self, swept, *args)[1:]

    layers.Fill.forward = without


def _no_neighbours() -> None:
    neighbours = layers._neighbours

    def own(images: Tensor, side: int, apart_px: int) -> list[Tensor]:
        if apart_px == 1:  # by which a map is enlarged
            return neighbours(images, side, apart_px)
        return [images] * side**2

    layers._neighbours = own


def _two_windows() -> None:
    layers.BOXES_PX = (5, 5, 15, 15)


def _squares(
    choose: Callable[[list[matching.Squares]], list[matching.Squares]],
) -> Callable[[], None]:
    """Other least squares than the arms' own, those of the mean and those of fine texture."""

    def patch() -> None:
        least_squares = matching.Views.least_squares

        def other(self: matching.Views, *args: Any, **options: Any) -> Shown:
            residuals, *squares = least_squares(self, *args, **options)
            own, wide, fine = choose(squares)
            return residuals, own, wide, fine

        matching.Views.least_squares = other

    return patch


def _not_doubled() -> None:
    matching.doubled = lambda images: images


def _no_gains() -> None:
    estimator.even = lambda stacks, gains: None


def _no_context() -> None:
    forward = layers.Fill.forward

    def without(self: layers.Fill, *args: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        filled, context, shares = forward(self, *args)
        return filled, torch.zeros_like(context), shares

    layers.Fill.forward = without


def _no_classes() -> None:
    loss.CLASSES = 0.0


HCI, FLOORS, NARROW, WIDE = load_recipe(RECIPE).as_dict()["data"]
VARIANTS = {
    "all": Variant("nothing"),
    "all again": Variant("nothing, another seed", {"seed": 2}),
    "directions": Variant("eight arms: opposite sides are not told apart", patch=_whole_directions),
    "spacing": Variant(
        "hypotheses 1 px apart: they are .5 px apart",
        patch=_shaped(lambda config: replace(config, spacing_px=0.5)),
    ),
    "gathered": Variant("costs gathered over wide squares", patch=_no_gathered_costs),
    "fill": Variant("the fill's correction", patch=_no_fill),
    "context": Variant("context passed to the refinements", patch=_no_context),
    "half": Variant("the refinement at half resolution", patch=_without(0)),
    "full": Variant("the refinement at full resolution", patch=_without(1)),
    "rounds": Variant("the second round at full resolution", patch=_shaped(_once)),
    "windows": Variant("windows of 1 and 45 px for least squares", patch=_two_windows),
    "slopes": Variant(
        "slopes of the mean of all views: the arms' own",
        patch=_squares(lambda shown: shown[:1] * 3),
    ),
    "fine": Variant(
        "telling fine texture from what is smooth",
        patch=_squares(lambda shown: [*shown[:2], shown[1]]),
    ),
    "neighbours": Variant("choice among neighbours", patch=_no_neighbours),
    "doubled": Variant("views of twice the size to sample from", patch=_not_doubled),
    "gains": Variant("views evened in brightness", patch=_no_gains),
    "plain": Variant("the robust error: the plain one instead", {"loss_scale_px": None}),
    "classes": Variant("the classification of hypotheses in the loss", patch=_no_classes),
    "alike": Variant("weights by what the views tell: all pixels alike", {"least_weight": 1.0}),
    "floors": Variant("scenes with floors", {"data": [HCI, NARROW, WIDE]}),
    "ranges": Variant("scenes of narrow and of wide ranges", {"data": [HCI, FLOORS]}),
}
"""By what is taken out."""


def trained(name: str, steps: int) -> dict[str, Any]:
    """Scores of a variant, in this process."""
    torch.set_num_threads(1)
    variant = VARIANTS[name]
    variant.patch()
    changes: dict[str, Any] = {
        "start": RECIPE,
        "steps": steps,
        "warmup_steps": steps // 10,
        "learning_rate": 1e-3,
        "averaging": 0.9,
        "validate_every": steps,
        "patch_px": 58,
        "large_patches": 0.0,
    }
    with TemporaryDirectory() as folder:
        chosen = load_recipe(RECIPE, changes | variant.changes)
        run = Run(chosen, Path(folder))
        run.train()
        predictor = estimator.Estimator(run.weights(), device="cpu")
        small = run.history[-1]["scores"]
    each = []
    traced = validation_folder().parent / "pathtraced"
    for scene in json.loads((traced / "dataset.json").read_text())["scenes"]:
        lf = read_light_field(traced / scene)
        assert lf.truth is not None
        alone = replace(lf, camera=None)  # which states the range, and so hides what mirrors do
        each.append(score(predictor.predict(alone).disparity, lf.truth))
    return {
        "says": variant.says,
        "held-out": {key: round(small[key], 2) for key in KEYS},
        "path-traced": {key: round(sum(s[key] for s in each) / len(each), 2) for key in KEYS},
    }


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--only", nargs="*", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    args = parser.parse_args()
    report: dict[str, Any] = {
        "machine": args.machine,
        "steps": args.steps,
        "generator": VERSION,
        "weights": weights.load_weights(RECIPE).sha256,
        "variants": {},
    }
    if args.output.exists():
        saved = json.loads(args.output.read_text())
        if any(saved.get(key) != report[key] for key in ("steps", "generator", "weights")):
            parser.error(f"{args.output}: of other scenes, weights or steps; name another file")
        report["variants"] = saved["variants"]
    missing = [name for name in args.only if name not in report["variants"]]
    spawning = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.jobs, spawning, max_tasks_per_child=1) as pool:
        for run in as_completed(jobs := {pool.submit(trained, n, args.steps): n for n in missing}):
            made = report["variants"] | {jobs[run]: run.result()}
            report["variants"] = {name: made[name] for name in VARIANTS if name in made}
            args.output.write_text(json.dumps(report, indent=1) + "\n")
            print(jobs[run], json.dumps(report["variants"][jobs[run]]), flush=True)


if __name__ == "__main__":
    main()
