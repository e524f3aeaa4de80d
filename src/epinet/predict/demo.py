"""The main job on a scene of our own: render, write, read, predict, score."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from epinet.io import read_light_field, write_light_field
from epinet.io.atomic import atomic_folder
from epinet.predict.estimator import load_model
from epinet.predict.result import check_replaceable
from epinet.synth.generator import render_scene
from epinet.synth.options import Options

SCENE = Options(
    size=(320, 448),
    disparity_px=(-2.5, 2.5),
    surfaces=(12, 16),
    contrast=(0.5, 1.0),
    textureless=0.0,
    thin=0.1,
    reflective=0.0,
    clutter=0.0,
)


def run_demo(
    output: Path, seed: int, progress: Callable[[float], None] = lambda share: None
) -> dict[str, Any]:
    """Write `output`/scene (a folder in the benchmark's layout, with truth) and `output`/result.

    Returns:
        The content of the result's run.json.

    Raises:
        InputError: `output` holds something else than an earlier demo, or cannot be written.
    """
    check_replaceable(output, frozenset({"scene", "result"}))
    with atomic_folder(output) as folder:
        write_light_field(folder / "scene", render_scene(SCENE, seed, 0), "hci")
        lf = replace(read_light_field(folder / "scene"), source=output / "scene")
        result = load_model().predict(lf, progress=progress)
        result.save(folder / "result")
    return result.describe()
