"""How fast scenes are rendered, beside how fast networks train on them, in one run.

    python -m benchmarks.rendering -o benchmarks/results/rendering.json [--device cuda]

A megapixel is a million finished pixels of any view, all 33 views of the star counted. Training
follows the recipe fast-9x9: a step takes in 33 views of 38x38 px per patch, a pool of scenes serves
16 steps. Of some recipes, in float32, also where the time of a step goes: the network is its
forward and its backward pass, all else is what a step should cost next to nothing of.
"""

from __future__ import annotations

import json
import platform
import resource
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import Tensor

from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.networks.base import Batch
from epinet.synth.generator import SCENES_PER_BANK, bank, draw_scene, pools, star_offsets
from epinet.synth.options import RANGES_PX, Options
from epinet.synth.render import Lens, render
from epinet.train.batches import Cut, batches_of
from epinet.train.parallel import Team
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import load_recipe
from epinet.train.run import Run
from epinet.train.sources import CROP_FREEDOM_PX, SLOTS, STEPS_PER_POOL

SEED = 77
VIEWS = 33
RECIPES = ("fast-9x9", "sweepnet", "paper-7x7")
POOLS = 4
"""So many pools of scenes are made and trained on where the shares of a step are measured."""


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
    pixels = recipe.batch * VIEWS * (recipe.patch_px + 2 * recipe.kind.margin_px) ** 2 / 1e6
    return pixels / step_s, len(steps) * pixels / data_s


def _scenes_s(recipe: Recipe, make: Callable[[int], Batch]) -> float:
    """CPU seconds per step for its share of a pool, its first batch included, and of the textures
    that pools share."""
    begun = time.process_time()
    stocks = {data.rendered().contrast: data.rendered() for data in recipe.data}
    for options in stocks.values():
        bank(options, recipe.seed, 0)
    banked = time.process_time()
    for step in range(POOLS):
        make(step)
    pool_s = (time.process_time() - banked) / POOLS
    return (pool_s + (banked - begun) / SCENES_PER_BANK) / STEPS_PER_POOL


def step_shares(name: str, rounds: int) -> dict[str, float]:
    """CPU seconds of a step of a recipe by what they go into, and the share of all but the net."""
    recipe = load_recipe(name, {"narrow": 1.0, "bf16": False})
    (make,) = batches_of(recipe, [0])
    spent = dict.fromkeys(("scenes", "batches", "network", "optimiser", "rest"), 0.0)
    clock = time.process_time
    begun = {"network": clock()}

    def timed(part: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*arguments: Any) -> Any:
            begun = clock()
            result = work(*arguments)
            spent[part] += clock() - begun
            return result

        return watched

    class Watch(Team):
        """Notes where the backward pass ends."""

        def add(self, tensors: Sequence[Tensor]) -> None:
            if tensors[0].ndim == 0:  # a step's message begins with its loss
                spent["network"] += clock() - begun["network"]

    def loss(batch: Batch) -> Tensor:
        begun["network"] = clock()
        return unwatched(batch)

    steps = [k + SLOTS * r for r in range(rounds + 1) for k in range(POOLS)]
    with TemporaryDirectory() as folder:
        run = Run(recipe, Path(folder), team=Watch())
        run.batches = [lambda step: first]
        all_scenes_s = _scenes_s(recipe, make)
        first = make(SLOTS)
        run._train_step()  # first calls are slow
        spent["network"] = 0.0
        unwatched, run._loss = run._loss, loss  # type: ignore[method-assign]
        run.optimisers.step = timed("optimiser", run.optimisers.step)  # type: ignore[method-assign]
        run.batches = [timed("batches", make)]
        whole = clock()
        for run.step in steps[POOLS:]:
            run._train_step()
        whole = clock() - whole
    count = len(steps) - POOLS
    spent = {part: seconds / count for part, seconds in spent.items()}
    spent["rest"] = whole / count - sum(spent.values())
    spent["scenes"] = all_scenes_s - spent["batches"] / STEPS_PER_POOL
    share = 1 - spent["network"] / sum(spent.values())
    return {f"{part}_s": round(s, 3) for part, s in spent.items()} | {
        "share_beside_the_network": round(share, 3)
    }


def main() -> None:
    parser = Parser(description=__doc__.split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--machine", default=platform.processor() or platform.machine())
    parser.add_argument("--rounds", type=int, default=4)
    args = parser.parse_args()
    keep_freed_memory()  # as the command line does
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
        report["steps"] = {name: step_shares(name, 1) for name in RECIPES}
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
