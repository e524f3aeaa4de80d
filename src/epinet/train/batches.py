"""Endless training batches of rendered scenes; batch k depends on the seed and k alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.angular import DIRECTIONS_DEG, SYMMETRIES, direction_positions, star_positions
from epinet.model.contrast import WINDOW_PX, local_contrast
from epinet.model.network import MARGIN_PX
from epinet.synth.faults import photographed
from epinet.synth.generator import Pool, generator, pools, star_offsets
from epinet.synth.options import Options

TEXTURE_THRESHOLD = 0.003
"""The paper has 0.02, its reference code 0.01, for which dark walls show no texture at all; in
low noise, 23x23 pixels tell disparity from a contrast near the 8-bit step."""

TEXTURELESS_WEIGHT = 0.2
"""Not 0: what a network never sees there, it answers with anything; the likeliest is better."""

STEPS_PER_POOL = 8
CROP_FREEDOM_PX = 16
CONTRAST_MARGIN_PX = WINDOW_PX // 2


@dataclass(frozen=True)
class Batch:
    """Network input and its truth."""

    stacks: Tensor
    """(B, 4, N, P + 22, P + 22) local contrast of the gray views."""
    disparity: Tensor
    """(B, 1, P, P) px per adjacent view."""
    weight: Tensor
    """(B, 1, P, P): 1 where the truth can be told from the views, little where the surroundings
    have no texture to match, 0 on mirrors."""


def stack_star(star: Tensor, views: int) -> Tensor:
    """Views of the star (B, 4N-3, H, W), in `star_positions` order, as stacks (B, 4, N, H, W)."""
    index = {p: i for i, p in enumerate(star_positions(views))}
    order = [[index[p] for p in direction_positions(d, views)] for d in DIRECTIONS_DEG]
    return star[:, torch.tensor(order)]


class BatchSource:
    """Renders pools of scenes and cuts an augmented patch from each for a batch.

    A pool serves several steps, each with other crops, symmetries, exposure and noise.
    """

    def __init__(self, views: int, batch: int, patch: int, seed: int) -> None:
        self.batch, self.patch, self.seed = batch, patch, seed
        self.seen_px = patch + 2 * MARGIN_PX
        side = self.seen_px + 2 * CONTRAST_MARGIN_PX + CROP_FREEDOM_PX
        self.options = Options(size=(side, side), views=views)
        self._pool: tuple[int, Pool] | None = None

    def __call__(self, step: int, disparity_range_px: tuple[float, float]) -> Batch:
        """Batch number `step`; `disparity_range_px` counts where a new pool begins."""
        pool = self._rendered(step // STEPS_PER_POOL, disparity_range_px)
        g = generator(self.seed, 3, step)
        corners = torch.randint(CROP_FREEDOM_PX + 1, (self.batch, 2), generator=g).tolist()
        margin = CONTRAST_MARGIN_PX
        clean = _cut(pool.views, corners, self.seen_px + 2 * margin)
        photos = photographed(g, clean, self.options.faults)[:, :, 0]
        inner = slice(margin, -margin)
        seen = local_contrast(photos)[..., inner, inner]
        centre = star_offsets(self.options.views).index((0, 0))
        # Noise is no texture: the views before the camera's faults tell.
        weight = textured(clean[:, centre, :, inner, inner]).clamp_min(TEXTURELESS_WEIGHT)
        map_corners = [(y + margin + MARGIN_PX, x + margin + MARGIN_PX) for y, x in corners]
        disparity = _cut(pool.disparity, map_corners, self.patch)
        weight = weight * _cut(pool.valid, map_corners, self.patch)
        symmetry = SYMMETRIES[int(torch.randint(len(SYMMETRIES), (), generator=g))]
        stacks = symmetry.apply_to_stacks(stack_star(seen, self.options.views))
        return Batch(stacks, symmetry.apply(disparity), symmetry.apply(weight))

    def _rendered(self, k: int, bounds: tuple[float, float]) -> Pool:
        if self._pool is None or self._pool[0] != k:
            options = replace(self.options, disparity_px=bounds)
            self._pool = k, next(pools(options, self.seed, self.batch, first=k))
        return self._pool[1]


def _cut(images: Tensor, corners: list[tuple[int, int]], side: int) -> Tensor:
    """Squares of (B, ..., H, W), one of each."""
    return torch.stack(
        [i[..., y : y + side, x : x + side] for i, (y, x) in zip(images, corners, strict=True)]
    )


def textured(centre: Tensor, threshold: float = TEXTURE_THRESHOLD) -> Tensor:
    """Where the 23x23 surroundings of a pixel differ from it by at least `threshold` on average.

    The paper's rejection of textureless patches (section 3.4), pixel by pixel: there any
    disparity explains the views, and learning from it only adds noise.

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
