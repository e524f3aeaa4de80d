"""How much memory a tile takes: what `epinet.predict.tiling.FLOATS_PER_PX_AND_CHANNEL` rests on.

    python benchmarks/memory.py

Each tile runs in a process of its own; its peak above a 1x1 tile's, per pixel of the tile with
its margin and per channel of the merge part, is printed in floats.
"""

from __future__ import annotations

import resource
import subprocess
import sys

import torch

from epinet.model.network import MARGIN_PX, Epinet, EpinetConfig
from epinet.predict.tiling import run_tiled

SIDES_PX = (1, 96, 192, 384)


def peak_mb(side: int) -> float:
    """Peak memory of a process that computes one tile."""
    net = Epinet(EpinetConfig()).eval().to(memory_format=torch.channels_last)
    run_tiled(net, torch.zeros(4, 9, side, side), side)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    if len(sys.argv) > 1:
        print(peak_mb(int(sys.argv[1])))
        return
    peaks = {
        side: float(subprocess.check_output([sys.executable, __file__, str(side)]))
        for side in SIDES_PX
    }
    base = peaks.pop(1)
    for side, peak in peaks.items():
        floats = (peak - base) * 2**20 / 4 / (side + 2 * MARGIN_PX) ** 2 / 280
        print(f"{side} px: {peak - base:.0f} MB, {floats:.2f} floats per px and channel")


if __name__ == "__main__":
    main()
