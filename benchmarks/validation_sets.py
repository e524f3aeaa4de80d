"""Score the shipped weights on the two validation sets, part by part.

    epinet validation && make pathtraced
    python -m benchmarks.validation_sets -o benchmarks/results/validation_sets.json \\
        --picture docs/images/hard_parts.jpg

Rendered scenes (`epinet validation`) count by part, path-traced ones (`make pathtraced`) singly;
a part's score is the mean over its scenes. Mirrors and panes, where the set marks them invalid, are
left out everywhere but in the part "reflective", where the truth is that of the surface.
"""

from __future__ import annotations

import json
import platform
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.stated_ranges import KEPT, kept
from benchmarks.truth import judged_truth
from epinet import load_model, read_light_field
from epinet.arguments import Parser
from epinet.metrics.disparity import score
from epinet.networks.registry import OURS
from epinet.networks.weights import load_weights
from epinet.predict.estimator import Estimator
from epinet.predict.pictures import COLOUR_MAP, robust_range
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX
from epinet.synth.validation import validation_folder, validation_parts

WIDE_SCALE = {"epinet": 7, "sweepnet": 1}
"""Views are shrunk so much for the part "wide" of -25..5 px, since EPINET reaches +-4 px."""


PICTURED = ("textureless", "reflective")
"""Parts whose maps the picture shows: what EPINET's authors name as its limits."""

Maps = dict[str, NDArray[np.float32]]


def scores_of(
    model: Estimator, folder: Path, bounded: list[bool], scale: int = 1, maps: Maps | None = None
) -> dict[str, float]:
    """Scores of one scene; its map goes into `maps`, whether a range was used into `bounded`."""
    lf = read_light_field(folder)
    truth = judged_truth(folder, lf)
    assert truth is not None
    result = model.predict(lf, scale=scale)
    bounded.append(kept(result))
    if maps is not None:
        maps[folder.name] = result.disparity
    return score(result.disparity, truth)


def mean(each: list[dict[str, float]]) -> dict[str, float]:
    return {key: round(sum(s[key] for s in each) / len(each), 3) for key in each[0]}


def score_all(
    model: str, rendered: Path, traced: Path, maps: Maps, bounded: list[bool]
) -> dict[str, Any]:
    """Scores of a model's shipped weights, by set and part.

    `maps` gets those to be shown, `bounded` of each whether it was kept within a stated range.
    """
    estimator = load_model(model=model)
    parts = defaultdict(list)
    for part, scenes in validation_parts().items():
        scale = WIDE_SCALE[model] if scenes[0].disparity_px == RANGES_PX["wide"] else 1
        for k in range(len(scenes)):
            folder = rendered / f"{part}_{k}"
            shown = maps if part in PICTURED else None
            parts[part].append(scores_of(estimator, folder, bounded, scale, shown))
    names = json.loads((traced / "dataset.json").read_text())["scenes"]
    return {
        "rendered": {part: mean(each) for part, each in parts.items()},
        "path-traced": {
            name: mean([scores_of(estimator, traced / name, bounded)]) for name in names
        },
    }


def save_picture(path: Path, rendered: Path, maps: dict[str, Maps]) -> None:
    """Centre view, truth and each model's map of every scene in the parts shown."""
    names = list(next(iter(maps.values())))
    figure = Figure(figsize=(12, 3.1 * len(names)), layout="constrained", dpi=80)
    for row, name in zip(figure.subplots(len(names), 2 + len(maps)), names, strict=True):
        lf = read_light_field(rendered / name)
        assert lf.truth is not None
        low, high = robust_range(lf.truth)
        row[0].imshow(lf.rgb(*lf.centre))
        row[0].set_title(name)
        shown = {"truth": lf.truth, **{model: each[name] for model, each in maps.items()}}
        for axes, (title, map_) in zip(row[1:], shown.items(), strict=True):
            axes.imshow(map_, cmap=COLOUR_MAP, vmin=low, vmax=high)
            axes.set_title(title)
        for axes in row:
            axes.axis("off")
    figure.savefig(path)


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--picture", type=Path, help="maps of the hardest parts, to be written")
    parser.add_argument("--pathtraced", type=Path, help="default: where make pathtraced puts them")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    args = parser.parse_args()
    rendered = validation_folder()
    traced = args.pathtraced or rendered.parent / "pathtraced"
    maps: dict[str, Maps] = {model: {} for model in OURS}
    bounded: dict[str, list[bool]] = {model: [] for model in OURS}
    models = {
        model: score_all(model, rendered, traced, maps[model], bounded[model]) for model in OURS
    }
    if args.picture:
        save_picture(args.picture, rendered, maps)
    report = {
        "machine": args.machine,
        "generator": VERSION,
        "weights": {n: load_weights(n).sha256 for n in ("sweepnet", "epinet_9x9")},
        KEPT: bounded,
        "models": models,
    }
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
