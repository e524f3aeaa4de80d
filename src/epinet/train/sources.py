"""Where training patches come from: scenes rendered as they are needed, or folders of scenes."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from epinet.angular import CENTRAL_NINE
from epinet.errors import InputError
from epinet.io.hci import read_view_truths
from epinet.lightfield import LightField
from epinet.synth.generator import Pool, generator, pools, star_offsets
from epinet.synth.options import Options
from epinet.train.augment import ViewShift
from epinet.train.patches import Frames, LightFields, Offset, Patches, cut_by
from epinet.train.pool_cache import kept
from epinet.train.scenes import UnfitError, fitting, usable_scenes

LOGGER = logging.getLogger(__name__)
STEPS_PER_POOL = 16
"""So many steps use a pool of rendered scenes, each with other patches and augmentations; with more
of them a network adapts to the scenes in use, see docs/training.md."""

SLOTS = 8
"""So many pools are in use, in turn: steps that see the same scenes lie so far apart."""

MIRRORED = ("kitchen", "museum", "vinyl")
"""HCI's scenes with mirrors."""

CROP_FREEDOM_PX = 16
"""Rendered scenes are larger than a patch by this much."""


@dataclass(frozen=True)
class Needs:
    """What the network and the augmentations need to know of a scene."""

    views: int
    """Of the network, per direction."""
    shifted: bool = False
    """Whether view shift is on: all nine stars around the centre, each with its truth."""

    @property
    def truths(self) -> tuple[Offset, ...]:
        if not self.shifted:
            return ((0, 0),)
        return CENTRAL_NINE

    @property
    def offsets(self) -> tuple[Offset, ...]:
        """Of all views that any of the stars touches."""
        star = star_offsets(self.views)
        return tuple(sorted({(r + y, c + x) for r, c in star for y, x in self.truths}))

    @property
    def grid(self) -> int:
        """Views per row and column of the scenes."""
        return self.views + 2 * self.shifted


class Source(Protocol):
    """Scenes to cut squares from; what is cut depends on the arguments alone."""

    def draw(self, g: Generator, step: int, side_px: Tensor) -> Frames:
        """Squares of sides (B,) in scenes of a step, drawn at random."""

    def cut(self, step: int, frames: Frames, offsets: Sequence[Offset]) -> Patches:
        """Those squares, all of one side by now, with the views at `offsets`."""


class Mixed:
    """Several sources, each with its share of the squares."""

    def __init__(self, sources: Sequence[tuple[Source, float]]) -> None:
        self._sources = [source for source, _ in sources]
        self._shares = torch.tensor([share for _, share in sources])

    def draw(self, g: Generator, step: int, side_px: Tensor) -> Frames:
        chosen = torch.multinomial(self._shares, len(side_px), replacement=True, generator=g)
        parts, places = [], []
        for k, source in enumerate(self._sources):
            at = (chosen == k).nonzero()[:, 0]
            if len(at):
                frames = source.draw(g, step, side_px[at])
                parts.append(replace(frames, source=torch.full_like(frames.scene, k)))
                places.append(at)
        return Frames.joined(parts)[torch.cat(places).argsort()]

    def cut(self, step: int, frames: Frames, offsets: Sequence[Offset]) -> Patches:
        return cut_by(
            frames.source, frames, lambda k, of_it: self._sources[k].cut(step, of_it, offsets)
        )


class Rendered:
    """Endless scenes of the generator, rendered in pools that serve several steps.

    Step s takes its patches from the pool in slot s % `SLOTS`; slot after slot gets a new pool.
    Squares that are drawn together lie in different scenes of it as far as there are as many.

    Args:
        kinds: options of the scenes, of each pool one, and how often it is that; their size is
            chosen here.
        needs: which views and truths.
        seed: of the scenes.
        count: scenes per pool: as many as a batch has places.
        side_px: largest patch asked for.
        reach: share of the disparity range to use from a step on; asked where a pool begins.
        gray: render gray values only, which is three times faster.
        cache: folder that keeps the pools for other runs on the same scenes.
    """

    def __init__(
        self,
        kinds: Sequence[tuple[Options, float]],
        needs: Needs,
        *,
        seed: int,
        count: int,
        side_px: int,
        reach: Callable[[int], float] = lambda step: 1.0,
        gray: bool = True,
        textures: Path | None = None,
        cache: Path | None = None,
        device: str = "cpu",
    ) -> None:
        side = side_px + CROP_FREEDOM_PX
        self.kinds = [replace(o, size=(side, side), views=needs.grid) for o, _ in kinds]
        self._shares = torch.tensor([share for _, share in kinds])
        self.needs, self.seed, self.count = needs, seed, count
        self.reach, self.gray, self.textures, self.device = reach, gray, textures, device
        self.cache = cache
        self._slots: dict[int, tuple[int, LightFields]] = {}

    def draw(self, g: Generator, step: int, side_px: Tensor) -> Frames:
        rounds = math.ceil(len(side_px) / self.count)
        scenes = torch.cat([torch.randperm(self.count, generator=g) for _ in range(rounds)])
        return _anywhere(g, scenes[: len(side_px)], side_px, torch.tensor(self.kinds[0].size))

    def cut(self, step: int, frames: Frames, offsets: Sequence[Offset]) -> Patches:
        return self._pool(step).cut(frames, offsets)

    def _pool(self, step: int) -> LightFields:
        slot = step % SLOTS
        lifetime = STEPS_PER_POOL * SLOTS
        phase = STEPS_PER_POOL * slot  # so that not all slots change at once
        k = slot + SLOTS * ((step + phase) // lifetime)
        if slot not in self._slots or self._slots[slot][0] != k:
            begins = max(0, k // SLOTS * lifetime - phase)
            pool = self._rendered(k, self.reach(begins))
            self._slots[slot] = k, _light_fields(pool, self.needs)
        return self._slots[slot][1]

    def _rendered(self, k: int, reach: float) -> Pool:
        """Pool number k, with a share of the range of disparities."""
        g = generator(self.seed, 5, k)
        options = self.kinds[int(torch.multinomial(self._shares, 1, generator=g))]
        low, high = (reach * bound for bound in options.disparity_px)
        options = replace(options, disparity_px=(low, high))
        what: dict[str, Any] = {
            "seed": self.seed,
            "count": self.count,
            "first": k,
            "offsets": self.needs.offsets,
            "truths": self.needs.truths,
            "gray": self.gray,
        }

        def make() -> Pool:
            return next(pools(options, **what, textures=self.textures, device=self.device))

        if self.cache is None:
            return make()
        return kept(self.cache, asdict(options) | what, make, self.device)


class Folders:
    """Scenes on disk, read once and kept in memory; larger ones are drawn more often.

    Args:
        paths: scenes in any layout, or folders of them; `ViewShift` needs the benchmark's. Of a
            folder, scenes that cannot be used are left out, and named in the log.
        needs: which views and truths.
        side_px: largest patch asked for.
        weights: how often scenes of these names are drawn, relative to others of their size.

    Raises:
        InputError: all that is wrong: unreadable scenes; no truth, missing or small views where
            they are named themselves or no other is left; or no scene that is ever drawn.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        needs: Needs,
        *,
        side_px: int,
        weights: Mapping[str, float] | None = None,
        device: str = "cpu",
    ) -> None:
        self.device = device

        def fitted(folder: Path, lf: LightField) -> LightFields:
            scene = _scene(folder, fitting(folder, lf, needs.grid), needs, side_px)
            if folder.stem in MIRRORED and "invalid" not in lf.masks:
                LOGGER.warning(
                    "%s: no mask of its mirrors (invalid_mask.png, or the reference code's "
                    "input_Cam040_invalid_ver2.png), so that they are trained on",
                    folder,
                )
            return scene

        found = list(usable_scenes(paths, fitted))
        self.scenes = [scene for _, scene in found]
        self._sizes = torch.tensor([scene.disparity.shape[-2:] for scene in self.scenes])
        names = [folder.name for folder, _ in found]
        named = torch.tensor([(weights or {}).get(name, 1.0) for name in names])
        self._weights = named * self._sizes.prod(1)
        if not self._weights.any():
            raise InputError(f"scene_weights: leave nothing of the scenes {', '.join(names)}")

    def draw(self, g: Generator, step: int, side_px: Tensor) -> Frames:
        scenes = torch.multinomial(self._weights, len(side_px), replacement=True, generator=g)
        return _anywhere(g, scenes, side_px, self._sizes[scenes])

    def cut(self, step: int, frames: Frames, offsets: Sequence[Offset]) -> Patches:
        alone = replace(frames, scene=torch.zeros_like(frames.scene))
        patches = cut_by(frames.scene, alone, lambda k, of_it: self.scenes[k].cut(of_it, offsets))
        return patches.to(self.device)


def _anywhere(g: Generator, scenes: Tensor, side_px: Tensor, size: Tensor) -> Frames:
    """Squares at random places of scenes of a size, rows and columns."""
    free = size - side_px[:, None] + 1
    share = torch.rand(len(scenes), 2, dtype=torch.float64, generator=g)
    return Frames.upright(scenes, side_px, (share * free).long())


def _light_fields(pool: Pool, needs: Needs) -> LightFields:
    views, disparity, valid = (t.contiguous() for t in (pool.views, pool.disparity, pool.valid))
    return LightFields(views, needs.offsets, disparity, valid, needs.truths)


def _scene(folder: Path, lf: LightField, needs: Needs, side_px: int) -> LightFields:
    problems = []
    if min(lf.size) < side_px:
        problems.append(
            f"{folder}: views of {lf.size[1]}x{lf.size[0]} px are smaller than a patch with its "
            f"margins, {side_px} px; leave the scene out or use smaller patches or scales"
        )
    if lf.truth is None or not np.isfinite(lf.truth).any():
        problems.append(f"{folder}: no truth to learn from")
    row, col = lf.centre
    missing = [o for o in needs.offsets if not lf.present[row + o[0], col + o[1]]]
    if missing:
        problems.append(
            f"{folder}: {len(missing)} views of {len(needs.offsets)} are missing"
            + (f"; {ViewShift.name} needs all of them" if needs.shifted else "")
        )
    if problems:
        raise UnfitError(problems)
    disparity = _truths(folder, lf, needs)
    usable = np.isfinite(disparity)
    if "invalid" in lf.masks:  # known for the centre view; its neighbours look nearly alike
        usable &= ~lf.masks["invalid"]
    views = np.stack([_eight_bits(lf, row + y, col + x) for y, x in needs.offsets])
    shown, known, told = (torch.from_numpy(a)[None] for a in (views, disparity, usable))
    return LightFields(shown, needs.offsets, known, told, needs.truths)


def _truths(folder: Path, lf: LightField, needs: Needs) -> NDArray[np.float32]:
    """(T, H, W) in the order of `needs.truths`."""
    assert lf.truth is not None
    row, col = lf.centre
    others = [(row + y, col + x) for y, x in needs.truths if (y, x) != (0, 0)]
    try:
        truths = read_view_truths(folder, lf, others)
    except InputError as error:
        raise UnfitError(
            [
                *error.problems,
                f"{folder}: {ViewShift.name} needs the truth of the nine central "
                f"views; leave {ViewShift.name} out, or render scenes with epinet synth --truths",
            ]
        ) from error
    truths[row, col] = lf.truth
    return np.stack([truths[row + y, col + x] for y, x in needs.truths])


def _eight_bits(lf: LightField, row: int, col: int) -> NDArray[np.uint8]:
    """(C, H, W); a training set is kept in memory, at 8 bits as the benchmark's."""
    view = lf.views[row, col]
    if view.dtype != np.uint8:
        view = np.round(255 * lf.unit(row, col)).astype(np.uint8)
    return np.ascontiguousarray(view.transpose(2, 0, 1))
