"""Training batches: augmented patches of scenes; batch k depends on the seed and k alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.angular import STREAM_DIRECTIONS_DEG, direction_positions
from epinet.io.problems import Problems
from epinet.model.contrast import WINDOW_PX, local_contrast
from epinet.model.network import MARGIN_PX
from epinet.predict.batch import find_light_fields
from epinet.synth.generator import generator
from epinet.synth.options import RANGES_PX, Options
from epinet.train.augment import Augmentation, GrayWeights, Patch, Scale, gray
from epinet.train.recipe import Data, Recipe
from epinet.train.sources import Folders, Needs, Rendered, Source

TRIES = 50
"""So many patches are tried for a place of the batch before a rejected one is taken."""

SHARD_STRIDE = 1_000_003
"""Distance of the seeds of the scenes that a run's shards render."""

CONTRAST_MARGIN_PX = WINDOW_PX // 2


@dataclass(frozen=True)
class Batch:
    """Network input and its truth."""

    stacks: Tensor
    """(B, S, N, P + 22, P + 22) gray views, or their local contrast."""
    disparity: Tensor
    """(B, 1, P, P) px per adjacent view."""
    weight: Tensor
    """(B, 1, P, P): 1 where the truth can be told from the views, little where the surroundings
    have no texture to match, 0 on mirrors and where the truth is unknown."""


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
    textureless_weight: float | None
    """What textureless pixels count. None rejects whole patches as the paper does: those whose
    middle is textureless, and those that touch a mirror."""

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
        margin = self.cut.margin_px
        views = torch.stack([self._stacks(patch) for patch, _ in patches])
        if self.cut.local_contrast:
            views = local_contrast(views)[..., margin:-margin, margin:-margin]
        inner = slice(margin + MARGIN_PX, margin + MARGIN_PX + self.cut.patch_px)
        truths = torch.stack([patch.truth()[0][None, inner, inner] for patch, _ in patches])
        return Batch(views, truths, torch.stack([weight for _, weight in patches]))

    def _patch(self, g: Generator, step: int, place: int) -> tuple[Patch, Tensor]:
        """A patch with the weights (1, P, P) of its pixels."""
        for _ in range(TRIES):
            choices = [(a, a.draw(g)) for a in self.augmentations]
            side = self.cut.side_px
            for augmentation, choice in choices:
                side *= choice if isinstance(augmentation, Scale) else 1
            k = int(torch.multinomial(self._shares, 1, generator=g))
            patch = self._sources[k].patch(g, step, place, side)
            patch = _applied(patch, [c for c in choices if not c[0].photometric])
            weight = self._weight(patch)
            if self.cut.textureless_weight is not None or bool(weight.all()):
                break
        patch = gray(_applied(patch, [c for c in choices if c[0].photometric]))
        return patch, weight

    def _weight(self, patch: Patch) -> Tensor:
        """Judged before the camera's faults: noise is no texture."""
        margin, threshold = self.cut.margin_px, self.cut.texture_threshold
        end = margin + self.cut.seen_px
        centre = gray(patch).view((0, 0))[None, :, margin:end, margin:end]
        texture = textured(centre, threshold)[0]
        usable = patch.truth()[1][None, margin:end, margin:end]
        if self.cut.textureless_weight is None:
            middle = texture[:, self.cut.patch_px // 2, self.cut.patch_px // 2].item()
            kept = bool(middle) and bool(usable.all())
            return torch.full_like(texture, float(kept))
        inner = slice(MARGIN_PX, MARGIN_PX + self.cut.patch_px)
        weight: Tensor = texture.clamp_min(self.cut.textureless_weight) * usable[:, inner, inner]
        return weight

    def _stacks(self, patch: Patch) -> Tensor:
        """(S, N, H, W)."""
        return patch.views[self._order(patch), 0]

    def _order(self, patch: Patch) -> Tensor:
        place = {offset: k for k, offset in enumerate(patch.offsets)}
        n = self.cut.views
        return torch.tensor(
            [
                [place[row - n // 2, col - n // 2] for row, col in direction_positions(d, n)]
                for d in STREAM_DIRECTIONS_DEG[self.cut.streams]
            ]
        )


def _applied(patch: Patch, choices: Sequence[tuple[Augmentation, Any]]) -> Patch:
    for augmentation, choice in choices:
        patch = augmentation.apply(patch, choice)
    return patch


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


def batches_of(
    recipe: Recipe, shards: Sequence[int], *, textures: Path | None = None, device: str = "cpu"
) -> list[Batches]:
    """The batches of some shards of a recipe; scenes on disk are read once for all of them.

    Raises:
        InputError: scenes of the recipe that cannot be used.
    """
    cut = Cut(
        views=recipe.views,
        streams=recipe.streams,
        batch=recipe.batch // recipe.shards,
        patch_px=recipe.patch_px,
        local_contrast=recipe.local_contrast,
        texture_threshold=recipe.texture_threshold,
        textureless_weight=recipe.textureless_weight,
    )
    needs = Needs(recipe.views, recipe.shifted)
    side = cut.side_px * max(recipe.scales)

    problems = Problems()
    on_disk: dict[Path, Folders] = {}
    for folder in recipe.folders:
        with problems.gather():
            scenes = find_light_fields([folder])
            on_disk[folder] = Folders(scenes, needs, side_px=side, device=device)
    problems.raise_any()

    def source(data: Data, shard: int) -> Source:
        if data.folder is not None:
            return on_disk[data.folder]
        assert data.generator is not None
        return Rendered(
            Options(disparity_px=RANGES_PX[data.generator]),
            needs,
            seed=recipe.seed + SHARD_STRIDE * shard,
            count=cut.batch,
            side_px=side,
            reach=recipe.reach,
            gray=GrayWeights.name not in recipe.augmentations,
            textures=textures,
            device=device,
        )

    augmentations = recipe.chosen_augmentations()
    return [
        Batches(
            cut,
            [(source(data, shard), data.share) for data in recipe.data],
            augmentations,
            recipe.seed,
            shard,
        )
        for shard in shards
    ]
