"""The stock of textures and silhouettes that many scenes draw on."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Generator, Tensor
from torch.nn import functional as F

from epinet.lightfield import LUMA
from epinet.synth.silhouettes import draw_silhouettes
from epinet.synth.textures import Photographs, draw_textures

TEXTURE_SIDE = 256
SILHOUETTE_SIDE = 512
SHADE_SIDE = 128
TEXTURES, FLAT_TEXTURES = 88, 8
SILHOUETTES = {(False, False): 28, (True, False): 20, (False, True): 14, (True, True): 14}
"""How many of each kind (thin, repeating)."""


@dataclass(frozen=True)
class Bank:
    """Square tiles that wrap around, their sides powers of 2."""

    textures: Tensor
    """(T, S, S, C) colours in 0..1; the last `FLAT_TEXTURES` of a single tone each."""
    silhouettes: Tensor
    """(M, S, S) uint8 alpha; 0 is opaque everywhere, then the kinds of `SILHOUETTES` in turn."""
    shades: Tensor
    """(K, S, S, 1) blurred silhouettes: what stands between a light and the scene."""

    def to(self, device: torch.device) -> Bank:
        """On another device."""
        return Bank(self.textures.to(device), self.silhouettes.to(device), self.shades.to(device))

    def gray(self) -> Bank:
        """With luma in place of colours."""
        luma = self.textures @ torch.from_numpy(LUMA).to(self.textures.device)
        return Bank(luma[..., None], self.silhouettes, self.shades)


def first_silhouette(thin: bool, repeating: bool) -> int:
    """Index of the first silhouette of a kind."""
    kinds = list(SILHOUETTES)
    return 1 + sum(SILHOUETTES[kind] for kind in kinds[: kinds.index((thin, repeating))])


def draw_bank(
    g: Generator,
    photographs: Photographs | None = None,
    *,
    held_out: bool = False,
    contrast: tuple[float, float] = (0.0, 1.0),
    device: torch.device | str = "cpu",
) -> Bank:
    """Draw the tiles of a stock; see `Options` for what the arguments mean."""
    textured = draw_textures(
        g,
        TEXTURES,
        TEXTURE_SIDE,
        held_out=held_out,
        contrast=contrast,
        photographs=photographs,
        device=device,
    )
    flat = draw_textures(
        g,
        FLAT_TEXTURES,
        TEXTURE_SIDE,
        held_out=held_out,
        contrast=(0.0, 0.0),
        device=device,
    )
    kinds = [
        draw_silhouettes(
            g,
            count,
            SILHOUETTE_SIDE,
            thin=thin,
            repeating=repeating,
            held_out=held_out,
            device=device,
        )
        for (thin, repeating), count in SILHOUETTES.items()
    ]
    opaque = torch.full_like(kinds[0][:1], 255)
    repeating = torch.cat([kinds[2], kinds[3]]).float()[:, None] / 255
    shades = F.avg_pool2d(repeating, SILHOUETTE_SIDE // SHADE_SIDE)
    softness = torch.linspace(0.5, 6, len(shades)).tolist()
    soft = [_blurred(s[None], sigma) for s, sigma in zip(shades, softness, strict=True)]
    return Bank(
        torch.cat([textured, flat]).permute(0, 2, 3, 1).contiguous(),
        torch.cat([opaque, *kinds]),
        torch.cat(soft).permute(0, 2, 3, 1).contiguous(),
    )


def _blurred(tile: Tensor, sigma: float) -> Tensor:
    """Gaussian blur of a tile (1, 1, S, S) that wraps around."""
    reach = round(2.5 * sigma) + 1
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1, device=tile.device) / sigma) ** 2)
    kernel = kernel / kernel.sum()
    tile = F.pad(tile, (reach,) * 4, mode="circular")
    return F.conv2d(F.conv2d(tile, kernel.view(1, 1, 1, -1)), kernel.view(1, 1, -1, 1))


def sample(tiles: Tensor, tile: Tensor | int, u: Tensor, v: Tensor) -> Tensor:
    """Bilinear lookup in tiles (T, S, S, C) at column u and row v, which wrap around: (..., C)."""
    side, channels = tiles.shape[2], tiles.shape[3]
    column, row = u.floor(), v.floor()
    right, below = (u - column)[..., None], (v - row)[..., None]
    i0, j0 = column.to(torch.int64) & (side - 1), row.to(torch.int64) & (side - 1)
    i1, j1 = (i0 + 1) & (side - 1), ((j0 + 1) & (side - 1)) * side
    base = tile * (side * side)
    top, bottom = base + j0 * side, base + j1
    flat = tiles.view(-1, channels)

    def take(index: Tensor) -> Tensor:
        return flat.index_select(0, index.reshape(-1)).view(*index.shape, channels)

    upper = torch.lerp(take(top + i0), take(top + i1), right)
    lower = torch.lerp(take(bottom + i0), take(bottom + i1), right)
    return torch.lerp(upper, lower, below)
