"""Scenes: surfaces, what they are made of, and the light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TypeVar

import torch
from torch import Tensor

from epinet.synth.bank import Bank
from epinet.synth.surfaces import Boxes, Group, Planes, Quadrics, Reliefs


@dataclass(frozen=True)
class Materials:
    """Of S surfaces in each of B scenes; a box counts as six."""

    tile: Tensor
    """(B, S) texture in the bank."""
    texels: Tensor
    """(B, S, 2, 4): column and row in the texture as affine functions of (1, X, Y, d)."""
    tint: Tensor
    """(B, S, 3) factor on the colour; the light that falls on flat surfaces included."""
    normal: Tensor
    """(B, S, 3, 4) towards the outside, in the frame of `Light`, affine in (1, X, Y, d)."""
    curved: Tensor
    """(B, S) bool: the light varies over the surface."""
    highlight: Tensor
    """(B, S, 2): strength and exponent."""
    mirror: Tensor
    """(B, S, 3): share of a second scene in what is seen, its disparity, and how much the
    surface's normal bends it, in px."""
    second: Tensor
    """(B, S) texture of the second scene."""


@dataclass(frozen=True)
class Light:
    """Directions are in a frame (X, Y, depth_px d) that is as deep as it is wide."""

    direction: Tensor
    """(B, 3) unit vector towards the lamp; its third component points at the viewer."""
    ambient: Tensor
    """(B,) share of light without a direction."""
    brightest: Tensor
    """(B, 3) X, Y and d where a near lamp's light is strongest."""
    reach: Tensor
    """(B, 3) distance from there, along each, at which half of it is left; a far lamp's is
    infinite."""
    depth_px: Tensor
    """(B,): focus distance / baseline, px per unit of disparity."""
    focal_px: Tensor
    """(B,)"""
    shade: Tensor
    """(B,) which tile stands in the light."""
    shade_strength: Tensor
    """(B,) 0..1"""
    shade_texels: Tensor
    """(B, 2, 4): column and row in that tile, affine in (1, X, Y, d): constant along the light."""


@dataclass(frozen=True)
class Scenes:
    """B scenes."""

    size: tuple[int, int]
    """(height, width) of the views in px."""
    planes: Planes
    quadrics: Quadrics
    boxes: Boxes
    reliefs: Reliefs
    materials: Materials
    light: Light
    bank: Bank

    @property
    def count(self) -> int:
        """How many scenes."""
        return len(self.planes.exists)

    @property
    def groups(self) -> tuple[Group, ...]:
        """Surfaces by kind, in the order of their ids."""
        return self.planes, self.quadrics, self.reliefs, self.boxes

    @cached_property
    def first_ids(self) -> tuple[int, ...]:
        """Id of the first surface of each group."""
        planes, quadrics, reliefs, _ = (group.exists.shape[1] for group in self.groups)
        return 0, planes, planes + quadrics, planes + quadrics + reliefs

    def __getitem__(self, index: slice) -> Scenes:
        """Some of the scenes."""
        parts = {name: getattr(self, name).scenes(index) for name in GROUPS}
        return replace(
            self,
            **parts,
            materials=_map(self.materials, lambda t: t[index]),
            light=_map(self.light, lambda t: t[index]),
        )

    def to(self, device: torch.device) -> Scenes:
        """On another device."""
        parts = {name: getattr(self, name).to(device) for name in GROUPS}
        return replace(
            self,
            **parts,
            materials=_map(self.materials, lambda t: t.to(device)),
            light=_map(self.light, lambda t: t.to(device)),
            bank=self.bank.to(device),
        )


GROUPS = ("planes", "quadrics", "boxes", "reliefs")


T = TypeVar("T", Materials, Light)


def _map(data: T, change: Callable[[Tensor], Tensor]) -> T:
    values = {f.name: change(getattr(data, f.name)) for f in fields(data)}
    return type(data)(**values)
