"""Plane sweep over the star of views: which disparity explains each centre pixel best.

Coarse on purpose: it tells the order of the views and the range of disparities on images scaled
down to working pixels, and is no rival to the network. Disparities here are in working pixels
per adjacent view; `Star.scale` leads back to view pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from epinet.angular import DIRECTIONS_DEG, direction_positions, star_positions
from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.shifts import Margined, sampled
from epinet.squares import box_mean

LONGER_SIDE_PX = 256
"""Longer side of the working images, unless told otherwise."""
SEARCH_PX = 32.0
"""Largest |disparity| looked for, in view pixels per adjacent view."""
REACH_PX = 16.0
"""Views farther out are left aside where they would move by more, in working pixels."""
WINDOW = 5
"""Costs are means over WINDOW x WINDOW working pixels, unless told otherwise."""
TRUNCATION = 0.1
"""Differences of intensity count as at most this, so that hidden pixels cost a bounded sum."""
MIN_CONTRAST = 0.005
"""Standard deviation of intensity within a window, below which it has no texture."""
ROUGH_STEP_PX, FINE_STEP_PX = 0.5, 0.25
"""How far the outermost views move from plane to plane."""
SLACK_PX = 1.0
"""A fine sweep looks this much beyond the rough range."""
TAIL = 0.005
"""Share of the pixels left out at each end of a range."""
MIN_DISTINCTION = 1.6
"""Cost of a chance plane over that of the best one: 1.25 is measured for noise alone, 2.5 and
more for faint texture under as much noise."""
MIN_PIXELS = 50
"""Fewer usable working pixels than this tell nothing."""

TEXTURE_PX, MIN_TEXTURE, MIN_TEXTURED = 5, 0.01, 0.05
"""Means over squares of so many pixels must still vary by so much, in this share of the picture, to
be texture: mere noise of up to 12 gray levels varies less."""

Offset = tuple[int, int]
"""(rows, columns) from the centre view to another."""


def largest_searched_px(shorter_side_px: float, search_px: float = SEARCH_PX) -> float:
    """Largest |disparity| looked for in views of this size: a small one shows less."""
    return min(search_px, shorter_side_px / 3)


@dataclass(frozen=True)
class Star:
    """The star views in gray, in working pixels."""

    centre: Tensor
    """(H, W) intensity, 0..1."""
    views: Tensor
    """(N, H, W) the other views."""
    offsets: tuple[Offset, ...]
    """Where each view stands."""
    scale: float
    """Working pixels per view pixel, at most 1."""
    search_px: float = SEARCH_PX
    """Largest |disparity| to look for, in view pixels, where the views are large enough."""

    @property
    def radius(self) -> int:
        """Offset of the outermost views."""
        return max(_ring(offset) for offset in self.offsets)

    @property
    def search(self) -> float:
        """Largest |disparity| to look for, in working pixels."""
        shorter_px = min(self.centre.shape) / self.scale
        return self.scale * largest_searched_px(shorter_px, self.search_px)

    @property
    def can_widen(self) -> bool:
        """Whether views of this size can tell larger disparities, and the centre view any."""
        return self.search_px < min(self.centre.shape) / self.scale / 3 and self.has_texture

    def widened(self) -> Star:
        """The same views, in which twice as large disparities are looked for."""
        return replace(self, search_px=2 * self.search_px)

    @property
    def textured(self) -> Tensor:
        """(H, W) bool: where the centre view shows more than noise."""
        return torch.gt(_contrast(box_mean(self.centre[None], TEXTURE_PX)[0]), MIN_TEXTURE**2)

    @property
    def has_texture(self) -> bool:
        """Whether the centre view shows more than noise."""
        return float(self.textured.float().mean()) > MIN_TEXTURED

    def shrunk_map(self, disparity: NDArray[np.float32]) -> Tensor:
        """A map (H, W) of the centre view, in working pixels and at their places."""
        whole = torch.from_numpy(np.ascontiguousarray(disparity))[None, None]
        size = self.centre.shape
        return self.scale * functional.interpolate(whole, size, mode="nearest-exact")[0, 0]

    def differences(self, disparity: Tensor, moves: Sequence[tuple[float, float]]) -> Tensor:
        """(N, H, W) truncated differences of the views, warped by a map, to the centre view.

        Args:
            disparity: (H, W) in working pixels.
            moves: of each view, (rows, columns) by which the map is multiplied.
        """
        seen = sampled(self.views[None], disparity[None, None], moves)[0]
        return (seen - self.centre).abs_().clamp_(max=TRUNCATION)

    def exposed_alike(self) -> Star:
        """Each view brought to the mean brightness of the centre view."""
        gain = self.centre.mean() / self.views.mean((1, 2), keepdim=True).clamp_min(1e-6)
        return replace(self, views=self.views * gain)

    def rings(self, disparity: float) -> Star:
        """The views of two rings, as far out as a disparity of this size stays within reach."""
        reach = min(REACH_PX, min(self.centre.shape) / 4)
        inmost = min(_ring(offset) for offset in self.offsets)
        outer = max(inmost, min(self.radius, int(reach / max(disparity, 1e-3))))
        kept = [i for i, o in enumerate(self.offsets) if _ring(o) in (outer, (outer + 1) // 2)]
        return replace(self, views=self.views[kept], offsets=tuple(self.offsets[i] for i in kept))

    def rearranged(self, arrange: Callable[[Offset], Offset]) -> Star:
        """The same images with the views standing elsewhere."""
        return replace(self, offsets=tuple(arrange(offset) for offset in self.offsets))


@dataclass(frozen=True)
class Match:
    """The best plane for each centre pixel."""

    cost: Tensor
    """(H, W) mean truncated difference of intensity in the window."""
    disparity: Tensor
    """(H, W) working pixels per adjacent view."""
    usable: Tensor
    """(H, W) bool: textured, and within all views at its disparity."""
    chance_cost: Tensor
    """(H, W) mean cost over all planes: what a wrong plane leaves."""
    search: float = 0.0
    """Largest |disparity| that was looked for, in working pixels."""

    @property
    def has_pixels(self) -> bool:
        """Whether there are enough usable pixels to say anything."""
        return int(self.usable.sum()) >= MIN_PIXELS

    @property
    def is_distinct(self) -> bool:
        """Whether the best planes fit clearly better than chance, as they do not for mere noise.

        Meant for a wide sweep: in a narrow one all planes may fit.
        """
        if not self.has_pixels:
            return False
        return float(self.chance_cost[self.usable].mean()) > MIN_DISTINCTION * self.residual

    @property
    def explained(self) -> Tensor:
        """(H, W) bool: where the best plane fits clearly better than chance; of a wide sweep."""
        return torch.gt(self.chance_cost, MIN_DISTINCTION * self.cost)

    @property
    def typical_cost(self) -> float:
        """Median cost of the usable pixels: about the noise of the views."""
        return float(self.cost[self.usable].median())

    @property
    def residual(self) -> float:
        """Mean cost of the usable pixels; infinite if they are too few."""
        return float(self.cost[self.usable].mean()) if self.has_pixels else float("inf")

    def disparity_percentiles(self, tail: float) -> tuple[float, float]:
        """Range of the disparities of well explained pixels, leaving out a share at each end."""
        good = self.usable & (self.cost <= 4 * self.typical_cost)
        values = np.percentile(self.disparity[good].numpy(), [100 * tail, 100 * (1 - tail)])
        return float(values[0]), float(values[1])


def load_star(lf: LightField, longer_side_px: int = LONGER_SIDE_PX) -> Star:
    """The star views of the largest central odd grid, exposed alike; absent ones are left out.

    Raises:
        InputError: the grid is smaller than 3x3, or lacks the centre or all other star views.
    """
    side = min(lf.grid) - 1 + min(lf.grid) % 2
    if side < 3:
        raise InputError(f"{lf.source or 'light field'}: at least 3x3 views are needed")
    grid, middle = lf.central(side).brightened(), side // 2
    positions = [p for p in star_positions(side) if grid.present[p] and p != (middle, middle)]
    if not positions or not grid.present[middle, middle]:
        which = "the centre view is" if positions else "all views around the centre are"
        raise InputError(f"{lf.source or 'light field'}: {which} {lf.absence}")
    scale = min(1.0, longer_side_px / max(lf.size))
    centre = working_image(grid.gray(middle, middle), scale)
    views = torch.stack([working_image(grid.gray(*p), scale) for p in positions])
    offsets = tuple((row - middle, col - middle) for row, col in positions)
    return Star(centre, views, offsets, scale).exposed_alike()


def star_of_stacks(stacks: Tensor, longer_side_px: int = LONGER_SIDE_PX) -> Star:
    """The star of a network's input (4, N, H, W): its views as they are, in the order of stacks."""
    views, middle = stacks.shape[1], stacks.shape[1] // 2
    scale = min(1.0, longer_side_px / max(stacks.shape[-2:]))
    images = torch.unflatten(working_images(stacks.flatten(0, 1), scale), 0, (4, views))
    others = [k for k in range(views) if k != middle]
    offsets = tuple(
        (row - middle, col - middle)
        for direction in DIRECTIONS_DEG
        for row, col in direction_positions(direction, views)
        if (row, col) != (middle, middle)
    )
    return Star(images[0, middle], images[:, others].flatten(0, 1), offsets, scale)


def sweep(
    star: Star,
    low: float,
    high: float,
    step_px: float,
    window: int = WINDOW,
    occlusions: bool = False,
) -> Match:
    """Try planes from `low` to `high`, the outermost views moving by `step_px` between two.

    occlusions: judge a pixel by the best half of the views (left, right, upper or lower), since
        what hides it from one side leaves it visible from the other.
    """
    groups = _halves(star.offsets) if occlusions else [slice(None)]
    planes = max(2, int(np.ceil((high - low) * star.radius / step_px)) + 1)
    reach_px = max(abs(low), abs(high))
    views = [
        Margined(view[None], reach_px * _ring(offset))
        for view, offset in zip(star.views, star.offsets, strict=True)
    ]
    cost = torch.full_like(star.centre, torch.inf)
    disparity, total = torch.zeros_like(cost), torch.zeros_like(cost)
    for d in np.linspace(low, high, planes):
        moved = torch.cat(
            [
                view.shifted(-float(d) * row, -float(d) * col)
                for view, (row, col) in zip(views, star.offsets, strict=True)
            ]
        )
        moved.sub_(star.centre).abs_().clamp_(max=TRUNCATION)
        tried = box_mean(torch.stack([moved[group].mean(0) for group in groups]), window).amin(0)
        disparity.masked_fill_(tried < cost, float(d))
        cost = torch.minimum(cost, tried)
        total += tried
    inside = _edge_distance(cost) >= disparity.abs() * star.radius + window // 2
    return Match(cost, disparity, inside & _textured(star.centre), total / planes)


def match_of_map(star: Star, disparity: Tensor, window: int = WINDOW) -> Match:
    """A match whose disparities (H, W), in working pixels, are known; its chance costs are 0."""
    difference = star.differences(disparity, star.offsets)
    halves = torch.stack([difference[side].mean(0) for side in _halves(star.offsets)])
    cost = box_mean(halves, window).amin(0)
    inside = _edge_distance(cost) >= disparity.abs() * star.radius + window // 2
    return Match(cost, disparity, inside & _textured(star.centre), torch.zeros_like(cost))


def rough_match(star: Star) -> Match:
    """A sweep over all that is searched, with views near the centre."""
    return sweep(star.rings(star.search), -star.search, star.search, ROUGH_STEP_PX)


def rough_range(star: Star, match: Match) -> tuple[float, float]:
    """Where a finer sweep should look, in working pixels, from a rough match.

    Pixels that no plane explains, as in a mirror, match best wherever chance has it.
    """
    distinct = replace(match, usable=match.usable & match.explained)
    if distinct.has_pixels:
        match = distinct
    low, high = match.disparity_percentiles(TAIL)
    return max(-star.search, low - SLACK_PX), min(star.search, high + SLACK_PX)


def distinct_match(star: Star) -> tuple[Star, Match] | None:
    """A rough match of the star within its search or, where nothing matches, a wider one; and the
    star that looks so far. None without texture, or where no search finds a match."""
    rough = rough_match(star)
    while not rough.is_distinct:
        if not star.can_widen:
            return None
        star = star.widened()
        rough = rough_match(star)
    return star, rough


def fine_match(star: Star, step_px: float = FINE_STEP_PX) -> Match | None:
    """A sweep over the disparities that a rough one finds; None where none does.

    Disparities are good to about 0.3 view pixels.
    """
    found = distinct_match(star)
    return None if found is None else refined_match(*found, step_px)


def refined_match(star: Star, rough: Match, step_px: float) -> Match | None:
    """A sweep over the disparities of a rough match; None where too few pixels are usable."""
    low, high = rough_range(star, rough)
    match = sweep(star.rings(max(abs(low), abs(high))), low, high, step_px)
    return replace(match, search=star.search) if match.has_pixels else None


def _ring(offset: Offset) -> int:
    return max(abs(offset[0]), abs(offset[1]))


def _halves(offsets: tuple[Offset, ...]) -> list[list[int]]:
    sides = [
        [i for i, offset in enumerate(offsets) if sign * offset[axis] > 0]
        for axis in (0, 1)
        for sign in (-1, 1)
    ]
    return [side for side in sides if side]


def working_image(gray: NDArray[np.float32], scale: float) -> Tensor:
    """(H, W) as `working_images`."""
    return working_images(torch.from_numpy(np.ascontiguousarray(gray))[None], scale)[0]


def working_images(images: Tensor, scale: float) -> Tensor:
    """Scale (N, H, W) down and blur a little: interpolation between pixels needs smooth images."""
    if scale < 1:
        size = [max(1, round(scale * side)) for side in images.shape[-2:]]
        images = functional.interpolate(images[None], size, mode="bilinear", antialias=True)[0]
    padded = functional.pad(images, (1, 1, 1, 1), mode="replicate")
    rows = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    return (rows[..., :-2] + 2 * rows[..., 1:-1] + rows[..., 2:]) / 16


def _edge_distance(image: Tensor) -> Tensor:
    """(H, W) pixels to the nearest side of the image; 0 on its border."""
    rows, cols = (torch.arange(side) for side in image.shape)
    return torch.minimum(
        torch.minimum(rows, rows.flip(0))[:, None], torch.minimum(cols, cols.flip(0))[None, :]
    )


def _textured(image: Tensor) -> Tensor:
    return torch.gt(_contrast(image), MIN_CONTRAST**2)


def _contrast(image: Tensor) -> Tensor:
    """(H, W) variance of intensity within a window."""
    mean, mean_square = box_mean(torch.stack([image, image**2]), WINDOW)
    variance: Tensor = mean_square - mean**2
    return variance
