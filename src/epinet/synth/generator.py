"""Scenes by number: scene k of a seed is the same on any machine and device."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.angular import CENTRAL_NINE, star_positions
from epinet.camera import Camera
from epinet.lightfield import LightField
from epinet.synth.bank import Bank, draw_bank
from epinet.synth.draw import draw_scenes
from epinet.synth.faults import blurred, draw_lens_radius, draw_misalignment, photographed
from epinet.synth.options import Options
from epinet.synth.photographs import Photographs
from epinet.synth.render import Lens, Offsets, render, truth, visible
from epinet.synth.scenes import Scenes

VERSION = "rays-8"
"""Stored with every weight trained on these scenes; changes when they change."""

SCENES_PER_BANK = 16
"""So many scenes in turn share a stock of textures and silhouettes; of training, so many pools."""

STEP_PX = 0.05
"""Neighbours that belong to different surfaces at least so far apart make a discontinuity."""

NEAR_EDGE_PX = 2
"""Pixels up to this far from a discontinuity belong to it, and to no plane or smooth surface."""

MIRROR_SHARE = 0.3
"""From this share of a second scene on, a pixel's truth is of no use to matching: invalid."""


def generator(*numbers: int) -> Generator:
    """A CPU generator for each tuple of numbers (torch's heeds 32 bits of a seed)."""
    digest = hashlib.sha256(repr(numbers).encode()).digest()
    return Generator().manual_seed(int.from_bytes(digest[:4], "little"))


@lru_cache(maxsize=2)
def _photographs(folder: Path) -> Photographs:
    return Photographs.from_folder(folder)


def bank(
    options: Options, seed: int, block: int, textures: Path | None = None, device: str = "cpu"
) -> Bank:
    """The tiles of a block of scenes; photographs from the folder `textures` among them."""
    return _bank(options.held_out, options.contrast, seed, block, textures, device)


@lru_cache(maxsize=4)  # a recipe may mix contrasts
def _bank(
    held_out: bool,
    contrast: tuple[float, float],
    seed: int,
    block: int,
    textures: Path | None,
    device: str,
) -> Bank:
    photographs = None if textures is None else _photographs(textures)
    g = generator(seed, 0, block)
    return draw_bank(g, photographs, held_out=held_out, contrast=contrast, device=device)


@dataclass(frozen=True)
class Pool:
    """Rendered scenes for training: clean but for the lens, with their truth."""

    views: Tensor
    """(B, P, C, H, W) in 0..1, of the star or of the offsets asked for."""
    disparity: Tensor
    """(B, T, H, W) of the centre view or of the views asked for, px per adjacent view."""
    valid: Tensor
    """(B, T, H, W) bool: no mirror and no glass."""


def pools(
    options: Options,
    seed: int,
    count: int,
    first: int = 0,
    *,
    offsets: Offsets | None = None,
    truths: Offsets = ((0, 0),),
    gray: bool = True,
    textures: Path | None = None,
    device: str = "cpu",
) -> Iterator[Pool]:
    """Endless pools of `count` scenes, from pool number `first` on; nothing touches the disk.

    Args:
        offsets: (row, col) from the centre view of the views to render; default: the star's.
        truths: the same of the views whose truth is wanted.

    Example:
        >>> pool = next(pools(Options(size=(24, 24), samples=1), seed=1, count=2))
        >>> pool.views.shape, pool.disparity.shape
        (torch.Size([2, 33, 1, 24, 24]), torch.Size([2, 1, 24, 24]))
    """
    offsets = star_offsets(options.views) if offsets is None else offsets
    k = first
    while True:
        tiles = bank(options, seed, k // SCENES_PER_BANK, textures, device)
        g = generator(seed, 2, k)
        scenes = draw_scenes(g, count, options, tiles.gray() if gray else tiles)
        views = _through_lens(g, scenes, offsets, options)
        disparity, surface = truth(scenes, truths)
        yield Pool(views, disparity, ~mirrors(scenes, surface))
        k += 1


def _through_lens(g: Generator, scenes: Scenes, offsets: Offsets, options: Options) -> Tensor:
    radius = draw_lens_radius(g, scenes.count, options.faults)
    shift_px = draw_misalignment(g, scenes.count, len(offsets), options.faults)
    views = render(scenes, offsets, Lens(options.samples, radius, shift_px))
    return blurred(g, views, options.faults)


def star_offsets(views: int) -> list[tuple[int, int]]:
    """(row, col) of the star's views counted from the centre view."""
    return [(r - views // 2, c - views // 2) for r, c in star_positions(views)]


def draw_scene(
    options: Options,
    seed: int,
    index: int,
    device: str = "cpu",
    textures: Path | None = None,
) -> tuple[Scenes, Generator]:
    """Scene number `index` by itself, and the generator to draw its camera's faults from."""
    tiles = bank(options, seed, index // SCENES_PER_BANK, textures, device)
    g = generator(seed, 1, index)
    return draw_scenes(g, 1, options, tiles), g


def render_scene(
    options: Options,
    seed: int,
    index: int,
    device: str = "cpu",
    *,
    star_only: bool = False,
    truths: bool = False,
    textures: Path | None = None,
) -> LightField:
    """Scene number `index` of a seed as a light field, as if read from disk.

    Args:
        device: where to render.
        star_only: only the views that the network sees; the others are zeros and not `present`.
        truths: with the truth of the eight views around the centre, as view shift needs it.
        textures: a folder of photographs to use among the textures.

    Returns:
        uint8 RGB views, truth, camera, and the masks valid, invalid (mirrors and glass),
        discontinuities, planes, smooth_surfaces and occluded (in any of the views), objects.

    Raises:
        InputError: no readable image in `textures`.
    """
    scenes, g = draw_scene(options, seed, index, device, textures)
    n = options.views
    positions = star_positions(n) if star_only else [(r, c) for r in range(n) for c in range(n)]
    offsets = [(r - n // 2, c - n // 2) for r, c in positions]
    clean = _through_lens(g, scenes, offsets, options)
    photos = photographed(g, clean, replace(options.faults, quantise=False)).views
    disparity, surface = truth(scenes)
    around = [o for o in CENTRAL_NINE if truths and o != (0, 0)]
    others = truth(scenes, around)[0][0].cpu().numpy() if around else ()
    views = np.zeros((n, n, *options.size, 3), np.uint8)
    present = np.zeros((n, n), bool)
    pixels = torch.round(255 * photos[0]).to(torch.uint8).permute(0, 2, 3, 1).cpu().numpy()
    for position, picture in zip(positions, pixels, strict=True):
        views[position], present[position] = picture, True
    return LightField(
        views,
        present,
        camera=_camera(scenes, disparity),
        truth=disparity[0, 0].cpu().numpy(),
        view_truths={(n // 2 + r, n // 2 + c): t for (r, c), t in zip(around, others, strict=True)},
        masks=_masks(scenes, offsets, disparity, surface),
        objects=_objects(scenes, surface),
        layout="rendered",
    )


def _camera(scenes: Scenes, disparity: Tensor) -> Camera:
    """The scene's camera at a scale of 10 mm between views and a lens of 50 mm."""
    height, width = scenes.size
    focal_mm, baseline_mm = 50.0, 10.0
    return Camera(
        focal_length_mm=focal_mm,
        sensor_size_mm=focal_mm * max(height, width) / float(scenes.light.focal_px[0]),
        baseline_mm=baseline_mm,
        focus_distance_mm=baseline_mm * float(scenes.light.depth_px[0]),
        width_px=width,
        height_px=height,
        disparity_min_px=float(disparity.min()),
        disparity_max_px=float(disparity.max()),
    )


def _masks(
    scenes: Scenes, offsets: Offsets, disparity: Tensor, surface: Tensor
) -> dict[str, NDArray[np.bool_]]:
    steps = _grown(discontinuities(disparity, surface), NEAR_EDGE_PX)
    borders = _grown(_differs(surface), NEAR_EDGE_PX)
    first, reliefs_end = scenes.first_ids[1], scenes.first_ids[3]
    smooth = (surface >= first) & (surface < reliefs_end)
    mirror = mirrors(scenes, surface)
    hidden = ~visible(scenes, offsets, disparity).all(1, keepdim=True)
    masks = {
        "valid": ~mirror,
        "invalid": mirror,
        "discontinuities": steps,
        "planes": ~smooth & ~borders,
        "smooth_surfaces": smooth & ~borders,
        "occluded": hidden,
    }
    return {name: mask[0, 0].cpu().numpy() for name, mask in masks.items()}


def _objects(scenes: Scenes, surface: Tensor) -> NDArray[np.uint16]:
    """Surfaces by number, the six sides of a box as one."""
    ids = surface[0, 0].cpu().numpy().astype(np.uint16)
    box = scenes.first_ids[3]
    return np.where(ids < box, ids, box + (ids - box) // 6).astype(np.uint16)


def mirrors(scenes: Scenes, surface: Tensor) -> Tensor:
    """Where (B, P, H, W) a surface mirrors, or lets through, much of a second scene."""
    share = scenes.materials.mirror[..., 0]
    seen = share.gather(1, surface.flatten(1).to(torch.int64)).view(surface.shape)
    return seen > MIRROR_SHARE


def discontinuities(disparity: Tensor, surface: Tensor) -> Tensor:
    """(B, 1, H, W): pixels with a neighbour of another surface at least `STEP_PX` away."""
    found = torch.zeros_like(disparity, dtype=torch.bool)
    for axis in (-1, -2):
        far = (disparity.diff(dim=axis).abs() > STEP_PX) & (surface.diff(dim=axis) != 0)
        length = far.shape[axis]
        found.narrow(axis, 0, length).logical_or_(far)
        found.narrow(axis, 1, length).logical_or_(far)
    return found


def _differs(surface: Tensor) -> Tensor:
    return discontinuities(surface.float(), surface)


def _grown(mask: Tensor, by_px: int) -> Tensor:
    return F.max_pool2d(mask.float(), 2 * by_px + 1, stride=1, padding=by_px) > 0
