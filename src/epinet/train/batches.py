"""Endless training batches from the layer generator; batch k depends on the seed and k alone."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.angular import DIRECTIONS_DEG, SYMMETRIES, direction_positions, star_positions
from epinet.model.contrast import local_contrast
from epinet.model.network import MARGIN_PX
from epinet.synth.layers import LayerScenes, draw_scenes

SEEDS_PER_RUN = 2**20
"""Torch's CPU generator heeds 32 bits of a seed: run s takes the seeds from (s - 1) * this on."""

TEXTURE_THRESHOLD = 0.003
"""The paper has 0.02, its reference code 0.01, for which dark walls show no texture at all; in
low noise, 23x23 pixels tell disparity from a contrast near the 8-bit step."""

STEPS_PER_POOL = 8
CROP_FREEDOM_PX = 32


@dataclass(frozen=True)
class Batch:
    """Network input and its truth."""

    stacks: Tensor
    """(B, 4, N, P + 22, P + 22) local contrast of the gray views."""
    disparity: Tensor
    """(B, 1, P, P) px per adjacent view."""
    textured: Tensor
    """(B, 1, P, P): 1 where the surroundings have texture to match, else 0."""


def star_offsets(views: int) -> list[tuple[int, int]]:
    """(row, col) of the star's views counted from the centre view."""
    return [(r - views // 2, c - views // 2) for r, c in star_positions(views)]


def stack_star(star: Tensor, views: int) -> Tensor:
    """Views of the star (B, 4N-3, H, W), in `star_positions` order, as stacks (B, 4, N, H, W)."""
    index = {p: i for i, p in enumerate(star_positions(views))}
    order = [[index[p] for p in direction_positions(d, views)] for d in DIRECTIONS_DEG]
    return star[:, torch.tensor(order)]


class BatchSource:
    """Renders pools of scenes and cuts an augmented patch from each for a batch.

    A pool serves several steps, each with other crops, symmetries, exposure and noise:
    rendering then costs less than a third of training.
    """

    def __init__(self, views: int, batch: int, patch: int, seed: int) -> None:
        self.views, self.batch, self.patch, self.seed = views, batch, patch, seed
        self._pool: tuple[int, Tensor, Tensor] | None = None

    def __call__(self, step: int, disparity_range_px: tuple[float, float]) -> Batch:
        """Batch number `step`; `disparity_range_px` counts where a new pool begins."""
        star, truth = self._rendered(step // STEPS_PER_POOL, disparity_range_px)
        g = self._generator(2 * step + 1)
        size = self.patch + 2 * MARGIN_PX
        corners = torch.randint(CROP_FREEDOM_PX + 1, (self.batch, 2), generator=g).tolist()
        crops = [
            (slice(i, i + 1), slice(None), slice(y, y + size), slice(x, x + size))
            for i, (y, x) in enumerate(corners)
        ]
        photos = photographed(g, star)
        seen = local_contrast(photos)
        views = torch.cat([seen[c] for c in crops])
        inner = slice(MARGIN_PX, -MARGIN_PX)
        disparity = torch.cat([truth[c] for c in crops])[..., inner, inner]
        middle = star_offsets(self.views).index((0, 0))
        weight = textured(torch.cat([photos[c] for c in crops])[:, middle : middle + 1])
        symmetry = SYMMETRIES[int(torch.randint(len(SYMMETRIES), (), generator=g))]
        stacks = symmetry.apply_to_stacks(stack_star(views, self.views))
        return Batch(stacks, symmetry.apply(disparity), symmetry.apply(weight))

    def _generator(self, k: int) -> Generator:
        return Generator().manual_seed((self.seed - 1) * SEEDS_PER_RUN + k)

    def _rendered(self, pool: int, bounds: tuple[float, float]) -> tuple[Tensor, Tensor]:
        if self._pool is None or self._pool[0] != pool:
            g = self._generator(2 * pool)
            side = self.patch + 2 * MARGIN_PX + CROP_FREEDOM_PX
            scenes = draw_scenes(g, self.batch, (side, side), bounds)
            self._pool = (pool, *render_star(scenes, self.views))
        return self._pool[1], self._pool[2]


def render_star(scenes: LayerScenes, views: int) -> tuple[Tensor, Tensor]:
    """Gray star views (B, 4N-3, H, W) and centre disparity (B, 1, H, W)."""
    offsets = star_offsets(views)
    rendered, disparity = scenes.render(offsets)
    centre = offsets.index((0, 0))
    return rendered[:, :, 0], disparity[:, centre : centre + 1].clone()


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


def photographed(g: Generator, star: Tensor) -> Tensor:
    """Exposure, gamma, differences between views, noise and 8-bit rounding of (B, P, H, W)."""
    b, p = star.shape[:2]

    def rand(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=g)

    gain = torch.exp(rand(-0.6, 0.4, b, 1, 1, 1))
    gamma = rand(0.8, 1.2, b, 1, 1, 1)
    unevenness = 0.02 * torch.rand(b, 1, 1, 1, generator=g) ** 4
    view_gain = 1 + unevenness * torch.randn(b, p, 1, 1, generator=g)
    noise = 0.012 * torch.rand(b, 1, 1, 1, generator=g) ** 6
    exposed = (star * gain).clamp(0, 1) ** gamma * view_gain
    noisy = exposed + noise * torch.randn(star.shape, generator=g)
    return torch.round(noisy.clamp(0, 1) * 255) / 255
