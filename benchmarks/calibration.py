"""How true SweepNet's expected error is: predicted against true error on scenes never trained on.

    epinet validation && python -m benchmarks.calibration -o benchmarks/results/calibration.json

Pixels of all scenes, inside the benchmark's border and where the truth is valid, are sorted by
their expected error into ten classes of equal size; of each class, the mean of the expected and of
the true error, and of the confidence and the share of good estimates. The area between the
sparsification curve (mean true error of what remains when the most doubtful pixels are taken away)
and the best possible one, relative to the mean error, says how well the order is told: 0 is
perfect, a random order gives the `random` figure.
"""

from __future__ import annotations

import json
import platform
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import epinet
from epinet.arguments import Parser
from epinet.metrics.disparity import BORDER_PX
from epinet.networks.weights import load_weights
from epinet.predict.batch import find_light_fields
from epinet.predict.confidence import WITHIN_PX
from epinet.synth.generator import VERSION
from epinet.synth.validation import validation_folder

CLASSES = 10


def pixels(folder: Path) -> tuple[NDArray[np.float64], ...]:
    """Confidence, expected and true error of all pixels of the scenes of a folder."""
    model = epinet.load_model(model="sweepnet")
    inner = (slice(BORDER_PX, -BORDER_PX),) * 2
    confidences, expected, errors = [], [], []
    for path in find_light_fields([folder]):
        lf = epinet.read_light_field(path)
        truth = lf.reliable_truth
        assert truth is not None
        result = model.predict(lf)
        chosen = np.isfinite(truth[inner])
        confidences.append(result.confidence[inner][chosen])
        assert result.expected_error is not None
        expected.append(result.expected_error[inner][chosen])
        errors.append(np.abs(result.disparity - truth)[inner][chosen])
        print(path.name, flush=True)
    return tuple(np.concatenate(each).astype(float) for each in (confidences, expected, errors))


def report(
    confidence: NDArray[np.float64], expected: NDArray[np.float64], error: NDArray[np.float64]
) -> dict[str, Any]:
    """The curve and its figures."""
    order = np.argsort(expected)
    classes = [
        {
            "expected_error_px": round(float(expected[part].mean()), 4),
            "true_error_px": round(float(error[part].mean()), 4),
            "confidence": round(float(confidence[part].mean()), 4),
            "percent_within_0.07": round(100 * float((error[part] <= WITHIN_PX).mean()), 2),
        }
        for part in np.array_split(order, CLASSES)
    ]

    def area(sorted_errors: NDArray[np.float64]) -> float:
        kept = np.cumsum(sorted_errors) / np.arange(1, len(sorted_errors) + 1)
        return float(kept.mean() / error.mean())

    best = area(np.sort(error))
    gaps = [abs(c["confidence"] - c["percent_within_0.07"] / 100) for c in classes]
    return {
        "pixels": len(error),
        "classes": classes,
        "expected_calibration_error": round(float(np.mean(gaps)), 4),
        "sparsification_gap": round(area(error[order]) - best, 4),
        "sparsification_gap_random": round(1 - best, 4),
    }


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", help="default: of epinet validation")
    parser.add_argument("-o", "--output", type=Path, help="JSON to write")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    args = parser.parse_args()
    made: dict[str, Any] = {
        "machine": args.machine,
        "generator": VERSION,
        "weights": {"sweepnet": load_weights("sweepnet").sha256},
    }
    made |= report(*pixels(args.folder or validation_folder()))
    if args.output:
        args.output.write_text(json.dumps(made, indent=1) + "\n")
    print(json.dumps(made, indent=1))


if __name__ == "__main__":
    main()
