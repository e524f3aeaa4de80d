"""What the refinement of maps costs and brings.

    python -m benchmarks.refine [--size 512x512] [--threads 2]
    python -m benchmarks.refine ~/.cache/epinet/validation-rays-8/noisy_*

Without light fields: seconds, best of three, of a map and a picture of noise (what they show does
not change the work but for the share of holes, here 5 percent). With light fields that have truth:
their scores by SweepNet, before and after the weighted median and the filling of holes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import torch

import epinet
from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.metrics.disparity import score
from epinet.refine import refined, weighted_median
from epinet.refine.holes import HOLE_CONFIDENCE
from epinet.synth.dataset import parse_size

SHOWN = ("badpix_0.07", "badpix_0.03", "mse_x100")


def best_s(work: Callable[[], object]) -> float:
    """Seconds of the fastest of three runs."""
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return min(times)


def time_all(size: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(0)
    disparity, confidence = torch.rand(2, *size, generator=generator)
    guide = torch.rand(*size, 3, generator=generator)
    confidence = torch.where(confidence < 0.05, HOLE_CONFIDENCE / 2, 0.9)
    for window in (5, 9, 11, 15):
        seconds = best_s(partial(weighted_median, disparity, guide, window_px=window))
        print(f"weighted median, {window}x{window} px: {seconds:.2f} s")
    print(f"refinement: {best_s(partial(refined, disparity, guide, confidence)):.2f} s")


def score_all(paths: list[Path]) -> None:
    model = epinet.load_model()
    rows = []
    for path in paths:
        lf = epinet.read_light_field(path)
        assert lf.truth is not None, f"{path} has no truth"
        result = model.predict(lf, refine=False)
        images = (result.disparity, lf.unit(*lf.centre), result.confidence)
        after = refined(*(torch.from_numpy(np.ascontiguousarray(i)) for i in images)).numpy()
        scores = [score(map_, lf.truth) for map_ in (result.disparity, after)]
        rows.append([[s[name] for name in SHOWN] for s in scores])
        holes = 100 * (result.confidence < HOLE_CONFIDENCE).mean()
        print(f"{path.name}, {holes:.1f} % holes: {_text(rows[-1])}", flush=True)
    print(f"mean: {_text(np.mean(rows, 0).tolist())}")


def _text(scores: list[list[float]]) -> str:
    before, after = scores
    changes = zip(SHOWN, before, after, strict=True)
    return ", ".join(f"{name} {b:.2f} -> {a:.2f}" for name, b, a in changes)


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", type=Path, help="light fields with truth")
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
    torch.set_num_threads(args.threads)
    score_all(args.scenes) if args.scenes else time_all(parse_size(args.size))


if __name__ == "__main__":
    main()
