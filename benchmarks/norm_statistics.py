"""Over how many batches the statistics of batch normalisation are taken, and whether it matters.

    OMP_NUM_THREADS=1 python -m benchmarks.norm_statistics --machine "2 vCPU Xeon" \\
        -o benchmarks/results/norm_statistics.json

Keras keeps an average that forgets a hundredth with each batch; weights of ours are saved with the
mean over some of the last batches (`epinet.train.run.STATISTICS_BATCHES`). A short run trains a
network whose norms are never fixed. Then the same weights are given statistics over fewer and over
more batches, and Keras' average over all of them, and their maps of held-out scenes are compared.
"""

from __future__ import annotations

import copy
import json
import platform
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from torch import Tensor

from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.io.atomic import atomic_path
from epinet.networks.epinet import Epinet
from epinet.networks.weights import Weights
from epinet.predict.result import Result
from epinet.synth.generator import VERSION
from epinet.train.norms import take_statistics
from epinet.train.recipe_files import load_recipe
from epinet.train.run import STATISTICS_BATCHES, Run
from epinet.train.validation import Validation, mean_scores

RECIPE = "narrow-9x9"
KERAS_MOMENTUM = 0.01
BATCHES = (STATISTICS_BATCHES // 4, STATISTICS_BATCHES, 4 * STATISTICS_BATCHES)
MOST = 10 * STATISTICS_BATCHES
KERAS = f"Keras' average, {MOST}"


def with_statistics(net: Epinet, stacks: Iterable[Tensor], momentum: float | None) -> Epinet:
    """The network with statistics of these batches: their plain mean, or a slow average."""
    net = copy.deepcopy(net)
    take_statistics(net, net, stacks, momentum)
    return net.folded().eval()


def mean_difference(results: dict[str, Result], others: dict[str, Result]) -> float:
    """Mean over the scenes of the mean absolute difference, in px."""
    pairs = [(results[name].disparity, others[name].disparity) for name in results]
    return float(np.mean([np.abs(a - b).mean() for a, b in pairs]))


def main() -> None:
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=500)
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--cache", type=Path, help="folder that keeps rendered scenes")
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
    changes = {"steps": args.steps, "fixed_norms_from": None, "bf16": False}
    recipe = load_recipe(RECIPE, changes | {"validate_every": args.steps})
    held_out = Validation.rendered(recipe.views, (-4.0, 4.0))
    with TemporaryDirectory() as folder:
        run = Run(recipe, Path(folder), validation=held_out, cache=args.cache)
        run.train()
        trained = run.averaged.module if run.averaged else run.net
        assert isinstance(trained, Epinet)
        # Batches of the run's last scenes, and as many new ones as it takes.
        stacks = [run.batches[0](args.steps + k).stacks for k in range(MOST)]
    kinds: dict[str, tuple[int, float | None]] = {str(n): (n, None) for n in (*BATCHES, MOST)}
    kinds[KERAS] = (MOST, KERAS_MOMENTUM)
    results = {}
    for name, (count, momentum) in kinds.items():
        net = with_statistics(trained, stacks[-count:], momentum)
        weights = Weights(net, run.metadata(), name)
        results[name] = held_out.predict(weights, torch.device("cpu"), bf16=False)
    report: dict[str, Any] = {
        "machine": args.machine,
        "generator": VERSION,
        "recipe": recipe.model_dump(mode="json", exclude_defaults=True),
        "saved": str(STATISTICS_BATCHES),
        "batches": {
            name: {"scores": mean_scores(r), "from_most_px": mean_difference(r, results[str(MOST)])}
            for name, r in results.items()
        },
    }
    with atomic_path(args.output) as temporary:
        temporary.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
