"""Surfaces in disparity space, and where the rays of any view meet them.

A point of a scene is (X, Y, d): where the centre view sees it, in px from the image centre, and
its disparity. The view offset by (du, dv) = (col - c, row - c) sees it at

    x = X - d du,   y = Y - d dv,

so the ray of a pixel is the straight line (x + d du, y + d dv, d): perspective turned into a
parallel geometry. Depth Z obeys d = p / Z + q (see camera.py), a projective map, under which planes
stay planes and quadrics quadrics; what has the larger d is nearer. Each class holds up to O
surfaces of B scenes in tensors (B, O, ...), and `hit(k, rays)` gives the nearest hit with
surface k of every scene, in closed form (reliefs: to convergence).

Affine functions of (x, y) cost one operation per pixel, the rest of their work one per row,
column or view: `Rays.affine`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, fields
from typing import Any, Self, cast

import torch
from torch import Tensor

TINY = 1e-6
ON_CPU = ("exists", "bounds", "cut")


@dataclass(frozen=True)
class Rays:
    """Rays of P views; anything that broadcasts to (B, P, H, W)."""

    x: Tensor
    """px from the image centre, e.g. (1, 1, 1, W) for a grid of pixels."""
    y: Tensor
    du: Tensor
    """Offset of the view in columns, (B or 1, P, 1, 1); not an integer in a lens's rim."""
    dv: Tensor
    reach: float | None = None
    """Of a grid of pixels in full, the largest |du| or |dv|; else None."""

    def affine(self, at_0: Tensor, per_x: Tensor, per_y: Tensor) -> Tensor:
        """at_0 + per_x x + per_y y."""
        return (at_0 + per_x * self.x) + per_y * self.y

    def at(self, d: Tensor) -> tuple[Tensor, Tensor]:
        """(X, Y) of the rays at disparity d."""
        return torch.addcmul(self.x, d, self.du), torch.addcmul(self.y, d, self.dv)

    def window(self, rows: slice, columns: slice) -> Rays:
        """The rays of a part of a grid of pixels."""
        return Rays(self.x[..., columns], self.y[..., rows, :], self.du, self.dv)


def spread(t: Tensor) -> Tensor:
    """(B,) as (B, 1, 1, 1)."""
    return t[:, None, None, None]


class Group:
    """Surfaces of one kind; a frozen dataclass of tensors (B, O, ...)."""

    exists: Tensor
    """(B, O) bool, on the CPU: scenes have different numbers of surfaces."""
    bounds: Tensor
    """(B, O, 5), on the CPU: least and largest X and Y, largest |d|; infinite where endless."""

    def scenes(self, index: slice) -> Self:
        """The surfaces of some of the scenes."""
        return self._map(lambda t: t[index])

    def to(self, device: torch.device) -> Self:
        """On another device, but for what steers the loops."""
        return self._map(lambda t: t.to(device), but=ON_CPU)

    def _map(self, change: Callable[[Tensor], Tensor], but: Collection[str] = ()) -> Self:
        values = {f.name: getattr(self, f.name) for f in fields(cast(Any, self))}
        return type(self)(**{k: v if k in but else change(v) for k, v in values.items()})


@dataclass(frozen=True)
class Planes(Group):
    """Planes d = a + b X + c Y, cut out by a tile of a silhouette."""

    exists: Tensor
    bounds: Tensor
    cut: Tensor
    """(B, O) bool, on the CPU: whether there is any edge or hole."""
    coefficients: Tensor
    """(B, O, 3): a in px, b and c in px per px."""
    tile: Tensor
    """(B, O) index of the silhouette in the bank; 0 is the one without a hole."""
    repeats: Tensor
    """(B, O) bool: the tile covers the plane again and again."""
    texels: Tensor
    """(B, O, 2, 3): column and row in the tile as affine functions of (1, X, Y)."""

    def hit(self, k: int, rays: Rays, silhouettes: Tensor, threshold: int) -> tuple[Tensor, Tensor]:
        """(hit, d), each (B, P, H, W), of plane k.

        Args:
            silhouettes: (M, S, S) uint8 alpha, S a power of 2.
            threshold: the plane is hit where alpha exceeds it.
        """
        a, b, c = (spread(t) for t in self.coefficients[:, k].unbind(-1))
        facing = 1 - b * rays.du - c * rays.dv
        scale = 1 / torch.where(facing.abs() < TINY, TINY, facing)
        d = rays.affine(a * scale, b * scale, c * scale)
        if not self.cut[:, k].any():
            return torch.ones_like(d, dtype=torch.bool), d
        side = silhouettes.shape[-1]
        index = spread(self.tile[:, k]) * side
        for row in (1, 0):
            at_0, per_x, per_y = (spread(t) for t in self.texels[:, k, row].unbind(-1))
            shift = (per_x * rays.du + per_y * rays.dv) * scale
            # Counted from far below 0, so that cutting off the fraction rounds down.
            at_0 = at_0 + side * 1024
            texel = rays.affine(at_0 + shift * a, per_x + shift * b, per_y + shift * c).int()
            inside = (texel - side * 1024).clamp_(0, side - 1)
            wrapped = torch.where(spread(self.repeats[:, k]), texel & (side - 1), inside)
            index = (index + wrapped) * (side if row else 1)
        alpha = silhouettes.view(-1).index_select(0, index.reshape(-1)).view(index.shape)
        return alpha > threshold, d


@dataclass(frozen=True)
class Quadrics(Group):
    """q1^2 + q2^2 = e0 + e1 q3 + e2 q3^2 with |q3| <= 1, where q = M (X - cx, Y - cy, d - cd).

    e = (1, 0, -1) is an ellipsoid, (1, 0, 0) a cylinder, (1/4, -1/2, 1/4) a cone; others are
    cups and vases. Those that are open at their ends show their inside.
    """

    exists: Tensor
    bounds: Tensor
    centre: Tensor
    """(B, O, 3): cx, cy, cd."""
    matrix: Tensor
    """(B, O, 3, 3)"""
    shape: Tensor
    """(B, O, 3): e0, e1, e2."""

    def hit(self, k: int, rays: Rays) -> tuple[Tensor, Tensor]:
        """(hit, d), each (B, P, H, W), of quadric k."""
        cd = spread(self.centre[:, k, 2])
        (o1, r1), (o2, r2), (o3, r3) = _local(self.centre[:, k], self.matrix[:, k], rays)
        e0, e1, e2 = (spread(t) for t in self.shape[:, k].unbind(-1))
        # With q = o + t r, t = d - cd: A t^2 + 2 B t + C = 0.
        a = r1 * r1 + r2 * r2 - e2 * r3 * r3
        a = torch.where(a.abs() < TINY, TINY, a)
        per = [u * r1 + v * r2 - e2 * w * r3 for u, v, w in zip(o1, o2, o3, strict=True)]
        middle = rays.affine(-(per[0] - e1 * r3 / 2) / a, -per[1] / a, -per[2] / a)
        q1, q2, q3 = (rays.affine(*o) for o in (o1, o2, o3))
        c = torch.addcmul(q1 * q1, q2, q2) - torch.addcmul(e1, e2, q3) * q3 - e0
        half = torch.addcmul(middle * middle, c, -1 / a).sqrt_()  # NaN where the ray misses
        near = middle + half
        near_ends = torch.addcmul(q3, near, r3).abs_() <= 1
        far = middle.sub_(half)
        far_ends = q3.addcmul_(far, r3).abs_() <= 1
        return near_ends | far_ends, torch.where(near_ends, near, far) + cd


@dataclass(frozen=True)
class Boxes(Group):
    """|q_i| <= 1 for i = 1, 2, 3, where q = M (X - cx, Y - cy, d - cd)."""

    exists: Tensor
    bounds: Tensor
    centre: Tensor
    matrix: Tensor

    def hit(self, k: int, rays: Rays) -> tuple[Tensor, Tensor, Tensor]:
        """(hit, d, face), each (B, P, H, W), of box k; face 2 i + 1 is where q_i = 1."""
        cd = spread(self.centre[:, k, 2])
        enters: Tensor | None = None
        leaves: Tensor | None = None
        face: Tensor | None = None
        for i, (o, r) in enumerate(_local(self.centre[:, k], self.matrix[:, k], rays)):
            r = torch.where(r.abs() < TINY, TINY, r)
            middle = rays.affine(-o[0] / r, -o[1] / r, -o[2] / r)
            half = (1 / r).abs()
            enter, leave = middle + half, middle - half
            name = (2 * i + (r > 0)).to(torch.int16)
            if enters is None or leaves is None or face is None:
                enters, leaves, face = enter, leave, name
                continue
            face = torch.where(enter < enters, name, face)
            enters, leaves = torch.minimum(enters, enter), torch.maximum(leaves, leave)
        assert enters is not None and leaves is not None and face is not None
        return enters > leaves, enters + cd, face


@dataclass(frozen=True)
class Reliefs(Group):
    """Smooth height fields d = a + b X + c Y + sum of waves, without an end."""

    exists: Tensor
    bounds: Tensor
    coefficients: Tensor
    """(B, O, 3)"""
    waves: Tensor
    """(B, O, K, 4): amplitude in px, angular frequency along X and Y in 1/px, phase."""

    STEPS = 4

    def hit(self, k: int, rays: Rays) -> tuple[Tensor, Tensor]:
        """(hit, d): Newton's method from the plane; slopes below 1 / |(du, dv)| let it converge."""
        a, b, c = (spread(t) for t in self.coefficients[:, k].unbind(-1))
        scale = 1 / (1 - b * rays.du - c * rays.dv)
        d = rays.affine(a * scale, b * scale, c * scale)
        for _ in range(self.STEPS):
            x, y = rays.at(d)
            height, per_x, per_y = self.height(k, x, y)
            d = d - (d - height) / (1 - per_x * rays.du - per_y * rays.dv)
        return torch.ones_like(d, dtype=torch.bool), d

    def height(self, k: int, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """d and its slopes along X and Y at (X, Y)."""
        a, b, c = (spread(t) for t in self.coefficients[:, k].unbind(-1))
        height = a + b * x + c * y
        per_x, per_y = b.expand_as(height), c.expand_as(height)
        for wave in self.waves[:, k].unbind(1):
            amplitude, fx, fy, phase = (spread(t) for t in wave.unbind(-1))
            angle = torch.addcmul(torch.addcmul(phase, fx, x), fy, y)
            height = height + amplitude * angle.sin()
            slope = amplitude * angle.cos()
            per_x, per_y = torch.addcmul(per_x, slope, fx), torch.addcmul(per_y, slope, fy)
        return height, per_x, per_y


Affine = tuple[Tensor, Tensor, Tensor]


def _local(centre: Tensor, matrix: Tensor, rays: Rays) -> list[tuple[Affine, Tensor]]:
    """q_i along the rays: (o, r) with q_i = o(x, y) + (d - cd) r, o as an affine function."""
    cx, cy, cd = (spread(t) for t in centre.unbind(-1))
    shift_x, shift_y = cd * rays.du - cx, cd * rays.dv - cy
    result = []
    for row in matrix.unbind(1):
        mx, my, md = (spread(t) for t in row.unbind(-1))
        at_0 = mx * shift_x + my * shift_y
        result.append(((at_0, mx, my), mx * rays.du + my * rays.dv + md))
    return result
