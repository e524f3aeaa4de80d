"""Training batches: augmented patches of scenes; batch k depends on the seed and k alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.angular import STREAM_DIRECTIONS_DEG, direction_positions
from epinet.io.problems import Problems
from epinet.model.contrast import WINDOW_PX, contrast_unit, local_contrast
from epinet.model.epinet import MARGIN_PX
from epinet.model.sweepnet import searched
from epinet.predict.batch import find_light_fields
from epinet.synth.faults import ROUNDING
from epinet.synth.generator import generator
from epinet.train.augment import Augmentation, GrayWeights, Offset, Patch, Scale, gray
from epinet.train.information import disparity_deviation
from epinet.train.recipe import Recipe
from epinet.train.sources import Folders, Needs, Rendered, Source

TRIES = 50
"""So many patches are tried for a place of the batch before a rejected one is taken."""

SHARD_STRIDE = 1_000_003
"""Distance of the seeds of the scenes that a run's shards render."""

UNTOLD = 0.006
"""Views differ about so much in practice whatever their noise: interpolation, highlights, unequal
exposure."""

FEWER = (2, 4)
"""Batches that show fewer views show every so many-th on each side of the centre view."""

CONTRAST_MARGIN_PX = WINDOW_PX // 2


@dataclass(frozen=True)
class Batch:
    """Network input and its truth."""

    stacks: Tensor
    """(B, S, N, P + 22, P + 22) gray views, or their local contrast."""
    disparity: Tensor
    """(B, 1, P, P) px per adjacent view of the stacks; 0 where unknown."""
    weight: Tensor
    """(B, 1, P, P): 1 where the truth can be told from the views, less where there is little
    texture to match for the noise, on mirrors as the recipe says, and 0 where the truth is
    unknown."""
    every: int
    """The stacks hold every so many-th view on each side of the centre view."""
    range_px: tuple[float, float]
    """Where SweepNet looks for the disparities of the stacks: as far beyond them as when it
    predicts, whose ranges differ, too."""


@dataclass(frozen=True)
class Cut:
    """What a batch is made of."""

    views: int
    """Of the network, per direction."""
    streams: int
    batch: int
    patch_px: int
    """Side of the map that a patch gives; its views are 22 px larger."""
    local_contrast: bool
    """Whether the network sees local contrast; otherwise plain gray."""
    texture_threshold: float
    """Of the paper's textureless rejection, in gray levels of 0..1; see `textured`."""
    least_weight: float | None
    """What pixels count whose disparity the views do not tell; see `information`. None rejects
    whole patches as the paper does: those whose middle is textureless, and those that touch a
    mirror."""

    told_px: float = 0.03
    """Pixels count half whose disparity the views tell to within this standard deviation."""
    mirror_weight: float = 0.0
    """What pixels count that mirror."""
    fewer_views: float = 0.0
    """Share of the batches that show every second or fourth view only, with the same outermost."""

    @classmethod
    def of(cls, recipe: Recipe) -> Cut:
        """What a shard of a recipe's batches is made of."""
        return cls(
            views=recipe.views,
            streams=recipe.streams,
            batch=recipe.batch // recipe.shards,
            patch_px=recipe.patch_px,
            local_contrast=recipe.local_contrast,
            texture_threshold=recipe.texture_threshold,
            least_weight=recipe.least_weight,
            told_px=recipe.told_px,
            mirror_weight=recipe.mirror_weight,
            fewer_views=recipe.fewer_views,
        )

    @property
    def enlarged(self) -> Cut:
        """A quarter as many patches whose views are twice as wide and high."""
        patch_px = 2 * self.patch_px + 2 * MARGIN_PX
        return replace(self, batch=self.batch // 4, patch_px=patch_px)

    @property
    def seen_px(self) -> int:
        """Side of the views that the network sees."""
        return self.patch_px + 2 * MARGIN_PX

    @property
    def side_px(self) -> int:
        """Side of the views that a patch is cut with, before it is scaled down."""
        return self.seen_px + 2 * self.margin_px

    @property
    def margin_px(self) -> int:
        return CONTRAST_MARGIN_PX if self.local_contrast else 0

    @property
    def inner(self) -> slice:
        """Where the map lies in a patch as it is cut, in each direction."""
        return slice(self.margin_px + MARGIN_PX, self.margin_px + MARGIN_PX + self.patch_px)

    @property
    def offsets(self) -> list[Offset]:
        """Of the views that the network sees."""
        half = self.views // 2
        return [
            (row - half, col - half)
            for d in STREAM_DIRECTIONS_DEG[self.streams]
            for row, col in direction_positions(d, self.views)
        ]


class Batches:
    """Batches of patches, each from a source of its own choice and augmented by itself.

    Args:
        cut: shape of the batches.
        sources: with the share of the patches that each gives.
        augmentations: in the order to apply them.
        seed: of everything drawn; `shard` numbers independent streams of one seed.
    """

    def __init__(
        self,
        cut: Cut,
        sources: Sequence[tuple[Source, float]],
        augmentations: Sequence[Augmentation],
        seed: int,
        shard: int = 0,
    ) -> None:
        self.cut, self.augmentations, self.seed, self.shard = cut, augmentations, seed, shard
        self._sources = [source for source, _ in sources]
        self._shares = torch.tensor([share for _, share in sources])

    def __call__(self, step: int) -> Batch:
        g = generator(self.seed, 3, self.shard, step)
        patches = [self._patch(g, step, place) for place in range(self.cut.batch)]
        margin, inner = self.cut.margin_px, self.cut.inner
        weight = self._weight(patches)
        views = torch.stack([self._stacks(patch) for patch, _ in patches])
        if self.cut.local_contrast:
            views = local_contrast(views)[..., margin:-margin, margin:-margin]
        truths = torch.stack([patch.truth()[0][None, inner, inner] for patch, _ in patches])
        truths = truths.nan_to_num()  # what is unknown has no weight, which NaN would not keep
        every = self._every(g)
        known = every * torch.cat([patch.truth()[0].flatten() for patch, _ in patches])
        known = known[known.isfinite()]
        bounds = searched(known.min().item(), known.max().item()) if len(known) else (-1.0, 1.0)
        return Batch(views[:, :, ::every], every * truths, weight, every, bounds)

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

    def _patch(self, g: Generator, step: int, place: int) -> tuple[Patch, bool]:
        """A patch, and whether it is one to learn from."""
        for _ in range(TRIES):
            choices = [(a, a.draw(g)) for a in self.augmentations]
            side = self.cut.side_px
            for augmentation, choice in choices:
                side *= choice if isinstance(augmentation, Scale) else 1
            k = int(torch.multinomial(self._shares, 1, generator=g))
            patch = self._sources[k].patch(g, step, place, side)
            # Texture is judged in the gray that the network sees, as the reference code does.
            first = [c for c in choices if not c[0].photometric or isinstance(c[0], GrayWeights)]
            patch = _applied(patch, first)
            accepted = self.cut.least_weight is not None or self._accepts(patch)
            if accepted:
                break
        return gray(_applied(patch, choices[len(first) :])), accepted

    def _accepts(self, patch: Patch) -> bool:
        """Judged before the camera's faults: noise is no texture."""
        margin, middle = self.cut.margin_px, self.cut.patch_px // 2
        seen = slice(margin, margin + self.cut.seen_px)
        centre = gray(patch).view((0, 0))[None, :, seen, seen]
        texture = textured(centre, self.cut.texture_threshold)[0, 0, middle, middle]
        return bool(texture) and bool(patch.truth()[1][seen, seen].all())

    def _weight(self, patches: Sequence[tuple[Patch, bool]]) -> Tensor:
        """(B, 1, P, P)."""
        cut, inner = self.cut, self.cut.inner
        usable = torch.stack([patch.truth()[1][None, inner, inner] for patch, _ in patches])
        if cut.least_weight is None:
            accepted = torch.tensor([accepted for _, accepted in patches])
            return accepted.view(-1, 1, 1, 1).to(usable.device) * torch.ones_like(usable).float()
        centre = torch.stack([patch.view((0, 0)) for patch, _ in patches])
        noise = torch.stack([_noise(patch) for patch, _ in patches])
        other = torch.full_like(noise, UNTOLD)
        if cut.local_contrast:
            unit = contrast_unit(centre)
            centre, noise, other = local_contrast(centre), noise / unit, other / unit
        deviation = disparity_deviation(centre, noise, cut.offsets, other)[..., inner, inner]
        told = 1 / (1 + (deviation / cut.told_px) ** 2)
        return torch.where(usable, told.clamp_min(cut.least_weight), cut.mirror_weight)

    def _stacks(self, patch: Patch) -> Tensor:
        """(S, N, H, W)."""
        return patch.views[self._order(patch), 0]

    def _order(self, patch: Patch) -> Tensor:
        place = {offset: k for k, offset in enumerate(patch.offsets)}
        order = [place[offset] for offset in self.cut.offsets]
        return torch.tensor(order).view(self.cut.streams, self.cut.views)


def _applied(patch: Patch, choices: Sequence[tuple[Augmentation, Any]]) -> Patch:
    for augmentation, choice in choices:
        patch = augmentation.apply(patch, choice)
    return patch


def _noise(patch: Patch) -> Tensor:
    """(1, H, W) standard deviation of the centre view's noise; of 8 bits where it is unknown."""
    if patch.noise is None:
        return torch.full_like(patch.view((0, 0)), ROUNDING)
    return patch.noise[None]


def textured(centre: Tensor, threshold: float) -> Tensor:
    """Where the 23x23 surroundings of a pixel differ from it by at least `threshold` on average.

    The paper's rejection of textureless patches (section 3.4; it has .02, the reference code
    .01), pixel by pixel: there any disparity explains the views.

    Args:
        centre: (B, 1, H, W) the centre view, 0..1.

    Returns:
        (B, 1, H - 22, W - 22), 1 or 0.
    """
    inner = centre[..., MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]
    side = 2 * MARGIN_PX + 1
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
    device: str = "cpu",
    say: Callable[[str], None] = lambda line: None,
) -> list[Callable[[int], Batch]]:
    """The batches of some shards of a recipe; scenes on disk are read once for all of them.

    Args:
        say: told what may be wrong with them, a line at a time.

    Raises:
        InputError: scenes of the recipe that cannot be used.
    """
    small = Cut.of(recipe)
    large = small.enlarged if recipe.large_patches else None
    needs = Needs(recipe.views, recipe.shifted)
    scale = max(recipe.scales)

    problems = Problems()
    on_disk: list[tuple[Source, float]] = []
    for data in recipe.data:
        if data.folder is not None:
            with problems.gather():
                scenes = find_light_fields([data.folder])
                side_px = scale * (large or small).side_px
                weights = recipe.scene_weights
                source = Folders(scenes, needs, side_px=side_px, weights=weights, device=device)
                on_disk.append((source, data.share))
                for doubt in source.doubts:
                    say(f"warning: {doubt}")
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
                device=device,
            )
            sources.append((rendered, sum(share for _, share in kinds)))
        return Batches(cut, sources, recipe.chosen_augmentations(), recipe.seed, shard)

    return [
        InTurn(batches(small, shard), batches(large, shard), recipe.large_patches)
        if large
        else batches(small, shard)
        for shard in shards
    ]
