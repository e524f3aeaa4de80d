"""From a light field to its disparity map: prepare, run, judge."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.angular import SYMMETRIES, star_positions
from epinet.errors import InputError
from epinet.inspect.disparity_range import (
    LONGER_SIDE_PX,
    DisparityRange,
    range_match,
    searched,
)
from epinet.inspect.gains import estimate_gains, even
from epinet.inspect.sweep import star_of_stacks
from epinet.io.array import check_range
from epinet.io.problems import Problems
from epinet.lightfield import LightField
from epinet.networks.base import Network, Progress
from epinet.networks.registry import DEFAULT_MODEL, network_type
from epinet.networks.weights import Weights, load_weights, shipped_weights
from epinet.predict.doubts import doubts_about_search
from epinet.predict.judgement import as_read, judge, smoothed
from epinet.predict.preparation import Prepared, prepare
from epinet.predict.result import Result
from epinet.synth.options import RANGES_PX

DEFAULT_MEMORY_MB = 1536.0


class _Map(NamedTuple):
    """What a network says of the views shrunk by the scale, in their pixels."""

    disparity: Tensor
    error: Tensor | None
    """Expected; None from a network that predicts none."""
    searched_px: tuple[float, float] | None
    """Disparities that the network looked for; None from one bound to those of its training."""
    begun: float
    """When the network began, after all was prepared."""
    doubts: tuple[str, ...] = ()
    """Of the range that was measured for it."""


class _Search(NamedTuple):
    """Where a network that searches is to look for disparities."""

    range_px: tuple[float, float]
    """In px of the views as they are."""
    gains: Tensor | None
    """Of the views' exposure; None where nothing could be matched."""
    doubts: tuple[str, ...]


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
        self.weights = sorted(weights, key=lambda w: w.net.views[0], reverse=True)
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
        refine: bool | None = None,
        range_px: tuple[float, float] | None = None,
        bounded: bool | None = None,
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
            refine: compensate misalignment and exposure of the views before, and take the weighted
                median after (docs/refinement.md); None does so where a camera took the views.
            range_px: disparities that SweepNet looks for, in the map's unit; None measures them.
            bounded: the map stays within `range_px`, or what the light field's camera states: what
                reflects shows others. None bounds the map of a network that looks for a range
                (SweepNet), and any by a given `range_px`; EPINET's published maps know no range.
            memory_mb: bound on what the network holds at once, beside the views themselves.
            progress: called with the share of the work (0..1) done since the last call.

        Raises:
            InputError: the light field does not suit the network or the settings.
        """
        self._check(lf, scale, step, memory_mb, range_px)
        start = time.perf_counter()
        weights, used = self._fitting(lf, step)
        refine = lf.captured if refine is None else refine
        views = prepare(used, refine)
        larger, size = views.enlargement, views.seen.size
        prepared = time.perf_counter()
        asked_px = range_px and (larger * range_px[0], larger * range_px[1])
        map_ = self._estimate(weights, views, ensemble, scale, asked_px, memory_mb, progress)
        found = enlarge(map_.disparity, scale, size).cpu().numpy()
        error = None if map_.error is None else enlarge(map_.error, scale, size).cpu().numpy()
        estimated = time.perf_counter()
        if bounded is None:
            bounded = range_px is not None or map_.searched_px is not None
        camera = views.as_read.camera
        stated_px = range_px or (camera.disparity_range_px if camera else None)
        stated_px = stated_px if bounded else None
        judged = judge(
            views, weights, found, error, scale=scale, stated_px=stated_px, doubted=map_.doubts
        )
        judged_at = time.perf_counter()
        if refine:
            judged = smoothed(judged, views.seen)
        judged, shown = as_read(judged, views)
        done = time.perf_counter()
        known_px = map_.searched_px or weights.disparity_range_px
        return Result(
            disparity=judged.disparity,
            confidence=judged.confidence,
            expected_error=judged.expected_error,
            confidence_means=judged.confidence_means,
            lightfield=shown,
            settings={
                "ensemble": ensemble,
                "scale": scale,
                "step": step,
                "refine": refine,
                "memory_mb": memory_mb,
                "device": str(self.device),
                "row_spacing": round(views.as_read.row_spacing, 4),
                "range_px": known_px and [round(scale * bound / larger, 2) for bound in known_px],
                "stated_px": stated_px and list(stated_px),
            },
            weights={"file": weights.source, "model": weights.model, "sha256": weights.sha256},
            seconds={
                "align": prepared - start,
                "prepare": map_.begun - prepared,
                "network": estimated - map_.begun,
                "confidence": judged_at - estimated,
                "refine": done - judged_at,
            },
            alignment=views.alignment,
            warnings=judged.warnings,
        )

    def _estimate(
        self,
        weights: Weights,
        views: Prepared,
        ensemble: bool,
        scale: int,
        range_px: tuple[float, float] | None,
        memory_mb: float,
        progress: Progress,
    ) -> _Map:
        net, lf = weights.net, views.seen
        if ensemble and net.directions != 4:
            raise InputError("the ensemble turns streams into each other and needs all four")
        stacks = torch.from_numpy(lf.stacks(lf.grid[0], net.directions))
        search = _search(stacks, views, range_px) if net.searches else None
        seen = shrink(stacks, scale).to(self.device)
        if search is not None and search.gains is not None:
            even(seen, search.gains)
        seen = weights.input.of(seen)
        low, high = weights.disparity_range_px or RANGES_PX["hci"]
        if search is not None:
            low, high = search.range_px
        bounds = (low / scale, high / scale)
        begun = time.perf_counter()
        disparity, error = _run(net, seen, bounds, ensemble, memory_mb, progress)
        if search is None:
            return _Map(disparity, error, None, begun)
        return _Map(disparity, error, bounds, begun, search.doubts)

    def _check(
        self,
        lf: LightField,
        scale: int,
        step: int,
        memory_mb: float,
        range_px: tuple[float, float] | None,
    ) -> None:
        name = lf.source or "light field"
        problems = Problems()
        if lf.views.dtype == np.float32:
            with problems.gather():
                check_range(lf.views, name)
        if scale < 1 or step < 1:
            problems.append(f"scale and step must be at least 1, not {scale} and {step}")
        elif min(lf.size) // scale < 1:
            problems.append(f"{name}: views of {lf.size[1]}x{lf.size[0]} px are too small for it")
        if not (math.isfinite(memory_mb) and memory_mb > 0):
            problems.append(f"the memory bound must be positive, not {memory_mb} MB")
        if range_px is not None:
            low, high = range_px
            if not -math.inf < low < high < math.inf:
                problems.append(
                    f"the range must be a lesser and a greater disparity, not {low:g},{high:g}"
                )
            elif max(-low, high) > max(lf.size):
                problems.append(f"{name}: disparities of {low:g},{high:g} px are beyond its views")
        fewest = min(w.net.views[-1] for w in self.weights)
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
        choices = [(views, weights) for weights in self.weights for views in weights.net.views]
        for views, weights in sorted(choices, key=lambda choice: choice[0], reverse=True):
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
                f"{views}x{views} are {lf.absence}; the network needs them all"
            ]
        raise InputError(problems)


def _search(stacks: Tensor, views: Prepared, range_px: tuple[float, float] | None) -> _Search:
    """What views (S, N, H, W) show of where to look for disparities, unless a range is given."""
    star = star_of_stacks(stacks, LONGER_SIDE_PX)
    match = views.match if views.is_matched else range_match(star.exposed_alike())
    gains = None if match is None else estimate_gains(star, match)
    if range_px:
        return _Search(range_px, gains, ())
    found = None if match is None else DisparityRange.of(star, match)
    return _Search(search_range(found), gains, tuple(doubts_about_search(found, star)))


def search_range(found: DisparityRange | None) -> tuple[float, float]:
    """Disparities to look for, in px, by those that the views show.

    Where they show too little texture to tell, the benchmark's.
    """
    return RANGES_PX["hci"] if found is None else searched(found.min_px, found.max_px)


def _run(
    net: Network[Any],
    stacks: Tensor,
    range_px: tuple[float, float],
    ensemble: bool,
    memory_mb: float,
    progress: Progress,
) -> tuple[Tensor, Tensor | None]:
    """Map and expected error (H, W) of stacks; for an ensemble, the means over the 8 symmetries."""
    if not ensemble:
        return net.predict(stacks, range_px, memory_mb, progress)

    def advance(share: float) -> None:
        progress(share / len(SYMMETRIES))

    maps, errors = [], []
    for symmetry in SYMMETRIES:
        turned = symmetry.apply_to_stacks(stacks)
        disparity, error = net.predict(turned, range_px, memory_mb, advance)
        maps.append(symmetry.undo(disparity))
        if error is not None:
            errors.append(symmetry.undo(error))
    return torch.stack(maps).mean(0), torch.stack(errors).mean(0) if errors else None


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


def load_model(
    weights: Path | str | None = None, device: str | None = None, model: str | None = None
) -> Estimator:
    """A model ready to predict.

    Args:
        weights: a .safetensors file of epinet, or the name of shipped weights. None takes, for
            each light field, the model's shipped weights of most views that it has.
        device: e.g. "cpu" or "cuda:1"; None takes a GPU where there is one.
        model: "sweepnet" (the default), "epinet" or one of your own, "my_package.my_module:MyNet",
            whose code is run; weights of the first two need none.

    Raises:
        InputError: the weights cannot be used, are of another model, or there is no such device.
    """
    kind = None if model is None else network_type(model)
    names: list[Path | str] = [weights] if weights is not None else []
    if weights is None:
        names += shipped_weights(model or DEFAULT_MODEL)
        if not names:
            raise InputError(f"model {model}: no weights come with it; name a file of weights")
    loaded = [load_weights(name) for name in names]
    for w in loaded:
        if kind is not None and type(w.net) is not kind:
            raise InputError(f"{w.source}: weights of {w.model}, not of {model}")
    return Estimator(*loaded, device=device)
