"""Where training patches come from: scenes rendered as they are needed, or folders of scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator

from epinet.angular import CENTRAL_NINE
from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.io.hci import read_view_truths
from epinet.io.problems import Problems
from epinet.lightfield import LightField
from epinet.synth.generator import Pool, generator, pools, star_offsets
from epinet.synth.options import Options
from epinet.train.augment import Offset, Patch, ViewShift

STEPS_PER_POOL = 16
"""So many steps use a pool of rendered scenes, each with other patches and augmentations."""

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
    """Scenes to cut patches from; what is cut depends on the arguments alone."""

    def patch(self, g: Generator, step: int, place: int, side_px: int) -> Patch:
        """A square from a scene, for one place of the batch of a step."""


class Rendered:
    """Endless scenes of the generator, rendered in pools that serve several steps.

    Step s takes its patches from the pool in slot s % `SLOTS`; slot after slot gets a new pool.

    Args:
        kinds: options of the scenes, of each pool one, and how often it is that; their size is
            chosen here.
        needs: which views and truths.
        seed: of the scenes.
        count: scenes per pool: one for each place of a batch.
        side_px: largest patch asked for.
        reach: share of the disparity range to use from a step on; asked where a pool begins.
        gray: render gray values only, which is three times faster.
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
        device: str = "cpu",
    ) -> None:
        side = side_px + CROP_FREEDOM_PX
        self.kinds = [replace(o, size=(side, side), views=needs.grid) for o, _ in kinds]
        self._shares = torch.tensor([share for _, share in kinds])
        self.needs, self.seed, self.count = needs, seed, count
        self.reach, self.gray, self.textures, self.device = reach, gray, textures, device
        self._slots: dict[int, tuple[int, Pool]] = {}

    def patch(self, g: Generator, step: int, place: int, side_px: int) -> Patch:
        pool = self._pool(step)
        n = place % self.count
        scene = Patch(
            pool.views[n], self.needs.offsets, pool.disparity[n], pool.valid[n], self.needs.truths
        )
        return _piece(g, scene, side_px)

    def _pool(self, step: int) -> Pool:
        slot = step % SLOTS
        lifetime = STEPS_PER_POOL * SLOTS
        phase = STEPS_PER_POOL * slot  # so that not all slots change at once
        k = slot + SLOTS * ((step + phase) // lifetime)
        if slot not in self._slots or self._slots[slot][0] != k:
            begins = max(0, k // SLOTS * lifetime - phase)
            share = self.reach(begins)
            g = generator(self.seed, 5, k)
            options = self.kinds[int(torch.multinomial(self._shares, 1, generator=g))]
            low, high = (share * bound for bound in options.disparity_px)
            made = pools(
                replace(options, disparity_px=(low, high)),
                self.seed,
                self.count,
                first=k,
                offsets=self.needs.offsets,
                truths=self.needs.truths,
                gray=self.gray,
                textures=self.textures,
                device=self.device,
            )
            self._slots[slot] = k, next(made)
        return self._slots[slot][1]


class Folders:
    """Scenes on disk, read once and kept in memory; larger ones are drawn more often.

    Args:
        folders: one for each scene, in any layout; `ViewShift` needs the benchmark's.
        needs: which views and truths.
        side_px: largest patch asked for.
        weights: how often scenes of these names are drawn, relative to others of their size.

    Raises:
        InputError: all that is wrong: unreadable scenes, no truth, missing or small views, or no
            scene that is ever drawn.
    """

    def __init__(
        self,
        folders: Sequence[Path],
        needs: Needs,
        *,
        side_px: int,
        weights: Mapping[str, float] | None = None,
        device: str = "cpu",
    ) -> None:
        self.scenes: list[Patch] = []
        self.doubts: list[str] = []
        """About the scenes, for people."""
        self.device = device
        problems = Problems()
        for folder in folders:
            with problems.gather():
                lf = read_light_field(folder)
                self.scenes.append(_scene(folder, lf.central(needs.grid), needs, side_px))
                if folder.stem in MIRRORED and "invalid" not in lf.masks:
                    self.doubts.append(
                        f"{folder}: no mask of its mirrors (invalid_mask.png, or the reference "
                        "code's input_Cam040_invalid_ver2.png), so that they are trained on"
                    )
        problems.raise_any()
        self._weights = torch.tensor(
            [
                (weights or {}).get(folder.name, 1.0) * scene.disparity[0].numel()
                for folder, scene in zip(folders, self.scenes, strict=True)
            ]
        )
        if not self._weights.any():
            names = ", ".join(folder.name for folder in folders)
            raise InputError(f"scene_weights: leave nothing of the scenes {names}")

    def patch(self, g: Generator, step: int, place: int, side_px: int) -> Patch:
        scene = self.scenes[int(torch.multinomial(self._weights, 1, generator=g))]
        piece = _piece(g, scene, side_px)
        unit = piece.views.to(self.device).float() / 255
        disparity, usable = piece.disparity.to(self.device), piece.usable.to(self.device)
        return replace(piece, views=unit, disparity=disparity, usable=usable)


def _piece(g: Generator, scene: Patch, side_px: int) -> Patch:
    height, width = scene.disparity.shape[-2:]
    y, x = (int(torch.randint(n - side_px + 1, (), generator=g)) for n in (height, width))
    return scene.mapped(lambda image: image[..., y : y + side_px, x : x + side_px], lambda o: o)


def _scene(folder: Path, lf: LightField, needs: Needs, side_px: int) -> Patch:
    problems = Problems()
    if min(lf.size) < side_px:
        problems.append(
            f"{folder}: views of {lf.size[1]}x{lf.size[0]} px are smaller than a patch with its "
            f"margins, {side_px} px; leave the scene out or use smaller patches or scales"
        )
    if lf.truth is None:
        problems.append(f"{folder}: no truth to learn from")
    row, col = lf.centre
    missing = [o for o in needs.offsets if not lf.present[row + o[0], col + o[1]]]
    if missing:
        problems.append(
            f"{folder}: {len(missing)} views of {len(needs.offsets)} are missing"
            + (f"; {ViewShift.name} needs all of them" if needs.shifted else "")
        )
    problems.raise_any()
    disparity = _truths(folder, lf, needs)
    usable = np.isfinite(disparity)
    if "invalid" in lf.masks:  # known for the centre view; its neighbours look nearly alike
        usable &= ~lf.masks["invalid"]
    views = np.stack([_eight_bits(lf, row + y, col + x) for y, x in needs.offsets])
    return Patch(
        torch.from_numpy(views),
        needs.offsets,
        torch.from_numpy(disparity),
        torch.from_numpy(usable),
        needs.truths,
    )


def _truths(folder: Path, lf: LightField, needs: Needs) -> NDArray[np.float32]:
    """(T, H, W) in the order of `needs.truths`."""
    assert lf.truth is not None
    row, col = lf.centre
    others = [(row + y, col + x) for y, x in needs.truths if (y, x) != (0, 0)]
    try:
        truths = read_view_truths(folder, lf, others)
    except InputError as error:
        raise InputError(
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
