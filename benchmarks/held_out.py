"""Score all shipped weights on the small rendered scenes that training runs are validated on.

    python -m benchmarks.held_out -o benchmarks/results/held_out.json

What weights say of themselves was scored by the generator of their time; here all see the same
scenes, with as many views as they take.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from epinet.arguments import Parser
from epinet.networks.weights import load_weights, shipped_weights
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX
from epinet.train.validation import Validation, mean_scores


def main() -> None:
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    args = parser.parse_args()
    report: dict[str, Any] = {"generator": VERSION, "weights": {}}
    for name in shipped_weights():
        weights = load_weights(name)
        views = weights.net.views[0]
        held_out = Validation.rendered(views, RANGES_PX["hci"])
        scores = mean_scores(held_out.predict(weights, torch.device("cpu"), bf16=False))
        report["weights"][name] = {"sha256": weights.sha256, "scores": scores}
        print(name, scores, flush=True)
    args.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
