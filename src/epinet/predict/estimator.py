"""From a light field to its disparity map: prepare, run, judge."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.angular import SYMMETRIES, star_positions
from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.model.checkpoint import Weights, load_weights, shipped_weights
from epinet.model.contrast import local_contrast
from epinet.model.network import Epinet
from epinet.predict.confidence import photo_consistency
from epinet.predict.result import Result
from epinet.predict.tiling import run_tiled, tile_side_px

DEFAULT_MEMORY_MB = 1024.0
LOW_CONFIDENCE = 0.5

Progress = Callable[[float], None]


class Estimator:
    """Networks with their weights on a device; of several, a light field gets the one that fits.

    Args:
        weights: of networks that differ in how many views they see. A light field is shown to the
            one of most views among those that it has all views for.
        device: to run on; None takes a GPU where there is one.

    Raises:
        InputError: there is no such device.

    Example:
        >>> lf = epinet.read_light_field("scene")          # doctest: +SKIP
        >>> result = epinet.load_model().predict(lf)       # doctest: +SKIP
        >>> result.disparity.shape == lf.size              # doctest: +SKIP
        True
    """

    def __init__(self, *weights: Weights, device: str | None = None) -> None:
        self.weights = sorted(weights, key=lambda w: w.net.config.views, reverse=True)
        self.device = choose_device(device)
        for w in weights:
            w.net.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    @property
    def sha256(self) -> str:
        """Of all the weights' files."""
        return " ".join(w.sha256 for w in self.weights)

    def predict(
        self,
        lf: LightField,
        *,
        ensemble: bool = False,
        scale: int = 1,
        step: int = 1,
        memory_mb: float = DEFAULT_MEMORY_MB,
        progress: Progress = lambda share: None,
    ) -> Result:
        """Estimate the disparity of the reference view.

        Args:
            lf: a grid of at least as many views as a network sees; the central ones are used.
            ensemble: average over the 8 flips and rotations (Epinet-fcn-m), 8 times slower.
            scale: for disparities beyond the network's range: the network sees views shrunk
                by this factor; the map comes back at full size in full-size pixels.
            step: take every step-th view; the map is then per so many adjacent views.
            memory_mb: bound on what the network holds at once, beside the views themselves.
            progress: called with the share of the work (0..1) done since the last call.

        Raises:
            InputError: the light field does not suit the network or the settings.
        """
        self._check(lf, scale, step, memory_mb)
        start = time.perf_counter()
        weights, used = self._fitting(lf, step)
        net = weights.net
        if ensemble and net.config.streams != 4:
            raise InputError("the ensemble turns streams into each other and needs all four")
        stacks = torch.from_numpy(used.stacks(net.config.views, net.config.streams))
        side = tile_side_px(net, memory_mb)
        prepared = time.perf_counter()
        seen = shrink(stacks, scale).to(self.device)
        if weights.sees_local_contrast:
            seen = local_contrast(seen)
        map_ = _estimate(net, seen, ensemble, side, progress)
        disparity = enlarge(map_, scale, lf.size).cpu().numpy()
        estimated = time.perf_counter()
        confidence = photo_consistency(used, disparity)
        done = time.perf_counter()
        return Result(
            disparity=disparity,
            confidence=confidence,
            lightfield=used,
            settings={
                "ensemble": ensemble,
                "scale": scale,
                "step": step,
                "memory_mb": memory_mb,
                "device": str(self.device),
            },
            weights={"file": weights.source} | weights.metadata,
            seconds={
                "prepare": prepared - start,
                "network": estimated - prepared,
                "confidence": done - estimated,
            },
            warnings=_warnings(weights, disparity, confidence, scale),
        )

    def _check(self, lf: LightField, scale: int, step: int, memory_mb: float) -> None:
        name = lf.source or "light field"
        problems = []
        if scale < 1 or step < 1:
            problems.append(f"scale and step must be at least 1, not {scale} and {step}")
        elif min(lf.size) // scale < 1:
            problems.append(f"{name}: views of {lf.size[1]}x{lf.size[0]} px are too small for it")
        if not (math.isfinite(memory_mb) and memory_mb > 0):
            problems.append(f"the memory bound must be positive, not {memory_mb} MB")
        fewest = self.weights[-1].net.config.views
        if min(lf.grid) < fewest:
            problems.append(
                f"{name}: has {lf.grid[0]}x{lf.grid[1]} views, the weights "
                f"{self.weights[-1].source} need {fewest}x{fewest}; give weights trained for fewer"
            )
        if problems:
            raise InputError(problems)

    def _fitting(self, lf: LightField, step: int) -> tuple[Weights, LightField]:
        """The weights of most views that the light field has, and those views."""
        problems = []
        for weights in self.weights:
            views = weights.net.config.views
            try:
                used = lf.central(views, step)
            except InputError as error:
                problems = error.problems
                continue
            gone = [p for p in star_positions(views) if not used.present[p]]
            if not gone:
                return weights, used
            problems = [
                f"{lf.source or 'light field'}: the views at (row, column) {gone} of the central "
                f"{views}x{views} are missing or black; the network needs them all"
            ]
        raise InputError(problems)


def _estimate(net: Epinet, stacks: Tensor, ensemble: bool, side: int, progress: Progress) -> Tensor:
    def advance(share: float) -> None:
        progress(share / len(SYMMETRIES))

    if not ensemble:
        return run_tiled(net, stacks, side, progress)
    total = torch.zeros(stacks.shape[-2:], device=stacks.device)
    for s in SYMMETRIES:
        total += s.undo(run_tiled(net, s.apply_to_stacks(stacks), side, advance))
    return total / len(SYMMETRIES)


def _warnings(weights: Weights, disparity: Any, confidence: Any, scale: int) -> tuple[str, ...]:
    warnings = []
    bounds = weights.disparity_range_px
    if bounds is not None:
        low, high = np.percentile(disparity, [1, 99]) / scale
        if low < bounds[0] or high > bounds[1]:
            warnings.append(
                f"disparities of {low:.1f}..{high:.1f} px exceed the {bounds[0]:g}.."
                f"{bounds[1]:g} px that the weights were trained for: try a larger --scale"
            )
    if np.median(confidence) < LOW_CONFIDENCE:
        warnings.append(
            "the views disagree under the estimate: is their order right, and are the "
            "disparities within range? `epinet info` measures both"
        )
    return tuple(warnings)


def shrink(stacks: Tensor, scale: int) -> Tensor:
    """Views (..., N, H, W) averaged over scale x scale px, the last block padded by its edge."""
    if scale == 1:
        return stacks
    height, width = stacks.shape[-2:]
    padded = F.pad(stacks, (0, -width % scale, 0, -height % scale), mode="replicate")
    return F.avg_pool2d(padded, scale)


def enlarge(disparity: Tensor, scale: int, size: tuple[int, int]) -> Tensor:
    """A map (h, w) of shrunk views as a map of `size` in full-size pixels."""
    if scale == 1:
        return disparity
    large = F.interpolate(
        disparity[None, None] * scale, scale_factor=scale, mode="bilinear", align_corners=False
    )
    return large[0, 0, : size[0], : size[1]]


def choose_device(name: str | None = None) -> torch.device:
    """The device named, or the GPU where there is one.

    Raises:
        InputError: there is no such device.
    """
    if name is None:
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"device {name!r} cannot be used: {reason}") from error
    return device


def load_model(weights: Path | str | None = None, device: str | None = None) -> Estimator:
    """A model ready to predict.

    Args:
        weights: a .safetensors file of epinet, or the name of shipped weights. None takes, for
            each light field, the shipped weights of most views that it has.
        device: e.g. "cpu" or "cuda:1"; None takes a GPU where there is one.

    Raises:
        InputError: the weights cannot be used or there is no such device.
    """
    names = list(shipped_weights()) if weights is None else [weights]
    return Estimator(*map(load_weights, names), device=device)
