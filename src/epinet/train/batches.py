"""Training batches: augmented patches of scenes; batch k depends on the seed and k alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.angular import STREAM_DIRECTIONS_DEG, direction_positions
from epinet.errors import InputError
from epinet.inspect.disparity_range import searched
from epinet.inspect.information import disparity_deviation
from epinet.io.problems import Problems
from epinet.networks.base import Batch
from epinet.networks.inputs import Input
from epinet.synth.faults import ROUNDING
from epinet.synth.generator import generator
from epinet.train.augment import Augmentation, GrayWeights, Scale
from epinet.train.patches import Frames, Offset, Patches, gray, moved
from epinet.train.recipe import Recipe
from epinet.train.sources import Folders, Mixed, Needs, Rendered, Source

TRIES = 50
"""So many patches are tried for a place of the batch before it takes one of another place."""

SHARD_STRIDE = 1_000_003
"""Distance of the seeds of the scenes that a run's shards render."""

UNTOLD = 0.006
"""Views differ about so much in practice whatever their noise: interpolation, highlights, unequal
exposure."""

FEWER = (2, 4)
"""Batches that show fewer views show every so many-th on each side of the centre view."""

AROUND_PX = 11
"""The paper judges the texture of a pixel by those so far around."""


@dataclass(frozen=True)
class Cut:
    """What a batch is made of."""

    views: int
    """Of the network, per direction."""
    directions: int
    net_margin_px: int
    """Views extend so far beyond the map of a patch on each side."""
    batch: int
    patch_px: int
    """Side of the map that a patch gives."""
    input: Input
    """What the network sees of the views."""
    texture_threshold: float
    """Of the paper's textureless rejection, in gray levels of 0..1; see `textured`."""
    least_weight: float | None
    """What pixels count whose disparity the views do not tell; see `inspect.information`. None
    rejects whole patches as the paper does: those whose middle is textureless, and those that
    touch a mirror."""

    told_px: float = 0.03
    """Pixels count half whose disparity the views tell to within this standard deviation."""
    mirror_weight: float = 0.0
    """What pixels count that mirror."""
    fewer_views: float = 0.0
    """Share of the batches that show every second or fourth view only, with the same outermost."""

    @classmethod
    def of(cls, recipe: Recipe) -> Cut:
        """What a shard of a recipe's batches is made of."""
        with torch.device("meta"):  # takes no memory
            net = recipe.network()
        return cls(
            views=recipe.views,
            directions=net.directions,
            net_margin_px=net.margin_px,
            batch=recipe.batch // recipe.shards,
            patch_px=recipe.patch_px,
            input=recipe.input,
            texture_threshold=recipe.texture_threshold,
            least_weight=recipe.least_weight,
            told_px=recipe.told_px,
            mirror_weight=recipe.mirror_weight,
            fewer_views=recipe.fewer_views,
        )

    @property
    def enlarged(self) -> Cut:
        """A quarter as many patches whose views are twice as wide and high."""
        patch_px = 2 * self.patch_px + 2 * self.net_margin_px
        return replace(self, batch=self.batch // 4, patch_px=patch_px)

    @property
    def seen_px(self) -> int:
        """Side of the views that the network sees."""
        return self.patch_px + 2 * self.net_margin_px

    @property
    def side_px(self) -> int:
        """Side of the views that a patch is cut with, before it is scaled down."""
        return self.seen_px + 2 * self.margin_px

    @property
    def margin_px(self) -> int:
        """What patches have beyond what the network sees, on each side."""
        return self.input.margin_px

    @property
    def inner(self) -> slice:
        """Where the map lies in a patch as it is cut, in each direction."""
        first = self.margin_px + self.net_margin_px
        return slice(first, first + self.patch_px)

    @property
    def offsets(self) -> list[Offset]:
        """Of the views that the network sees."""
        half = self.views // 2
        return [
            (row - half, col - half)
            for d in STREAM_DIRECTIONS_DEG[self.directions]
            for row, col in direction_positions(d, self.views)
        ]


class Batches:
    """Batches of patches, each augmented by itself.

    Args:
        cut: shape of the batches.
        source: of the patches.
        augmentations: in the order to apply them.
        seed: of everything drawn; `shard` numbers independent streams of one seed.
    """

    def __init__(
        self,
        cut: Cut,
        source: Source,
        augmentations: Sequence[Augmentation],
        seed: int,
        shard: int = 0,
    ) -> None:
        self.cut, self.source, self.seed, self.shard = cut, source, seed, shard
        self._geometric = [a for a in augmentations if not a.photometric]
        self._gray = next((a for a in augmentations if isinstance(a, GrayWeights)), None)
        self._photometric = [a for a in augmentations if a.photometric and a is not self._gray]
        self._star = sorted(set(cut.offsets))
        order = [self._star.index(offset) for offset in cut.offsets]
        self._stacks = torch.tensor(order).view(cut.directions, cut.views)

    def __call__(self, step: int) -> Batch:
        g = generator(self.seed, 3, self.shard, step)
        mixture = self._gray.draw(g, self.cut.batch) if self._gray else None
        frames, mixture, any_accepted = self._frames(g, step, mixture)
        patches = self._patches(g, step, frames, mixture)
        margin, inner = self.cut.margin_px, self.cut.inner
        weight = self._weight(patches, any_accepted)
        views = patches.views[:, :, 0]
        if margin:
            at_once = len(views) if views.is_cuda else 1  # so that a core's cache holds them
            seen = [
                self.cut.input.of(v)[..., margin:-margin, margin:-margin]
                for v in torch.split(views, at_once)
            ]
            views = torch.cat(seen)
        # What is unknown has no weight, which NaN would not keep.
        truths = patches.disparity[:, None, inner, inner].nan_to_num()
        every = self._every(g)
        stacks = views[:, moved(self._stacks[:, ::every], views.device)]
        low, high = _extremes(patches.disparity)
        bounds = searched(every * low, every * high) if low <= high else (-1.0, 1.0)
        return Batch(stacks, every * truths, weight, every, bounds)

    def _every(self, g: Generator) -> int:
        """Of the views on each side of the centre view, every so many-th is shown.

        Of 3 or 7 views none can be left out so that the outermost stay.
        """
        half = self.cut.views // 2
        choices = [k for k in FEWER if half % k == 0]
        share, choice = torch.rand(2, generator=g).tolist()
        if not choices or share >= self.cut.fewer_views:
            return 1
        return choices[int(choice * len(choices))]

    def _frames(
        self, g: Generator, step: int, mixture: Tensor | None
    ) -> tuple[Frames, Tensor | None, bool]:
        """Where the batch's patches lie, their gray, and whether any is one to learn from.

        Texture is judged in the gray that the network sees, as the reference code does. Where
        nothing to learn from was found for some of the places, they take over patches of others, so
        that the norms' statistics, too, are of patches to learn from alone.
        """
        frames = self._drawn(g, step, self.cut.batch)
        if self.cut.least_weight is not None:
            return frames, mixture, True
        accepted = self._accepted(step, frames, mixture)
        for _ in range(TRIES - 1):
            missing = (~accepted).nonzero()[:, 0]
            if not len(missing):
                break
            others = self._drawn(g, step, len(missing))
            frames = frames.put(missing, others)
            of_missing = None if mixture is None else mixture[missing]
            accepted[missing] = self._accepted(step, others, of_missing)
        found, missing = accepted.nonzero()[:, 0], (~accepted).nonzero()[:, 0]
        if len(found):
            again = found[torch.randint(len(found), (len(missing),), generator=g)]
            frames = frames.put(missing, frames[again])
            if mixture is not None:
                mixture[missing] = mixture[again]
        return frames, mixture, len(found) > 0

    def _drawn(self, g: Generator, step: int, count: int) -> Frames:
        choices = [(a, a.draw(g, count)) for a in self._geometric]
        side_px = torch.full((count,), self.cut.side_px)
        for augmentation, choice in choices:
            side_px = side_px * choice if isinstance(augmentation, Scale) else side_px
        frames = self.source.draw(g, step, side_px)
        for augmentation, choice in choices:
            frames = augmentation.apply(frames, choice)
        return frames

    def _accepted(self, step: int, frames: Frames, mixture: Tensor | None) -> Tensor:
        """(B,) on the CPU; judged before the camera's faults: noise is no texture."""
        seen = frames.window(self.cut.margin_px, self.cut.seen_px)
        centre = self._in_gray(self.source.cut(step, seen, [(0, 0)]), mixture)
        usable = centre.usable.flatten(1).all(1)
        middle = self.cut.net_margin_px + self.cut.patch_px // 2
        around = slice(middle - AROUND_PX, middle + AROUND_PX + 1)
        views = centre.centre_view[..., around, around]
        texture = textured(views, self.cut.texture_threshold).flatten() > 0
        return (texture & usable).cpu()

    def _patches(self, g: Generator, step: int, frames: Frames, mixture: Tensor | None) -> Patches:
        """In gray."""
        patches = self._in_gray(self.source.cut(step, frames, self._star), mixture)
        for augmentation in self._photometric:
            patches = augmentation.apply(patches, augmentation.draw(g, len(frames.scene)))
        return patches

    def _in_gray(self, patches: Patches, mixture: Tensor | None) -> Patches:
        if self._gray is None or mixture is None:
            return gray(patches)
        return self._gray.apply(patches, mixture)

    def _weight(self, patches: Patches, any_accepted: bool) -> Tensor:
        """(B, 1, P, P)."""
        cut, inner = self.cut, self.cut.inner
        usable = patches.usable[:, None, inner, inner]
        if cut.least_weight is None:
            return torch.full_like(usable, any_accepted, dtype=torch.float)
        centre, noise = patches.centre_view, _noise(patches)
        other = torch.full_like(noise, UNTOLD)
        unit = cut.input.unit(centre)
        centre, noise, other = cut.input.of(centre), noise / unit, other / unit
        deviation = disparity_deviation(centre, noise, cut.offsets, other)[..., inner, inner]
        told = 1 / (1 + (deviation / cut.told_px) ** 2)
        return torch.where(usable, told.clamp_min(cut.least_weight), cut.mirror_weight)


def _noise(patches: Patches) -> Tensor:
    """(B, 1, H, W) standard deviation of the centre view's noise; of 8 bits where unknown."""
    if patches.noise is None:
        return torch.full_like(patches.centre_view, ROUNDING)
    return patches.noise[:, None]


def _extremes(disparity: Tensor) -> tuple[float, float]:
    """Least and greatest of those that are known; the least is infinite where none is."""
    least = disparity.nan_to_num(torch.inf).min()
    greatest = disparity.nan_to_num(-torch.inf).max()
    low, high = torch.stack([least, greatest]).tolist()
    return low, high


def textured(centre: Tensor, threshold: float) -> Tensor:
    """Where the 23x23 surroundings of a pixel differ from it by at least `threshold` on average.

    The paper's rejection of textureless patches (section 3.4; it has .02, the reference code
    .01), pixel by pixel: there any disparity explains the views.

    Args:
        centre: (B, 1, H, W) the centre view, 0..1.

    Returns:
        (B, 1, H - 22, W - 22), 1 or 0.
    """
    inner = centre[..., AROUND_PX:-AROUND_PX, AROUND_PX:-AROUND_PX]
    side = 2 * AROUND_PX + 1
    surroundings = F.unfold(centre, side).view(len(centre), side**2, *inner.shape[-2:])
    difference = (surroundings - inner).abs().mean(1, keepdim=True)
    return (difference >= threshold).float()


@dataclass(frozen=True)
class InTurn:
    """Small batches and large ones: step k has the large one wherever k * share passes a whole
    number."""

    small: Batches
    large: Batches
    share: float

    def __call__(self, step: int) -> Batch:
        is_large = math.floor((step + 1) * self.share) > math.floor(step * self.share)
        return (self.large if is_large else self.small)(step)


def batches_of(
    recipe: Recipe,
    shards: Sequence[int],
    *,
    cache: Path | None = None,
    device: str = "cpu",
) -> list[Callable[[int], Batch]]:
    """The batches of some shards of a recipe; scenes on disk are read once for all of them.

    Args:
        cache: folder that keeps rendered scenes for other runs on the same ones.

    Raises:
        InputError: scenes of the recipe that cannot be used.
    """
    if cache is not None and recipe.textures is not None:
        raise InputError(
            f"{cache}: scenes that wear the photographs in {recipe.textures} are not kept, since "
            "these may change; leave out the cache or the photographs"
        )
    small = Cut.of(recipe)
    large = small.enlarged if recipe.large_patches else None
    needs = Needs(recipe.views, recipe.shifted)
    scale = max(recipe.scales)

    problems = Problems()
    on_disk: list[tuple[Source, float]] = []
    for data in recipe.data:
        if data.folder is not None:
            with problems.gather():
                source = Folders(
                    [data.folder],
                    needs,
                    side_px=scale * (large or small).side_px,
                    weights=recipe.scene_weights,
                    device=device,
                )
                on_disk.append((source, data.share))
    problems.raise_any()
    kinds = [(data.rendered(), data.share) for data in recipe.data if data.generator is not None]

    def batches(cut: Cut, shard: int) -> Batches:
        sources = list(on_disk)
        if kinds:
            rendered = Rendered(
                kinds,
                needs,
                seed=recipe.seed + SHARD_STRIDE * shard,
                count=cut.batch,
                side_px=cut.side_px * scale,
                reach=recipe.reach,
                gray=GrayWeights.name not in recipe.augmentations,
                textures=recipe.textures,
                cache=cache,
                device=device,
            )
            sources.append((rendered, sum(share for _, share in kinds)))
        return Batches(cut, Mixed(sources), recipe.chosen_augmentations(), recipe.seed, shard)

    return [
        InTurn(batches(small, shard), batches(large, shard), recipe.large_patches)
        if large
        else batches(small, shard)
        for shard in shards
    ]
