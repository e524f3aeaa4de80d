"""Write docs/results.md from the shipped weights and the runs saved in benchmarks/results.

    python -m benchmarks.write_results

Nothing is measured here: every figure stands in a JSON file that another script of this folder
wrote, or in the metadata of the weights.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.stated_ranges import KEPT, note
from epinet.networks.weights import load_weights, shipped_weights
from epinet.synth.generator import VERSION

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "results.md"
HEAD = """# Results

Written by `python -m benchmarks.write_results` from the runs saved in
[benchmarks/results](../benchmarks/results) and from what the weights say of themselves. Scores are
those of the 4D Light Field Benchmark: BadPix in percent of the pixels, MSE x100 in px^2, a border
of 15 px left out."""


def read(name: str) -> Any:
    return json.loads((RESULTS / f"{name}.json").read_text())


def runs_of(weights: str) -> list[Any]:
    """The runs that weights come from, the last one last."""
    report = read(f"{weights}_training")
    return list(report.get("runs", [report]))


def older_than_now(report: Any) -> Iterator[str]:
    """What to say of runs on scenes of another generator."""
    if report.get("generator") != VERSION:
        yield (
            f"These runs are older than {VERSION}, the generator's scenes of today: to be measured "
            "anew."
        )


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def scored(s: dict[str, float]) -> list[str]:
    return [f"{s[key]:.2f}" for key in ("badpix_0.07", "badpix_0.03", "badpix_0.01", "mse_x100")]


SETS = ("held-out", "path-traced")
"""That the variants of the ablation are scored on."""
SCORES = ["BadPix(.07)", "(.03)", "(.01)", "MSE x100"]


def weights() -> Iterator[str]:
    yield "## Shipped weights"
    report = read("held_out")
    yield (
        "Trained on rendered scenes alone. Steps, minutes and machine are those of the last run, "
        "after the weights that it starts from. Scores: `python -m benchmarks.held_out -o FILE`, "
        f"16 small rendered scenes ({report['generator']}) of held-out textures and shapes, "
        "mirrors left out."
    )
    rows = []
    for name in shipped_weights():
        about = load_weights(name).metadata
        begun = about.get("started_from") or {}
        recipe, data = about["recipe"], about["data"]
        start = begun.get("recipe", {}).get("name", "scratch")
        cells = [name, recipe["name"], data["generator"], start]
        scores = report["weights"][name]["scores"]
        cells += [str(about["steps"]), f"{about['minutes']:.0f}", runs_of(name)[-1]["machine"]]
        rows.append([*cells, *scored(scores)])
    head = ["weights", "recipe", "scenes", "from", "steps", "minutes", "machine", *SCORES]
    yield table(head, rows)
    yield (
        "How the 9x9 weights came about, run after run; where a line begins anew, the network had "
        "changed or learned with a high rate again. Each run was validated on the scenes of its "
        "time, so that lines do not compare with each other, nor with the table: SweepNet's first "
        "nine runs counted the mirrors that one of the 16 scenes consists of; EPINET's first run "
        "saw slanted layers. The scores in the metadata of SweepNet's weights are those of the "
        "table."
    )
    yield "![held-out scores against minutes](../benchmarks/results/shipped_weights.png)"


def draw_progress(path: Path) -> None:
    """Held-out scores of the shipped 9x9 weights' runs against the minutes of all of them."""
    runs = {"SweepNet": runs_of("sweepnet"), "EPINET": runs_of("epinet_9x9")}
    figure = Figure(figsize=(9, 3.5), layout="constrained", dpi=110)
    for panel, (model, of_model) in zip(figure.subplots(1, 2), runs.items(), strict=True):
        before = 0.0
        for run in of_model:
            points = [(before + h["minutes"], h["scores"]["badpix_0.07"]) for h in run["history"]]
            panel.plot(*zip(*points, strict=True), marker=".")
            before += run["minutes"]
        panel.set_title(model)
        panel.set_xlabel("minutes of training")
        panel.set_ylabel("held-out BadPix(.07), %")
    figure.savefig(path)


def real() -> Iterator[str]:
    report = read("real_light_fields")
    bounded = {m: [r.get(KEPT) for r in of.values()] for m, of in report["models"].items()}
    yield "## Real light fields"
    yield (
        f"`python -m benchmarks.real_light_fields FOLDER` on {report['machine']}. Nothing is "
        "trained on them. The references are the maps of the reference implementation; mirrors are "
        "left out on `kitchen`. Time and memory are those of the whole command. "
        f"{note(bounded)} Of these, `kitchen` alone states one."
    )
    rows = []
    for model, reports in report["models"].items():
        for name, r in reports.items():
            ref = r.get("reference")
            distance, close = ("-", "-")
            if ref:
                distance = f"{ref['mean_absolute_difference_px']:.3f} px"
                close = f"{ref['percent_within_0.07']:.1f} %"
            own = scored(r["scores"]) if "scores" in r else ["-"] * 4
            cost = [f"{r['wall_s']:.1f}", str(r["peak_memory_mb"])]
            rows.append([model, name, *cost, *own, distance, close])
    yield table(["model", "scene", "s", "MB", *SCORES, "from reference", "within .07"], rows)


def validation() -> Iterator[str]:
    report = read("validation_sets")
    yield "## Validation sets"
    yield (
        f"`python -m benchmarks.validation_sets -o FILE` on {report['machine']}; what the parts "
        "are: [scenes](scenes.md). "
        "Mirrors and panes are left out everywhere but in "
        "`reflective` and `mirrors`. EPINET sees the part `wide` at a seventh of its size. "
        f"{note(report.get(KEPT, {}))} Stated is exactly the range of the truth here, to a "
        "tenth of a pixel in the benchmark's scenes."
    )
    models = report["models"]
    first, second = models
    rows = [
        [label, part, *scored(s), *scored(models[second][label][part])]
        for label, parts in models[first].items()
        for part, s in parts.items()
    ]
    head = [f"{name} {score}" for name in models for score in SCORES]
    yield table(["set", "part", *head], rows)
    yield "The parts without texture and with mirrors, by the same command with `--picture`:"
    yield "![hard parts](images/hard_parts.jpg)"


def ablation() -> Iterator[str]:
    report = read("sweepnet_ablation")
    yield "## What each part of SweepNet is worth"
    yield (
        f"`python -m benchmarks.sweepnet_ablation -o FILE` on {report['machine']}, one "
        "thread each: a part is taken out of the shipped weights, which learn for "
        f"{report['steps']} steps of their recipe in small patches to do without it, on the same "
        "scenes in the same order; as long where nothing is taken out. Ranges that scenes state "
        "are kept back, so maps are not bounded by them as above. Longer training would win "
        "back more of what is lost, and what training itself does differently shows but faintly "
        "in so few steps. What differs from nothing by no more than its two seeds is undecided."
    )
    yield from older_than_now(report)
    if report["weights"] != load_weights("sweepnet").sha256:
        yield "The weights were those that the shipped ones have learned on from since."
    scores = {"badpix_0.07": "BadPix(.07)", "badpix_0.03": "(.03)", "mse_x100": "MSE x100"}
    rows = [
        [
            variant["says"],
            *(
                f"{variant[s][k]:.2f}"
                for s in SETS
                for k in ("badpix_0.07", "badpix_0.03", "mse_x100")
            ),
        ]
        for variant in report["variants"].values()
    ]
    head = ["taken out", *(f"{s} {label}" for s in SETS for label in scores.values())]
    yield table(head, rows)


def cost() -> Iterator[str]:
    report = read("models")
    yield "## Cost"
    yield (
        f"`python -m benchmarks.models` on {report['machine']}, {report['threads']} threads, "
        "float32: a rendered light field of 9x9 views of 512x512 px (multiply-adds: for -4..4 px); "
        "medians of several rounds, with and without reading the range off the views and making "
        "the confidence map."
    )
    rows = [
        [
            name,
            f"{m['parameters']:,}",
            f"{m['multiply_adds_per_px']:,}",
            f"{m['predict_s']:.2f}",
            f"{m['network_s']:.2f}",
        ]
        for name, m in report["models"].items()
    ]
    yield table(["model", "parameters", "multiply-adds per px", "predict, s", "network, s"], rows)
    ratios = {k: report[f"{k}_epinet_over_sweepnet"] for k in ("predict", "network")}
    text = ", ".join(f"{k} {min(r):.1f} to {max(r):.1f}" for k, r in ratios.items())
    yield f"EPINET's time over SweepNet's, round by round: {text}."


def calibration() -> Iterator[str]:
    report = read("calibration")
    yield "## SweepNet's expected error"
    yield (
        f"`python -m benchmarks.calibration -o FILE` on {report['machine']}, the "
        f"{report['pixels']:,} valid pixels of the rendered validation set in ten classes by "
        "expected error."
    )
    rows = [
        [
            f"{c['expected_error_px']:.4f}",
            f"{c['true_error_px']:.4f}",
            f"{100 * c['confidence']:.1f} %",
            f"{c['percent_within_0.07']:.1f} %",
        ]
        for c in report["classes"]
    ]
    yield table(["expected error, px", "true error, px", "confidence", "within .07"], rows)
    yield (
        "Mean difference between confidence and share within .07: "
        f"{100 * report['expected_calibration_error']:.1f} percentage points. Sparsification gap: "
        f"{report['sparsification_gap']:.3f}, where a random order has "
        f"{report['sparsification_gap_random']:.3f} and a perfect one 0."
    )


def curves() -> Iterator[str]:
    report = read("training_curves")
    constant = report["constant_map"]
    yield "## The paper's recipe and ours"
    yield (
        f"`python -m benchmarks.training_curves --minutes {report['minutes']:g} -o FILE`: the same "
        f"{report['scenes']} rendered scenes, the same CPU time, {report['machine']}, float32; "
        "validated on small rendered scenes of held-out kinds, mirrors left out."
    )
    yield from older_than_now(report)
    rows = [["best constant map", "-", "-", *scored(constant)]]
    for name, run in report["runs"].items():
        last = run["history"][-1]
        rows.append([name, str(last["step"]), f"{last['minutes']:.1f}", *scored(last["scores"])])
    yield table(["recipe", "steps", "CPU minutes", *SCORES], rows)
    above = [
        f"{name} is at {run['history'][-1]['scores']['mse_x100'] / constant['mse_x100']:.1f} times"
        for name, run in report["runs"].items()
    ]
    yield f"In this time {', '.join(above)} the MSE of each scene's best constant map."
    yield "![curves](../benchmarks/results/training_curves.png)"


def levers() -> Iterator[str]:
    runs = read("training_levers")["runs"]
    yield "## What changes of EPINET's recipe are worth"
    machines = " and ".join(sorted({run["machine"] for run in runs}))
    yield (
        "`python -m benchmarks.training_levers`: runs of `narrow-9x9` from scratch, each with one "
        "change and through its whole schedule in the CPU minutes given, scenes rendered before; "
        f"{machines}, one thread, float32; a pool of scenes serves "
        f"{' or '.join(sorted({str(run['steps_per_pool']) for run in runs}))} steps; judged by "
        "small rendered scenes of held-out kinds. Two lengths "
        "show slopes: what starts faster need not end lower. One seed, so that a few points of "
        "BadPix say nothing."
    )
    lengths = sorted({run["minutes"] for run in runs})
    cells = {}
    for run in runs:
        last = run["history"][-1]
        scores = last["scores"]
        cells[run["lever"], run["minutes"]] = [
            str(last["step"]),
            f"{scores['badpix_0.07']:.1f}",
            f"{scores['mse_x100']:.1f}",
        ]
    head = [f"{what}, {m:g} min" for m in lengths for what in ("steps", "BadPix(.07)", "MSE x100")]
    rows = [
        [name, *(c for m in lengths for c in cells.get((name, m), ["-"] * 3))]
        for name in dict.fromkeys(run["lever"] for run in runs)
    ]
    yield table(["change", *head], rows)


def norms() -> Iterator[str]:
    report = read("norm_statistics")
    kinds = report["batches"]
    yield "## Statistics of batch normalisation"
    yield (
        f"`python -m benchmarks.norm_statistics -o FILE`: {report['recipe']['steps']} steps of "
        f"`{report['recipe']['name']}` with norms that are never fixed, {report['machine']}; the "
        "same weights with statistics of other numbers of batches. Weights of such runs are saved "
        f"with the mean over the last {report['saved']}; Keras keeps an average that forgets a "
        "hundredth with each. Maps of the small held-out scenes, and their mean difference to "
        "those of the most batches."
    )
    rows = [
        [name, *scored(kind["scores"]), f"{kind['from_most_px']:.4f}"]
        for name, kind in kinds.items()
    ]
    yield table(["batches", *SCORES, "difference, px"], rows)


def page() -> str:
    sections = {
        "real_light_fields": real,
        "validation_sets": validation,
        "models": cost,
        "sweepnet_ablation": ablation,
        "calibration": calibration,
        "training_curves": curves,
        "training_levers": levers,
        "norm_statistics": norms,
    }
    parts = [HEAD, *weights()]
    for name, section in sections.items():
        if (RESULTS / f"{name}.json").exists():
            parts += section()
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    draw_progress(RESULTS / "shipped_weights.png")
    PAGE.write_text(page())
