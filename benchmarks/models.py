"""What the models cost: parameters, multiply-adds per pixel, and wall time side by side.

    python -m benchmarks.models -o benchmarks/results/models.json

A rendered light field of 512x512 px is predicted by each model in turn, again and again, in one
process and in float32; speeds are compared within a round, so that a noisy machine slows both.
"""

from __future__ import annotations

import json
import math
import platform
import statistics
import time
from pathlib import Path
from typing import Any

import torch
from torch.utils.flop_counter import FlopCounterMode

import epinet
from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.networks.registry import OURS
from epinet.predict.estimator import Estimator
from epinet.synth.generator import render_scene
from epinet.synth.options import RANGES_PX, Options

SIDE_PX = 128


def _products(into: list[int], a: list[int], b: list[int], **options: Any) -> int:
    """Operations of a batched product of matrices, by their shapes."""
    return 2 * math.prod(a) * b[-1]


IN_PLACE = {torch.ops.aten.baddbmm_: _products}
"""What torch's counter does not know."""


def cost(estimator: Estimator) -> dict[str, Any]:
    """Parameters, and multiply-adds per pixel of the map for disparities of -4..4 px."""
    net = estimator.weights[0].net
    stacks = torch.rand(1, 4, 9, SIDE_PX, SIDE_PX).to(estimator.device)
    with torch.no_grad(), FlopCounterMode(display=False, custom_mapping=IN_PLACE) as counter:
        net.estimate(stacks, RANGES_PX["hci"])
    return {
        "parameters": sum(p.numel() for p in net.parameters()),
        "multiply_adds_per_px": counter.get_total_flops() // 2 // SIDE_PX**2,
    }


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="JSON to write")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--device")
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
    lf = render_scene(Options(), 1, 0, star_only=True)
    models = {name: epinet.load_model(model=name, device=args.device) for name in OURS}
    seconds: dict[str, list[float]] = {name: [] for name in models}
    network: dict[str, list[float]] = {name: [] for name in models}
    for round_ in range(args.rounds + 1):
        for name, model in models.items():
            begun = time.perf_counter()
            result = model.predict(lf)
            if round_:  # the first warms up
                seconds[name].append(time.perf_counter() - begun)
                network[name].append(result.seconds["network"])
    report: dict[str, Any] = {
        "machine": args.machine,
        "device": str(next(iter(models.values())).device),
        "threads": torch.get_num_threads(),
        "models": {
            name: cost(model)
            | {
                "predict_s": round(statistics.median(seconds[name]), 2),
                "network_s": round(statistics.median(network[name]), 2),
            }
            for name, model in models.items()
        },
    }
    for key, times in (("predict", seconds), ("network", network)):
        ratios = [e / s for e, s in zip(times["epinet"], times["sweepnet"], strict=True)]
        report[f"{key}_epinet_over_sweepnet"] = [round(r, 2) for r in ratios]
    if args.output:
        args.output.write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
