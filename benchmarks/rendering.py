"""How fast scenes are rendered, beside how fast the 9x9 network trains on them, in one run.

    python -m benchmarks.rendering -o benchmarks/results/rendering.json [--device cuda]

A megapixel is a million finished pixels of any view, all 33 views of the star counted. Training
follows the recipe fast-9x9: a step takes in 33 views of 38x38 px per patch, a pool of scenes serves
16 steps.
"""

from __future__ import annotations

import argparse
import json
import platform
import resource
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from epinet.model.epinet import MARGIN_PX
from epinet.synth.generator import bank, draw_scene, pools, star_offsets
from epinet.synth.options import RANGES_PX, Options
from epinet.synth.render import Lens, render
from epinet.train.batches import Cut, batches_of
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run
from epinet.train.sources import CROP_FREEDOM_PX, SLOTS, STEPS_PER_POOL

SEED = 77
VIEWS = 33


def seconds(work: Callable[[], object], device: str) -> float:
    """Time of one call, the device's queue emptied."""
    start = time.perf_counter()
    work()
    if device.startswith("cuda"):
        torch.cuda.synchronize()
    return time.perf_counter() - start


def _repeat(work: Callable[[], object], times: int) -> None:
    for _ in range(times):
        work()


def pool_rate(options: Options, count: int, rounds: int, device: str) -> float:
    """Megapixels per second of pools as training asks for them."""
    stream = pools(options, SEED, count, device=device)
    next(stream)  # the stock of textures, shared by 16 pools, and first calls
    time_s = seconds(lambda: [next(stream) for _ in range(rounds)], device)
    height, width = options.size
    return rounds * count * VIEWS * height * width / time_s / 1e6


def scene_rate(options: Options, count: int, device: str) -> float:
    """Megapixels per second of large scenes, one after the other."""
    scenes = [draw_scene(options, SEED, index, device)[0] for index in range(count)]
    offsets = star_offsets(options.views)
    time_s = seconds(lambda: [render(s, offsets, Lens(options.samples)) for s in scenes], device)
    height, width = options.size
    return count * VIEWS * height * width / time_s / 1e6


def training_rate(rounds: int) -> tuple[float, float]:
    """Megapixels per second that training on the CPU takes in: its steps alone, its data alone."""
    recipe = load_recipe("fast-9x9", {"narrow": 1.0})
    (batches,) = batches_of(recipe, [0])
    batch = batches(0)
    with TemporaryDirectory() as folder:
        run = Run(recipe, Path(folder))
        run.batches = [lambda step: batch]
        run._train_step()
        step_s = seconds(lambda: _repeat(run._train_step, rounds), "cpu") / rounds
    for step in range(SLOTS):
        batches(step)
    steps = range(SLOTS, SLOTS + SLOTS * STEPS_PER_POOL)  # every slot gets a new pool once
    data_s = seconds(lambda: [batches(step) for step in steps], "cpu")
    pixels = recipe.batch * VIEWS * (recipe.patch_px + 2 * MARGIN_PX) ** 2 / 1e6
    return pixels / step_s, len(steps) * pixels / data_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--rounds", type=int, default=4)
    args = parser.parse_args()
    device, gpu = args.device, args.device.startswith("cuda")
    side = Cut.of(load_recipe("fast-9x9")).side_px + CROP_FREEDOM_PX
    pool_options = Options(size=(side, side))
    report: dict[str, object] = {
        "machine": torch.cuda.get_device_name() if gpu else args.machine,
        "threads": torch.get_num_threads(),
        "bank_s": round(seconds(lambda: bank(pool_options, SEED, 9, None, device), device), 2),
        "pools_mp_per_s": round(
            pool_rate(pool_options, 256 if gpu else 32, args.rounds, device), 2
        ),
        "scenes_512_mp_per_s": {
            name: round(scene_rate(Options(disparity_px=bounds), args.rounds, device), 2)
            for name, bounds in RANGES_PX.items()
        },
    }
    if not gpu:
        step, data = training_rate(8)
        report |= {
            "training_takes_mp_per_s": round(step, 2),
            "batches_come_at_mp_per_s": round(data, 2),
            "batches_over_training": round(data / step, 2),
        }
    report["peak_memory_mb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    if gpu:
        report["peak_gpu_memory_mb"] = round(torch.cuda.max_memory_allocated() / 2**20)
    print(json.dumps(report, indent=1))
    args.output.parent.mkdir(parents=True, exist_ok=True)
    args.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
