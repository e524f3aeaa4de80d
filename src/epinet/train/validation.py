"""Scores of a network in training, on scenes that it is not trained on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
import torch

from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.io.names import folder_name
from epinet.io.problems import Problems
from epinet.lightfield import LightField
from epinet.metrics.disparity import BORDER_PX
from epinet.networks.weights import Weights
from epinet.predict.confidence import Calibration
from epinet.predict.estimator import Estimator
from epinet.predict.pictures import save_preview
from epinet.predict.result import Result
from epinet.synth.generator import render_scene
from epinet.synth.options import Options
from epinet.synth.validation import VALIDATION_SEED
from epinet.train.scenes import UnfitError, fitting, usable_scenes

SCENES = 16
SIDE_PX = 128
PICTURES = 4
RENDERED = "rendered scenes held out"
"""What runs are validated on unless told otherwise."""


LEAST_KNOWN = 0.5
"""A rendered scene with truth on less of its pixels, a mirror for the most part, is passed over."""


@dataclass(frozen=True)
class Validation:
    """Scenes with truth, by name; what their masks call invalid (mirrors, panes) has none."""

    scenes: dict[str, LightField]

    @classmethod
    def rendered(
        cls, views: int, disparity_px: tuple[float, float], number: int = SCENES
    ) -> Validation:
        """Small scenes of held-out textures and shapes; half of them use a quarter of the range.

        Quick to make and to predict; the set of `epinet validation` says more.
        """
        scenes: dict[str, LightField] = {}
        for k in count():
            if len(scenes) == number:
                break
            share = 1.0 if k % 2 == 0 else 0.25
            low, high = (share * bound for bound in disparity_px)
            options = Options(
                size=(SIDE_PX, SIDE_PX), disparity_px=(low, high), views=views, held_out=True
            )
            lf = _reliable(render_scene(options, VALIDATION_SEED, k, star_only=True))
            if _known(lf) >= LEAST_KNOWN:
                scenes[f"rendered_{k:02d}"] = lf
        return cls(scenes)

    @classmethod
    def of_folders(
        cls,
        paths: Sequence[Path],
        views: int,
        trained_on: Sequence[Path] = (),
    ) -> Validation:
        """Scenes on disk.

        Args:
            paths: scenes, or folders of them. Of a folder, scenes that are trained on, have no
                truth to score with or lack views are left out, and named in the log.
            views: rows and columns that the network sees.
            trained_on: scenes not to validate on.

        Raises:
            InputError: scenes that cannot be read or share a name, and those that are left out of a
                folder where they are named themselves or no other is left.
        """
        taken = {folder.resolve() for folder in trained_on}

        def judged(folder: Path, lf: LightField) -> LightField:
            if folder.resolve() in taken:
                raise UnfitError(f"{folder}: is trained on; validate on other scenes")
            lf = _reliable(fitting(folder, lf, views))
            if not _known(lf):
                raise UnfitError(
                    f"{folder}: no truth to validate with inside the border of {BORDER_PX} px"
                )
            if gone := [p for p in star_positions(views) if not lf.present[p]]:
                raise UnfitError(f"{folder}: the views at (row, column) {gone} are missing")
            return lf

        scenes: dict[str, LightField] = {}
        problems = Problems()
        with problems.gather():
            for folder, lf in usable_scenes(paths, judged):
                name = folder_name(folder)
                if name in scenes:
                    problems.append(f"{folder}: another scene to validate on is named {name}")
                scenes[name] = lf
        problems.raise_any()
        return cls(scenes)

    def predict(self, weights: Weights, device: torch.device, *, bf16: bool) -> dict[str, Result]:
        """Results of a network, by the names of the scenes.

        Args:
            weights: the network, in eval mode.
            device: where to predict.
            bf16: autocast to bfloat16.
        """
        estimator = Estimator(weights, device=str(device))
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=bf16):
            return {name: estimator.predict(lf, refine=False) for name, lf in self.scenes.items()}


def _reliable(lf: LightField) -> LightField:
    """With no truth where the views show something else; and without the camera, which would state
    the range of disparities, as captures come without one."""
    return replace(lf, truth=lf.reliable_truth, camera=None)


def _known(lf: LightField) -> float:
    """Share of the pixels inside the benchmark's border that have truth; 0 where none is inside."""
    if lf.truth is None or min(lf.size) <= 2 * BORDER_PX:
        return 0.0
    inner = slice(BORDER_PX, -BORDER_PX)
    return float(np.isfinite(lf.truth[inner, inner]).mean())


def mean_scores(results: dict[str, Result]) -> dict[str, float]:
    """Mean over the scenes of each score, inside the benchmark's border."""
    each = []
    for name, result in results.items():
        if result.scores is None:
            raise InputError(f"{name}: no pixel with truth inside the border of 15 px")
        each.append(result.scores)
    return {key: sum(scores[key] for scores in each) / len(each) for key in each[0]}


def save_pictures(folder: Path, results: dict[str, Result]) -> None:
    """Writes previews of the first scenes to a folder."""
    for name, result in list(results.items())[:PICTURES]:
        with atomic_path(folder / f"{name}.png") as temporary:
            save_preview(temporary, result)


def fitted_calibration(results: dict[str, Result]) -> Calibration:
    """What the errors that SweepNet expects mean, by its true errors."""
    expected, errors = [], []
    for result in results.values():
        truth, own = result.lightfield.truth, result.expected_error
        assert truth is not None and own is not None
        known = np.isfinite(truth)
        expected.append(own[known])
        errors.append(np.abs(result.disparity - truth)[known])
    return Calibration.fitted(np.concatenate(expected), np.concatenate(errors))
