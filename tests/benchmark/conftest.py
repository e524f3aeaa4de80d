"""Small scenes with truth on disk, in the benchmark's layout."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from epinet.benchmark.evaluate import Evaluation, Method, evaluate
from epinet.benchmark.maps import find_maps
from epinet.benchmark.scenes import find_scenes
from epinet.io import write_pfm
from epinet.io.images import write_png
from epinet.metrics.catalogue import benchmark_metrics

SIZE = (40, 48)


@pytest.fixture
def add_scene(tmp_path) -> Callable[..., Path]:
    """Writes a scene into tmp_path/data and returns its folder."""

    def add(name, truth=None, *, high=None, masks=None, numbered=None) -> Path:
        folder = tmp_path / "data" / name
        folder.mkdir(parents=True)
        truth = np.zeros(SIZE) if truth is None else truth
        write_pfm(folder / "gt_disp_lowres.pfm", truth)
        if high is not None:
            write_pfm(folder / "gt_disp_highres.pfm", high)
        for file, mask in (masks or {}).items():
            write_png(folder / f"{file}.png", mask.astype(np.uint8) * np.uint8(255))
        for file, mask in (numbered or {}).items():
            write_png(folder / f"{file}.png", mask.astype(np.uint8))
        rng = np.random.default_rng(0)
        view = rng.integers(0, 256, (*truth.shape, 3)).astype(np.uint8)
        write_png(folder / "input_Cam040.png", view)
        return folder

    return add


@pytest.fixture
def evaluated(tmp_path) -> Callable[..., Evaluation]:
    """Scores maps, given by method and scene, on the scenes of tmp_path/data."""

    def run(methods: dict, seconds: dict | None = None, **options) -> Evaluation:
        scenes = find_scenes(tmp_path / "data")
        found = []
        for method, maps in methods.items():
            folder = tmp_path / "maps" / method
            for name, map_ in maps.items():
                write_pfm(folder / f"{name}.pfm", map_)
            if method in (seconds or {}):
                (folder / "runtimes").mkdir()
                for name in maps:
                    (folder / "runtimes" / f"{name}.txt").write_text(f"{seconds[method]}\n")
            sizes = {scene.name: scene.size for scene in scenes}
            found.append(Method(method, str(folder), find_maps(folder, sizes)))
        return evaluate(found, scenes, benchmark_metrics(), **options)

    return run
