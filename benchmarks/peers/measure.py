"""One method on one light field in a process of its own: writes the map, prints the times.

python -m benchmarks.peers.measure METHOD SCENE MAP.npy THREADS REPEATS
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import torch

from benchmarks.peers.measurements import measured
from benchmarks.peers.methods import estimator
from benchmarks.stated_ranges import KEPT
from epinet.allocator import keep_freed_memory
from epinet.io import read_light_field


def main() -> None:
    method, scene, output, threads, repeats = sys.argv[1:]
    keep_freed_memory()  # as the command line does
    torch.set_num_threads(int(threads))
    cv2.setNumThreads(int(threads))
    estimate, lf = estimator(method), read_light_field(Path(scene))
    (disparity, bounded), costs = measured(lambda: estimate(lf), int(repeats))
    np.save(output, disparity)
    print(json.dumps(costs | {KEPT: bounded}))


if __name__ == "__main__":
    main()
