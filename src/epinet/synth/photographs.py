"""Crops of the user's own photographs, as textures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
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
    import cv2

    pixels = read_image(file)
    if pixels.dtype == np.uint16:
        pixels = (pixels / 257).round().astype(np.uint8)
    height, width = pixels.shape[:2]
    if min(height, width) < 2:
        raise InputError(f"{file}: too small")
    shrink = longest_px / max(height, width)
    if shrink < 1:
        size = max(1, round(width * shrink)), max(1, round(height * shrink))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    image = torch.from_numpy(np.array(pixels))
    image = image.reshape(*image.shape[:2], -1).permute(2, 0, 1)
    return image.expand(3, -1, -1).contiguous()
