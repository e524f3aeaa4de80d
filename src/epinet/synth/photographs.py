"""Crops of the user's own photographs, as textures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from epinet.errors import InputError
from epinet.io.images import IMAGE_SUFFIXES, read_image
from epinet.synth.dice import Dice


@dataclass(frozen=True)
class Photographs:
    """Pictures that random crops are taken from.

    They are kept in memory, no longer than `LONGEST_PX` and no more than `MOST`.
    """

    LONGEST_PX = 1024
    MOST = 256

    pictures: tuple[Tensor, ...] = field(repr=False)
    """(3, H, W) uint8 each, RGB."""
    skipped: int = 0
    """Files that have the name of an image and could not be read."""

    @classmethod
    def from_folder(cls, path: str | Path) -> Photographs:
        """Read the images of a folder and of all folders in it; of very many, some of each part.

        Raises:
            InputError: the folder is missing or holds no image that can be read.
        """
        folder = Path(path)
        if not folder.is_dir():
            raise InputError(f"{folder}: not a folder; give one that holds photographs")
        files = sorted(
            f
            for f in folder.rglob("*")
            if f.suffix.lower() in IMAGE_SUFFIXES and not f.name.startswith(".") and f.is_file()
        )
        step = max(1, math.ceil(len(files) / cls.MOST))
        spread = [f for k in range(step) for f in files[k::step]]
        pictures: list[Tensor] = []
        skipped = 0
        for file in spread:
            if len(pictures) == cls.MOST:
                break
            try:
                pictures.append(_read_reduced(file, cls.LONGEST_PX))
            except InputError:
                skipped += 1
        if not pictures:
            found = f"the {skipped} found could not be read" if skipped else "none was found"
            raise InputError(
                f"{folder}: holds no readable image ({found}); "
                f"put photographs there ({', '.join(sorted(IMAGE_SUFFIXES))})"
            )
        return cls(tuple(pictures), skipped)

    def draw(self, dice: Dice, n: int, side: int) -> Tensor:
        """(n, 3, side, side) float32 random crops in 0..1, turned and mirrored at random.

        A texel covers at least one pixel of the picture, so that no blur arises; only pictures
        smaller than the tile are enlarged.
        """
        out = torch.empty(n, 3, side, side, device=dice.device)
        for k in range(n):
            which, quarter, mirror = torch.randint(1 << 30, (3,), generator=dice.g).tolist()
            picture = self.pictures[which % len(self.pictures)]
            height, width = picture.shape[1:]
            scale, down, right = torch.rand(3, generator=dice.g).tolist()
            widest = max(1.0, min(height, width) / side)
            crop = min(round(side * widest**scale), height, width)
            top, left = round(down * (height - crop)), round(right * (width - crop))
            piece = picture[:, top : top + crop, left : left + crop].to(dice.device).float() / 255
            if crop != side:
                piece = F.interpolate(
                    piece[None], (side, side), mode="bilinear", antialias=True, align_corners=False
                )[0]
            piece = torch.rot90(piece, quarter % 4, (1, 2))
            out[k] = piece.flip(2) if mirror % 2 else piece
        return out.clamp(0, 1)


def _read_reduced(file: Path, longest_px: int) -> Tensor:
    pixels = read_image(file)
    if pixels.dtype == np.uint16:
        pixels = (pixels / 257).round().astype(np.uint8)
    height, width = pixels.shape[:2]
    if min(height, width) < 2:
        raise InputError(f"{file}: too small")
    shrink = longest_px / max(height, width)
    if shrink < 1:
        means = pixels.astype(np.float32)
        for axis, side in enumerate((height, width)):
            means = _area_means(means, axis, max(1, round(side * shrink)))
        pixels = means.round().astype(np.uint8)
    image = torch.from_numpy(np.array(pixels)).permute(2, 0, 1)
    return image.expand(3, -1, -1).contiguous()


def _area_means(image: NDArray[np.float32], axis: int, count: int) -> NDArray[np.float32]:
    """An image cut into equal parts along an axis, and the mean of each, by the areas of its pixels
    in it.

    Example:
        >>> _area_means(np.array([0, 3, 9], np.float32), 0, 2).tolist()
        [1.0, 7.0]
    """
    values = np.moveaxis(image, axis, 0).astype(np.float64)
    edges = np.linspace(0, len(values), count + 1)
    whole = np.minimum(edges.astype(int), len(values) - 1)
    rest = (edges - whole).reshape(-1, *[1] * (values.ndim - 1))
    sums = np.concatenate([np.zeros_like(values[:1]), values.cumsum(0)])
    means = np.diff(sums[whole] + rest * values[whole], axis=0) * (count / len(values))
    return np.asarray(np.moveaxis(means, 0, axis), np.float32)
