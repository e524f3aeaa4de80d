"""Write docs/results.md from the shipped weights and the runs saved in benchmarks/results.

    python benchmarks/write_results.py

Nothing is measured here: every figure stands in a JSON file that another script of this folder
wrote, or in the metadata of the weights.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from epinet.model.checkpoint import load_weights, shipped_weights

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "results.md"
HEAD = """# Results

Written by `python benchmarks/write_results.py` from the runs saved in
[benchmarks/results](../benchmarks/results) and from what the weights say of themselves. Scores are
those of the 4D Light Field Benchmark: BadPix in percent of the pixels, MSE x100 in px^2, a border
of 15 px left out."""


def read(name: str) -> Any:
    return json.loads((RESULTS / f"{name}.json").read_text())


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def scored(s: dict[str, float]) -> list[str]:
    return [f"{s[key]:.2f}" for key in ("badpix_0.07", "badpix_0.03", "badpix_0.01", "mse_x100")]


SCORES = ["BadPix(.07)", "(.03)", "(.01)", "MSE x100"]


def weights() -> Iterator[str]:
    yield "## Shipped weights"
    yield (
        "Trained on rendered scenes alone, on one core of an AMD EPYC. Scores: small rendered "
        "scenes of held-out textures and shapes, by the generator named: scores of different "
        "generators do not compare."
    )
    rows = []
    for name in shipped_weights():
        about = load_weights(name).metadata
        begun = about.get("started_from") or {}
        recipe, data = about["recipe"], about["data"]
        start = begun.get("recipe", {}).get("name", "scratch")
        cells = [name, recipe["name"], data["generator"], start]
        rows.append(
            [*cells, str(about["steps"]), f"{about['minutes']:.0f}", *scored(about["scores"])]
        )
    yield table(["weights", "recipe", "scenes", "from", "steps", "minutes", *SCORES], rows)


def real() -> Iterator[str]:
    report = read("real_light_fields")
    yield "## Real light fields"
    yield (
        f"`python benchmarks/real_light_fields.py FOLDER` on {report['machine']}. Nothing is "
        "trained on them. The references are the maps of the reference implementation; mirrors are "
        "left out on `kitchen`. Time and memory are those of the whole command."
    )
    rows = []
    for name, r in report["light_fields"].items():
        ref = r.get("reference")
        distance, close = ("-", "-")
        if ref:
            distance = f"{ref['mean_absolute_difference_px']:.3f} px"
            close = f"{ref['percent_within_0.07']:.1f} %"
        own = scored(r["scores"]) if "scores" in r else ["-"] * 4
        rows.append([name, f"{r['wall_s']:.1f}", str(r["peak_memory_mb"]), *own, distance, close])
    yield table(["scene", "s", "MB", *SCORES, "from reference", "within .07"], rows)


def validation() -> Iterator[str]:
    report = read("validation_sets")
    yield "## Validation sets"
    yield (
        "`python benchmarks/validation_sets.py`; what the parts are: [scenes](scenes.md). "
        "The part `wide` is seen at a seventh of its size."
    )
    rows = [
        [label, part, *scored(s)]
        for label, parts in report["sets"].items()
        for part, s in parts.items()
    ]
    yield table(["set", "part", *SCORES], rows)


def curves() -> Iterator[str]:
    report = read("training_curves")
    constant = report["constant_map"]
    yield "## The paper's recipe and ours"
    yield (
        f"`python benchmarks/training_curves.py`: the same {report['scenes']} rendered scenes, the "
        f"same time, {report['machine']}, {report['threads']} thread(s), float32 for the paper's, "
        "bf16 for ours; validated on small rendered scenes of held-out kinds."
    )
    rows = [["best constant map", "-", "-", *scored(constant)]]
    for name, run in report["runs"].items():
        last = run["history"][-1]
        rows.append([name, str(last["step"]), f"{last['minutes']:.1f}", *scored(last["scores"])])
    yield table(["recipe", "steps", "minutes", *SCORES], rows)
    paper = report["runs"]["paper-9x9"]["history"][-1]["scores"]["mse_x100"]
    reached = "has halved" if paper <= constant["mse_x100"] / 2 else "has not halved"
    yield f"In this time the paper's recipe {reached} the MSE of a constant map."
    yield "![curves](../benchmarks/results/training_curves.png)"


def page() -> str:
    sections = {
        "real_light_fields": real,
        "validation_sets": validation,
        "training_curves": curves,
    }
    parts = [HEAD, *weights()]
    for name, section in sections.items():
        if (RESULTS / f"{name}.json").exists():
            parts += section()
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
