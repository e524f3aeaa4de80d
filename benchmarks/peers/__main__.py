"""Peers and our models on the same light fields: accuracy, time and memory side by side.

    python -m benchmarks.peers ~/.cache/epinet/pathtraced lightfields/antinous \\
        -o benchmarks/results/peers.json --picture docs/images/peers.png --show toys \\
        --machine "2 vCPU AMD EPYC (AVX-512 bf16)"

Each argument is a scene or a folder of scenes, and becomes a set of the table. Every method runs on
every scene in a process of its own, with the same number of threads; scene after scene, so that
other work on the machine slows all of them. TensorFlow installs itself into --environment at the
first use. Ends with an error where Keras and our network, with the same weights, differ.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import keras_epinet
from benchmarks.peers.methods import KERAS, METHODS, OURS, disparity_range
from benchmarks.peers.picture import save_picture
from benchmarks.peers.tables import markdown
from benchmarks.stated_ranges import KEPT
from benchmarks.truth import judged_truth
from epinet.arguments import Parser
from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.lightfield import LightField
from epinet.metrics.disparity import score
from epinet.networks.weights import Weights, load_weights
from epinet.predict.batch import find_light_fields

TOLERANCE_PX = 1e-4
"""Keras and ours may differ by so much."""


class Runner:
    """Runs methods in processes of their own; maps and what Keras needs go to `folder`."""

    def __init__(self, folder: Path, keras_python: Path, threads: int, repeats: int) -> None:
        self.folder, self.keras_python = folder, keras_python
        self.last = [str(threads), str(repeats)]
        self.environment = os.environ | {
            "OMP_NUM_THREADS": str(threads),
            "CUDA_VISIBLE_DEVICES": "",
        }

    def measure(self, method: str, scene: Path, lf: LightField, map_file: Path) -> dict[str, Any]:
        """Times, memory and scores of a method on a scene."""
        if method == KERAS:
            printed = self.keras(keras_epinet.shipped(), lf, map_file)
        else:
            module = [sys.executable, "-m", "benchmarks.peers.measure", method, str(scene)]
            printed = self._run([*module, str(map_file), *self.last])
        report: dict[str, Any] = {
            key: round(statistics.median(printed[key]), 3) for key in ("seconds", "cpu_s")
        }
        report["peak_memory_mb"] = round(printed["peak_memory_mb"])
        if method in OURS:
            report[KEPT] = printed[KEPT]
        truth = judged_truth(scene, lf)
        if truth is not None:
            report["scores"] = {k: round(v, 4) for k, v in score(np.load(map_file), truth).items()}
        return report

    def keras(self, weights: Weights, lf: LightField, map_file: Path) -> Any:
        """What the worker prints."""
        inputs = keras_epinet.prepare(weights, lf, self.folder)
        python, worker = str(self.keras_python), str(keras_epinet.WORKER)
        return self._run([python, worker, *inputs, str(map_file), *self.last])

    def _run(self, command: list[str]) -> Any:
        """The JSON that a process prints."""
        done = subprocess.run(command, capture_output=True, text=True, env=self.environment)
        if done.returncode:
            raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr}")
        return json.loads(done.stdout)


def equality(runner: Runner, lf: LightField) -> dict[str, Any]:
    """Largest difference between Keras' map and ours, with shipped and with random weights."""
    report: dict[str, Any] = {}
    for weights in (keras_epinet.shipped(), keras_epinet.random()):
        map_file = runner.folder / "equality.npy"
        printed = runner.keras(weights, lf, map_file)
        mine = keras_epinet.ours(weights, lf)
        report["versions"] = printed["versions"]
        report[Path(weights.source).stem] = {
            "largest_difference_px": float(np.abs(np.load(map_file) - mine).max()),
            "deviation_of_map_px": round(float(mine.std()), 3),
        }
    return report


def arguments() -> argparse.Namespace:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("light_fields", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, help="JSON to write")
    parser.add_argument("--picture", type=Path, help="figure to write")
    parser.add_argument("--show", help="scene whose maps the figure shows; default: the first")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3, help="the median counts")
    parser.add_argument("--maps", type=Path, default=Path("out/peers"), help="folder for the maps")
    parser.add_argument("--environment", type=Path, default=Path("out/peers-keras-venv"))
    return parser.parse_args()


def compare(args: argparse.Namespace) -> None:
    """Everything that the command line asks for."""
    args.maps.mkdir(parents=True, exist_ok=True)
    keras_python = keras_epinet.ensure_environment(args.environment)
    runner = Runner(args.maps, keras_python, args.threads, args.repeats)
    sets: dict[str, Any] = {}
    shown = None
    for argument in args.light_fields:
        scenes = sets[argument.name] = {}
        for path in find_light_fields([argument]):
            lf = read_light_field(path)
            methods = {}
            for method in METHODS:
                map_file = args.maps / f"{path.name}, {method}.npy"
                methods[method] = runner.measure(method, path, lf, map_file)
                print(path.name, method, json.dumps(methods[method]), file=sys.stderr)
            low, high = disparity_range(lf)
            scenes[path.name] = {"size": lf.size, "range_px": [low, high], "methods": methods}
            if shown is None or path.name == args.show:
                shown = path
    assert shown is not None
    report = {
        "machine": args.machine,
        "threads": args.threads,
        "repeats": args.repeats,
        "weights": {n: load_weights(n).sha256 for n in ("sweepnet", "epinet_9x9")},
        "keras_equals_ours": equality(runner, read_light_field(shown)),
        "sets": sets,
    }
    if args.output:
        args.output.write_text(json.dumps(report, indent=1) + "\n")
    if args.picture:
        maps = {m: np.load(args.maps / f"{shown.name}, {m}.npy") for m in METHODS}
        save_picture(args.picture, report, read_light_field(shown), maps)
    print(markdown(report))
    for name in ("epinet_9x9", "random"):
        difference = report["keras_equals_ours"][name]["largest_difference_px"]
        if not difference <= TOLERANCE_PX:
            raise SystemExit(f"Keras and our network differ by {difference} px with {name} weights")


def main() -> None:
    args = arguments()
    try:
        compare(args)
    except InputError as error:
        raise SystemExit(str(error)) from error


if __name__ == "__main__":
    main()
