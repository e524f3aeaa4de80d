"""Tables from trainings: streams (table 1, figure 3), views and augmentations (table 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
from matplotlib.figure import Figure

from benchmarks.paper_tables import published
from benchmarks.paper_tables.published import BAD, MSE
from benchmarks.paper_tables.saved import machines, saved_run
from benchmarks.paper_tables.tables import Row, Spread, Table
from benchmarks.training_curves import constant_maps
from epinet.io.atomic import atomic_path
from epinet.io.problems import listed
from epinet.predict.batch import find_light_fields
from epinet.progress import progress
from epinet.synth.dataset import write_dataset
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX, Options
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run
from epinet.train.validation import SCENES, Validation

STUDIED = ("views", "streams", "augmentations", "scale_weights")
"""What the tables vary: in every budget this is the paper recipe's."""

CONSTANT = "best constant map"

LABELS = {
    "paper-1-stream": "1 stream",
    "paper-2-streams": "2 streams",
    "paper-3x3": "3x3",
    "paper-5x5": "5x5",
    "paper-7x7": "7x7, all augmentations",
    "paper-9x9": "9x9",
    "paper-7x7-colour": "7x7, colour alone",
    "paper-7x7-view-shift": "7x7, colour and view shift",
    "paper-7x7-rotation": "7x7, colour and rotation",
    "paper-7x7-scale": "7x7, colour and scaling",
}


@dataclass(frozen=True)
class Budget:
    """How much a run is given."""

    about: str
    steps: int
    seeds: int
    base: str | None
    """Recipe whose optimisation is used; None: the paper's own."""
    changes: dict[str, Any] = field(default_factory=dict)
    scenes: int | None = None
    """Scenes rendered once to train on; None: new ones all the time, as the recipe says."""
    side_px: int = 512


BUDGETS = {
    "hours": Budget(
        "As in the paper the scenes are few and always the same, so that augmentation counts; "
        "only the network is narrower, the run shorter and the optimisation quicker.",
        steps=500,
        seeds=2,
        base="narrow-9x9",
        changes={"warmup_steps": 25, "averaging": 0.98, "validate_every": 50},
        scenes=16,
        side_px=256,
    ),
    "days": Budget(
        "The paper's own optimisation and length; meant for days on GPUs.",
        steps=10_000_000,
        seeds=3,
        base=None,
        changes={"validate_every": 20_000},
    ),
}


def recipe_for(name: str, seed: int, budget: Budget, data: Sequence[Path] = ()) -> Recipe:
    """A recipe of the paper's tables at a budget; what the tables study stays the paper's."""
    paper = load_recipe(name)
    changes: dict[str, Any] = {"name": name, "seed": seed, "steps": budget.steps} | budget.changes
    if data:
        changes["data"] = [{"folder": str(folder)} for folder in data]
    if budget.base is None:
        return load_recipe(name, changes)
    studied = {key: paper.as_dict()[key] for key in STUDIED}
    return load_recipe(budget.base, studied | changes)


def settings_of(recipe: Recipe, budget: Budget, validation: Sequence[Path] = ()) -> dict[str, Any]:
    """All that decides what a run gives; of the recipe, what is not its default."""
    judged = {"validation": [str(folder) for folder in validation]} if validation else {}
    scenes = {"scenes": budget.scenes, "side_px": budget.side_px, "generator": VERSION}
    return recipe.model_dump(mode="json", exclude_defaults=True) | scenes | judged


@dataclass(frozen=True)
class Trainings:
    """The trainings of one budget: their folders in `runs`, what they gave in `results`."""

    budget: Budget
    results: Path
    runs: Path
    machine: str
    data: tuple[Path, ...] = ()
    """Scenes with truth to train on instead of rendered ones; HCI's, say."""
    validation: tuple[Path, ...] = ()
    """Scenes with truth to judge by instead of rendered ones."""

    def reports(self, name: str) -> list[Any]:
        """What the runs of a recipe gave, seed by seed; those not saved yet are run."""
        return [self._report(name, seed) for seed in range(1, self.budget.seeds + 1)]

    def _report(self, name: str, seed: int) -> Any:
        budget = self.budget
        recipe = recipe_for(name, seed, budget, self.data)
        settings = settings_of(recipe, budget, self.validation)
        file = self.results / f"{name}_seed{seed}.json"
        return saved_run(file, settings, lambda: self._run(name, seed))

    def _run(self, name: str, seed: int) -> dict[str, Any]:
        recipe = recipe_for(name, seed, self.budget, self._trained_on)
        run = Run(recipe, self.runs / f"{name}_seed{seed}", validation=self._judged_by)
        run.train()
        return {
            "history": run.history,
            "scores": run.history[-1]["scores"],
            "minutes": round(run.seconds / 60, 2),
            "machine": self.machine,
            "threads": torch.get_num_threads(),
        }

    def constant(self) -> dict[str, list[float]]:
        """Scores of each scene's best constant map, which is to have learned nothing."""
        settings = {"generator": VERSION, "validation": [str(folder) for folder in self.validation]}
        file = self.results / "constant.json"
        report = saved_run(file, settings, lambda: constant_maps(self._judged_by))
        return {key: [report[key]] for key in (BAD, MSE)}

    @cached_property
    def _trained_on(self) -> list[Path]:
        """Scenes on disk to train on, with the truths that view shift needs; none: new ones."""
        if self.data or self.budget.scenes is None:
            return find_light_fields(self.data)
        folder, options = self.runs / "scenes", Options(size=(self.budget.side_px,) * 2)
        with progress("rendering") as advance:
            return write_dataset(
                folder,
                options,
                1,
                self.budget.scenes,
                truths=True,
                existing="resume",
                advance=advance,
            )

    @cached_property
    def _judged_by(self) -> Validation:
        """Of 9x9 views, so that all runs are judged by the same scenes."""
        if self.validation:
            return Validation.of_folders(self.validation, 9, find_light_fields(self.data))
        return Validation.rendered(9, RANGES_PX["hci"])


def streams(trainings: Trainings) -> Table:
    """Table 1; also draws figure 3 beside the runs."""
    reports = {name: trainings.reports(name) for name in published.STREAMS}
    _draw_curves(trainings.results / "streams.png", reports)
    title = "Table 1: streams, at equal parameters"
    return _table(title, trainings, reports, published.STREAMS, {"paper-9x9": "4 streams"})


def views(trainings: Trainings) -> Table:
    """Table 2."""
    reports = {name: trainings.reports(name) for name in published.VIEWS}
    return _table("Table 2: views and augmentations", trainings, reports, published.VIEWS, {})


def _table(
    title: str,
    trainings: Trainings,
    reports: dict[str, list[Any]],
    paper: dict[str, dict[str, float]],
    labels: dict[str, str],
) -> Table:
    labels = LABELS | labels
    reference = "paper-7x7" if "paper-7x7" in reports else "paper-9x9"
    rows = [
        Row(
            labels[name],
            {key: [run["scores"][key] for run in runs] for key in (BAD, MSE)},
            paper[name],
            labels[reference] if name != reference else "",
        )
        for name, runs in reports.items()
    ]
    rows.append(Row(CONSTANT, trainings.constant(), {}))
    metrics = {BAD: "BadPix(.07)", MSE: "MSE x100"}
    runs = [run for runs in reports.values() for run in runs]
    return Table(title, _scale(trainings, runs), metrics, Spread.SEEDS, rows)


def _scale(trainings: Trainings, runs: list[Any]) -> str:
    """The scale of the runs, in sentences."""
    budget = trainings.budget
    recipe = recipe_for("paper-9x9", 1, budget)
    scenes = f"new rendered scenes ({VERSION}) all the time"
    if trainings.data:
        scenes = f"the scenes in {listed(list(map(str, trainings.data)))}"
    elif budget.scenes is not None:
        scenes = (
            f"{budget.scenes} rendered scenes ({VERSION}) of {budget.side_px}x{budget.side_px} px"
        )
    judged = f"{SCENES} rendered scenes of held-out kinds"
    if trainings.validation:
        judged = f"the scenes in {listed(list(map(str, trainings.validation)))}"
    width = recipe.as_dict()["width"]
    optimisation = "the paper's" if budget.base is None else f"that of {budget.base}"
    return (
        f"{budget.steps} steps of {recipe.batch} patches of {recipe.patch_px}x{recipe.patch_px} px "
        f"on {scenes}, {budget.seeds} seeds, {width} channels in each of four streams, "
        f""
        f"optimisation: {optimisation}; judged by {judged}; {machines(runs)}. "
        f"{budget.about} The paper trained for 5 to 6 days on a GPU and tested on the benchmark. "
        f"{sum(run['minutes'] for run in runs):.0f} minutes in all."
    )


def _draw_curves(path: Path, reports: dict[str, list[Any]]) -> None:
    """Figure 3: the test error during training, with the range over the seeds."""
    figure = Figure(figsize=(6, 4), layout="constrained", dpi=110)
    axes = figure.subplots()
    for name, runs in reports.items():
        steps = [entry["step"] for entry in runs[0]["history"]]
        errors = [[entry["scores"][BAD] for entry in run["history"]] for run in runs]
        low, high = ([bound(at) for at in zip(*errors, strict=True)] for bound in (min, max))
        label = "4 streams" if name == "paper-9x9" else LABELS[name]
        mean = [sum(at) / len(at) for at in zip(*errors, strict=True)]
        (line,) = axes.plot(steps, mean, marker=".", label=label)
        axes.fill_between(steps, low, high, color=line.get_color(), alpha=0.2)
    axes.set_xlabel("steps")
    axes.set_ylabel("BadPix(.07), %")
    axes.legend(title="mean and range of the seeds")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png")
