"""Tables from shipped weights: the ensemble, the wide-baseline set, 7x7 against 9x9 views."""

from __future__ import annotations

import hashlib
import math
import time
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

import epinet
from benchmarks.paper_tables import published
from benchmarks.paper_tables.published import BAD, MSE
from benchmarks.paper_tables.saved import machines, saved_run
from benchmarks.paper_tables.tables import Row, Spread, Table
from benchmarks.stated_ranges import KEPT, kept, note
from benchmarks.truth import judged_truth
from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.lightfield import LightField
from epinet.metrics.disparity import BORDER_PX, score
from epinet.predict.batch import find_light_fields
from epinet.predict.result import Result
from epinet.progress import progress
from epinet.synth.dataset import write_dataset
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX, Options

ENSEMBLE = ", ensemble"
WIDE_SCENES, WIDE_SEED = 50, 25
WIDE_SET = f"wide_{VERSION}_seed{WIDE_SEED}"
WIDE_SCALE = 7
"""EPINET's weights know -4..4 px, so they see the views at a seventh of their size."""


def ensemble(results: Path, paths: list[Path], machine: str) -> Table:
    """Epinet-fcn and Epinet-fcn-m: the mean over eight flips and rotations, off and on."""
    scenes = find_light_fields(paths)
    models = {"EPINET 7x7": "epinet_7x7", "SweepNet": "sweepnet"}
    rows: list[Row] = []
    reports: list[dict[str, Any]] = []
    bounded: dict[str, list[bool | None]] = {}
    for model, weights in models.items():
        for together in (False, True):
            runs = [
                _scored(results / "ensemble", scene, weights, machine, ensemble=together)
                for scene in scenes
            ]
            reports += runs
            name = model + ENSEMBLE * together
            bounded[name] = [r.get(KEPT) for r in runs]
            ours = {key: [r["scores"][key] for r in runs] for key in (BAD, MSE)}
            ours["cpu_s"] = [r["cpu_s"] for r in runs]
            paper = published.ENSEMBLE.get(name, {})
            rows.append(Row(name, ours, paper, against=model if together else ""))
    names = ", ".join(scene.name for scene in scenes)
    return Table(
        "The ensemble",
        f"Shipped weights, one training of each, on {len(scenes)} scenes with truth ({names}), "
        f"{machines(reports)}; mirrors and panes are left out but in `mirrors`. {note(bounded)} "
        "The paper's figures are means of the benchmark's twelve scenes.",
        {BAD: "BadPix(.07)", MSE: "MSE x100", "cpu_s": "CPU s"},
        Spread.SCENES,
        rows,
    )


def wide(results: Path, runs: Path, machine: str) -> Table:
    """Table 3 on scenes of our generator's wide preset, rendered where they are not there yet."""
    options = Options(disparity_px=RANGES_PX["wide"])
    with progress("rendering") as advance:
        scenes = write_dataset(
            runs / WIDE_SET,
            options,
            WIDE_SEED,
            WIDE_SCENES,
            star_only=True,
            existing="resume",
            advance=advance,
        )
    models = {"SweepNet": ("sweepnet", 1), "EPINET": ("epinet_9x9", WIDE_SCALE)}
    rows: list[Row] = []
    reports: list[dict[str, Any]] = []
    bounded: dict[str, list[bool | None]] = {}
    for name, (weights, scale) in models.items():
        made = [
            _scored(results / WIDE_SET, scene, weights, machine, scale=scale) for scene in scenes
        ]
        reports += made
        bounded[name] = [r.get(KEPT) for r in made]
        ours = {
            "rmse_px": [math.sqrt(r["scores"][MSE] / 100) for r in made],
            "mae_px": [r["scores"]["mae_px"] for r in made],
            "cpu_s": [r["cpu_s"] for r in made],
        }
        paper = published.WIDE.get(name, {})
        rows.append(Row(name, ours, paper, "EPINET" * (name != "EPINET")))
    rows += [Row(name, {}, paper) for name, paper in published.WIDE.items() if name not in models]
    height, width = options.size
    return Table(
        "Table 3: the wide-baseline set",
        f"{WIDE_SCENES} light fields of {width}x{height} px, -25..5 px, rendered by `epinet synth "
        f"OUT --scenes {WIDE_SCENES} --range wide --seed {WIDE_SEED} --star` ({VERSION}), since "
        "the original set is not to be had; shipped weights, one training of each, "
        f"{machines(reports)}. SweepNet measures the range "
        "and searches it on smaller pictures first; EPINET sees the views at "
        f"1/{WIDE_SCALE} of their size (`--scale {WIDE_SCALE}`). RMSE and MAE of a scene, without "
        f"its border of 15 px; mirrors and panes are left out. {note(bounded)} The paper trained "
        "on 250 and tested on 50 light fields of Heber's set, its rivals trained on 850.",
        {"rmse_px": "RMSE, px", "mae_px": "MAE, px", "cpu_s": "CPU s", "gpu_s": "s on a GPU"},
        Spread.SCENES,
        rows,
    )


def capture(results: Path, path: Path, machine: str) -> Table:
    """Figure 11: a real capture seen with 7x7 and with 9x9 views, judged by views not seen."""
    models = {
        "EPINET 7x7": ("epinet_7x7", 7),
        "EPINET 9x9": ("epinet_9x9", 9),
        "SweepNet 7x7": ("sweepnet", 7),
        "SweepNet 9x9": ("sweepnet", 9),
    }
    rows: list[Row] = []
    reports: list[dict[str, Any]] = []
    for name, (weights, views) in models.items():
        file = results / "capture" / f"{path.name}_{weights}_{views}x{views}.json"
        run = partial(_captured, path, weights, views, machine)
        settings = {"scene": _content(path), "weights": _digest(weights), "views": views}
        report = saved_run(file, settings, run)
        reports.append(report)
        against = name.replace("7x7", "9x9") if views == 7 else ""
        ours = {key: report[key] for key in ("unseen_inner", "unseen_outer")}
        rows.append(Row(name, ours | {"cpu_s": [report["cpu_s"]]}, {}, against))
    return Table(
        "Figure 11: 7x7 against 9x9 views of a real capture",
        f"{path.name}, shipped weights, {machines(reports)}, refined as captures are by "
        "default. Without truth, the views off the star, which no network sees, are moved onto "
        "the centre view by the map: mean difference in gray levels of 255, inner ones from the "
        "central 5x5, outer ones from around it. The paper shows pictures and no figures.",
        {
            "unseen_inner": "inner unseen views",
            "unseen_outer": "outer unseen views",
            "cpu_s": "CPU s",
        },
        Spread.SCENES,
        rows,
    )


def _scored(
    results: Path,
    scene: Path,
    weights: str,
    machine: str,
    *,
    ensemble: bool = False,
    scale: int = 1,
) -> Any:
    """Scores and time of shipped weights on a scene with truth."""

    def run() -> dict[str, Any]:
        lf = read_light_field(scene)
        truth = judged_truth(scene, lf)
        if truth is None:
            raise InputError(f"{scene}: no truth to score with")
        result, cost = _predicted(lf, weights, machine, ensemble=ensemble, scale=scale)
        return {"scores": score(result.disparity, truth)} | cost

    options = {"ensemble": ensemble, "scale": scale}
    settings = {"scene": _content(scene), "weights": _digest(weights)} | options
    suffix = ENSEMBLE.replace(", ", "_") * ensemble
    return saved_run(results / f"{scene.name}_{weights}{suffix}.json", settings, run)


def _captured(path: Path, weights: str, views: int, machine: str) -> dict[str, Any]:
    lf = read_light_field(path).central(9)
    result, cost = _predicted(lf.central(views), weights, machine)
    return unseen_errors(lf, result.disparity) | cost


def unseen_errors(lf: LightField, disparity: NDArray[np.float32]) -> dict[str, list[float]]:
    """For each view off the star, its mean difference from the centre view, in gray levels of 255.

    The view (row, col) is read at (x - d * (col - c), y - d * (row - c)); the border of 15 px and
    what lies outside of the view are left out.
    """
    y, x = np.mgrid[: lf.size[0], : lf.size[1]].astype(np.float32)
    centre_row, centre_col = lf.centre
    centre = lf.gray(centre_row, centre_col)
    inner = (slice(BORDER_PX, -BORDER_PX),) * 2
    errors: dict[str, list[float]] = {"unseen_inner": [], "unseen_outer": []}
    for row, col in sorted(set(np.ndindex(*lf.grid)) - set(star_positions(lf.grid[0]))):
        rows, cols = row - centre_row, col - centre_col
        moved = cv2.remap(
            lf.gray(row, col),
            x - disparity * np.float32(cols),
            y - disparity * np.float32(rows),
            cv2.INTER_LANCZOS4,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=float("nan"),
        )
        ring = "unseen_inner" if max(abs(rows), abs(cols)) <= 2 else "unseen_outer"
        errors[ring].append(255 * float(np.nanmean(np.abs(moved - centre)[inner])))
    return errors


def _predicted(
    lf: LightField, weights: str, machine: str, **options: Any
) -> tuple[Result, dict[str, Any]]:
    """A prediction and its cost; CPU time, since other work on the machine hardly changes it."""
    model = epinet.load_model(weights, device="cpu")
    begun = time.process_time()
    result = model.predict(lf, **options)
    cpu_s = round(time.process_time() - begun, 2)
    cost = {"cpu_s": cpu_s, "machine": machine, "threads": torch.get_num_threads()}
    return result, cost | {KEPT: kept(result)}


@lru_cache
def _content(scene: Path) -> str:
    """Name and hash of what the files of a scene hold: other data are another run."""
    digest = hashlib.sha256()
    for file in sorted(path for path in scene.rglob("*") if path.is_file()):
        digest.update(file.relative_to(scene).as_posix().encode() + file.read_bytes())
    return f"{scene.name} {digest.hexdigest()[:12]}"


@lru_cache
def _digest(weights: str) -> str:
    """Name and hash of shipped weights: other weights are another run."""
    return f"{weights} {epinet.load_model(weights, device='cpu').sha256[:12]}"
