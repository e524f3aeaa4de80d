"""Predict the real light fields at hand with each model, as a user would, and compare.

    python -m benchmarks.real_light_fields FOLDER -o benchmarks/results/real_light_fields.json

FOLDER holds antinous (with truth), dino, kitchen, lytro_2067 and reference/<name>_epinet9x9.pfm,
the reference implementation's maps. Each light field is predicted by the command line in a process
of its own, whose time and peak memory are measured. Nothing here is used for training or tuning.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.stated_ranges import KEPT
from epinet.arguments import Parser
from epinet.io import read_light_field, read_pfm
from epinet.metrics.disparity import BORDER_PX, score
from epinet.networks.registry import OURS
from epinet.networks.weights import load_weights

NAMES = ("antinous", "dino", "kitchen", "lytro_2067")
REFERENCE_BORDER_PX = 11
"""The reference's maps lack so much at each side."""
CLOSE_PX = 0.07


def predict(path: Path, out: Path, options: list[str]) -> dict[str, float]:
    """Wall time in s and peak memory in MB of `epinet predict`."""
    command = [sys.executable, "-m", "epinet", "predict", str(path), "-o", str(out), "--force"]
    start = time.perf_counter()
    process = subprocess.Popen([*command, *options], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{path}: epinet predict failed")
    peak_mb = usage.ru_maxrss / 1024
    return {"wall_s": round(time.perf_counter() - start, 1), "peak_memory_mb": round(peak_mb)}


def agreement(
    ours: NDArray[np.float32], reference: NDArray[np.float32], left_out: NDArray[np.bool_] | None
) -> dict[str, float]:
    """Mean absolute difference and share within .07 px, inside the reference's border."""
    b = REFERENCE_BORDER_PX
    difference = np.abs(ours[b:-b, b:-b] - reference)
    if left_out is not None:
        difference = difference[~left_out[b:-b, b:-b]]
    return {
        "mean_absolute_difference_px": round(float(difference.mean()), 4),
        "median_absolute_difference_px": round(float(np.median(difference)), 4),
        "percent_within_0.07": round(100 * float((difference <= CLOSE_PX).mean()), 2),
    }


def constant_map(truth: NDArray[np.float32]) -> dict[str, float]:
    """Scores of the best constant map, by its MSE: what knowing nothing gives."""
    inner = truth[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
    return score(np.full_like(truth, np.nanmean(inner)), truth)


def examine(name: str, folder: Path, out: Path, options: list[str]) -> dict[str, Any]:
    """All figures of one light field."""
    report: dict[str, Any] = predict(folder / name, out, options)
    ours = read_pfm(out / name / "disparity.pfm")
    run = json.loads((out / name / "run.json").read_text())
    report |= {"seconds": run["seconds"], "disparity_px": run["disparity_px"]}
    report[KEPT] = run["settings"]["stated_px"] is not None
    report["median_confidence"] = round(run["median_confidence"], 3)
    lf = read_light_field(folder / name)
    if lf.truth is not None:
        report |= {"scores": run["scores"], "constant_map": constant_map(lf.truth)}
    reference = folder / "reference" / f"{name}_epinet9x9.pfm"
    if reference.exists():
        report["reference"] = agreement(ours, read_pfm(reference), lf.masks.get("invalid"))
    return report


def table(model: str, reports: dict[str, Any]) -> str:
    """Markdown for people."""
    lines = [
        f"| {model} | s | MB | BadPix(.07) / MSE x100 | difference to reference | within .07 |",
        "|---|---|---|---|---|---|",
    ]
    for name, r in reports.items():
        scores = r.get("scores")
        text = f"{scores['badpix_0.07']:.2f} / {scores['mse_x100']:.2f}" if scores else "-"
        ref = r.get("reference")
        near = f"{ref['mean_absolute_difference_px']:.3f} px" if ref else "-"
        share = f"{ref['percent_within_0.07']:.1f} %" if ref else "-"
        lines.append(
            f"| {name} | {r['wall_s']} | {r['peak_memory_mb']} | {text} | {near} | {share} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="JSON to write")
    parser.add_argument("--maps", type=Path, default=Path("out/real"), help="result folders")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("options", nargs="*", help="more options of epinet predict, after --")
    args = parser.parse_args()
    models: dict[str, Any] = {}
    for model in OURS:
        options = ["--model", model, *args.options]
        models[model] = {n: examine(n, args.folder, args.maps / model, options) for n in NAMES}
    if args.output:
        report = {
            "machine": args.machine,
            "weights": {n: load_weights(n).sha256 for n in ("sweepnet", "epinet_9x9")},
            "options": args.options,
            "models": models,
        }
        args.output.parent.mkdir(parents=True, exist_ok=True)
        args.output.write_text(json.dumps(report, indent=1) + "\n")
    for model, reports in models.items():
        print(table(model, reports))


if __name__ == "__main__":
    main()
