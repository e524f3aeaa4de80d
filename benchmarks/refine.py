"""How long the refinement of a map takes.

    python benchmarks/refine.py [--size 512x512] [--threads 2]

Best of three, of a map and a picture of noise: what they show does not change the work, but for
the share of holes, here 5 percent.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import torch

from epinet.allocator import keep_freed_memory
from epinet.refine import refined, weighted_median
from epinet.synth.dataset import parse_size


def best_s(work: Callable[[], object]) -> float:
    """Seconds of the fastest of three runs."""
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
    torch.set_num_threads(args.threads)
    size = parse_size(args.size)
    generator = torch.Generator().manual_seed(0)
    disparity, confidence = torch.rand(2, *size, generator=generator)
    guide = torch.rand(*size, 3, generator=generator)
    confidence = torch.where(confidence < 0.05, 0.1, 0.9)
    for window in (5, 9, 11, 15):
        seconds = best_s(lambda w=window: weighted_median(disparity, guide, window_px=w))  # type: ignore[misc]
        print(f"weighted median, {window}x{window} px: {seconds:.2f} s")
    print(f"refinement: {best_s(lambda: refined(disparity, guide, confidence)):.2f} s")


if __name__ == "__main__":
    main()
