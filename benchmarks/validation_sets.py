"""Score the shipped weights on the two validation sets, part by part.

    epinet validation && make pathtraced
    python benchmarks/validation_sets.py -o benchmarks/results/validation_sets.json

Rendered scenes (`epinet validation`) count by part, path-traced ones (`make pathtraced`) singly;
a part's score is the mean over its scenes. Mirrors and panes, where the set marks them invalid, are
left out everywhere but in the part "reflective", where the truth is that of the surface.
"""

from __future__ import annotations

import argparse
import json
import platform
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from epinet import load_model, read_light_field
from epinet.metrics.disparity import score
from epinet.model.checkpoint import MODELS
from epinet.predict.estimator import Estimator
from epinet.synth.options import RANGES_PX
from epinet.synth.validation import validation_folder, validation_parts

WIDE_SCALE = {"epinet": 7, "sweepnet": 1}
"""Views are shrunk so much for the part "wide" of -25..5 px, since EPINET reaches +-4 px."""


def scores_of(model: Estimator, folder: Path, scale: int, mirrors: bool) -> dict[str, float]:
    """Scores of one scene."""
    lf = read_light_field(folder)
    assert lf.truth is not None
    truth = lf.truth.copy()
    if not mirrors and "invalid" in lf.masks:
        truth[lf.masks["invalid"]] = np.nan
    return score(model.predict(lf, scale=scale).disparity, truth)


def mean(each: list[dict[str, float]]) -> dict[str, float]:
    return {key: round(sum(s[key] for s in each) / len(each), 3) for key in each[0]}


def score_all(model: str, rendered: Path, traced: Path) -> dict[str, Any]:
    """Scores of a model's shipped weights, by set and part."""
    estimator = load_model(model=model)
    parts = defaultdict(list)
    for part, scenes in validation_parts().items():
        scale = WIDE_SCALE[model] if scenes[0].disparity_px == RANGES_PX["wide"] else 1
        for k in range(len(scenes)):
            folder = rendered / f"{part}_{k}"
            parts[part].append(scores_of(estimator, folder, scale, part == "reflective"))
    names = json.loads((traced / "dataset.json").read_text())["scenes"]
    return {
        "rendered": {part: mean(each) for part, each in parts.items()},
        "path-traced": {
            name: mean([scores_of(estimator, traced / name, 1, name == "mirrors")])
            for name in names
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--pathtraced", type=Path, help="default: where make pathtraced puts them")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    args = parser.parse_args()
    rendered = validation_folder()
    traced = args.pathtraced or rendered.parent / "pathtraced"
    models = {model: score_all(model, rendered, traced) for model in MODELS}
    report = {"machine": args.machine, "models": models}
    args.output.write_text(json.dumps(report, indent=1) + "\n")
    for model, sets in models.items():
        for label, scored in sets.items():
            for part, s in scored.items():
                print(
                    f"{model}, {label} {part}: BadPix(.07) {s['badpix_0.07']:.1f}, "
                    f"MSE x100 {s['mse_x100']:.2f}"
                )


if __name__ == "__main__":
    main()
