"""How much memory a tile takes: what the networks' constants rest on.

    python -m benchmarks.memory

Each tile runs in a process of its own; its peak above that of the smallest tile, per pixel that the
network sees, is printed in floats (for EPINET per channel of the merge part, too).
"""

from __future__ import annotations

import resource
import subprocess
import sys

import torch

from epinet.networks.registry import network_type
from epinet.synth.options import RANGES_PX

SIDES_PX = {"epinet": (1, 96, 192, 384), "sweepnet": (32, 256, 512, 768)}


def peak_mb(model: str, side: int) -> float:
    """Peak memory of a process that computes one tile."""
    net = network_type(model)().eval()
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    net.predict(torch.zeros(4, 9, side, side), RANGES_PX["hci"], 1e6)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    if len(sys.argv) > 1:
        print(peak_mb(sys.argv[1], int(sys.argv[2])))
        return
    for model, sides in SIDES_PX.items():
        command = [sys.executable, "-m", "benchmarks.memory", model]
        base, *peaks = (float(subprocess.check_output([*command, str(side)])) for side in sides)
        margin, channels = (22, 280) if model == "epinet" else (0, 1)
        for side, peak in zip(sides[1:], peaks, strict=True):
            floats = (peak - base) * 2**20 / 4 / (side + margin) ** 2 / channels
            print(f"{model}, {side} px: {peak - base:.0f} MB, {floats:.1f} floats")


if __name__ == "__main__":
    main()
