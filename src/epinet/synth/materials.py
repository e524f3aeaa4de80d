"""Drawing light and materials at random, for surfaces that have been drawn before."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from epinet.synth.bank import FLAT_TEXTURES, SHADE_SIDE, TEXTURES
from epinet.synth.dice import Dice
from epinet.synth.options import Options
from epinet.synth.scenes import Light, Materials
from epinet.synth.shade import diffuse
from epinet.synth.surfaces import Boxes, Planes, Quadrics, Reliefs


def draw_light(
    dice: Dice, options: Options, longest: int, depth_px: Tensor, focal_px: Tensor, shades: int
) -> Light:
    """A lamp, ambient light and soft shadows for each of the scenes, whose pictures, or those that
    they are windows into, are `longest` px wide or high."""
    count = len(depth_px)
    towards = torch.randn(count, 3, generator=dice.g)
    towards[:, 2] = towards[:, 2].abs() + 0.3
    direction = F.normalize(towards, dim=-1)
    strength = torch.where(dice.chance(0.5, count), 0.0, dice.uniform(0.2, 0.85, count))
    texels = SHADE_SIDE / dice.log_uniform(30, 600, count)
    angle = dice.uniform(0, 2 * math.pi, count)
    turn = torch.stack([angle.cos(), -angle.sin(), angle.sin(), angle.cos()], -1).view(count, 2, 2)
    linear = turn * texels[:, None, None]
    # Along the light, X and Y change by direction_xy / direction_z per unit of D.
    lean = direction[:, :2] / direction[:, 2:].clamp_min(0.2) * depth_px[:, None]
    per_d = -(linear @ lean[..., None])
    at_0 = dice.uniform(0, SHADE_SIDE, count, 2, 1)
    brightest, reach = torch.zeros(count, 3), torch.full((count, 3), math.inf)
    if options.near_lamps:
        low, high = options.disparity_px
        near = dice.chance(options.near_lamps, count, 1)
        half = dice.log_uniform(0.05, 1, count, 1) * longest
        half = torch.cat([half, half, torch.full_like(half, high - low)], 1)
        # Where the light is strongest is so near to the picture's middle that it falls off there.
        brightest = half * dice.uniform(-1, 1, count, 3)
        reach = torch.where(near, half, reach)
    return Light(
        direction=direction,
        ambient=dice.uniform(0.1, 0.9, count),
        brightest=brightest,
        reach=reach,
        depth_px=depth_px,
        focal_px=focal_px,
        shade=dice.integers(0, shades - 1, count),
        shade_strength=strength,
        shade_texels=torch.cat([at_0, linear, per_d], -1),
    )


def draw_materials(
    dice: Dice,
    options: Options,
    light: Light,
    planes: Planes,
    quadrics: Quadrics,
    reliefs: Reliefs,
    boxes: Boxes,
) -> Materials:
    """Textures, tints, highlights and mirrors for all surfaces of the scenes."""
    normal = torch.cat(
        [
            _plane_normals(planes.coefficients),
            _quadric_normals(quadrics),
            _plane_normals(reliefs.coefficients),
            _face_normals(boxes),
        ],
        1,
    )
    normal[..., 2, :] = normal[..., 2, :] / light.depth_px[:, None, None]
    count, number = normal.shape[:2]
    curved = torch.zeros(count, number, dtype=torch.bool)
    first, bodies = planes.exists.shape[1], quadrics.exists.shape[1]
    curved[:, first : first + bodies + reliefs.exists.shape[1]] = True
    flat = dice.chance(options.textureless, count, number)
    tile = dice.integers(0, TEXTURES - 1, count, number)
    tone = dice.integers(TEXTURES, TEXTURES + FLAT_TEXTURES - 1, count, number)
    brightness = dice.log_uniform(0.8, 1.5, count, number, 1)
    tint = brightness * dice.uniform(0.85, 1.1, count, number, 3)
    lit = diffuse(
        F.normalize(normal[..., 0], dim=-1), light.direction[:, None], light.ambient[:, None]
    )
    tint = torch.where(curved[..., None], tint, tint * lit[..., None])
    glossy = dice.chance(options.highlights, count, number)
    strength = torch.where(glossy, dice.uniform(0.05, 0.9, count, number), 0.0)
    exponent = dice.log_uniform(*options.gloss, count, number)
    mirrors = dice.chance(options.reflective, count, number)
    share = torch.where(mirrors, dice.uniform(0.1, 0.95, count, number), 0.0)
    low, high = options.disparity_px
    mirror = [share, dice.uniform(low, high, count, number), dice.log_uniform(1, 60, count, number)]
    return Materials(
        tile=torch.where(flat, tone, tile),
        texels=_draw_texels(dice, count, number, first, bodies, light.depth_px),
        tint=tint,
        normal=normal,
        curved=curved,
        highlight=torch.stack([strength, exponent], -1),
        mirror=torch.stack(mirror, -1),
        second=dice.integers(0, TEXTURES - 1, count, number),
    )


def _draw_texels(
    dice: Dice, count: int, number: int, first: int, bodies: int, depth_px: Tensor
) -> Tensor:
    """(B, S, 2, 4): textures at 0.7 to 1.8 texels per px, fixed to X and Y.

    On bodies they also move with depth: a side that is seen at a grazing angle has texture too.
    """
    density = dice.log_uniform(0.7, 1.8, count, number, 1)
    angle = dice.uniform(0, 2 * math.pi, count, number)
    along = torch.stack([angle.cos(), angle.sin()], -1) * density
    across = torch.stack([-angle.sin(), angle.cos()], -1) * density
    deep = dice.uniform(-1, 1, count, number, 2) * density * depth_px[:, None, None]
    deep[:, :first] = 0
    deep[:, first + bodies] = 0  # the relief
    at_0 = dice.uniform(0, 512, count, number, 2)
    return torch.cat([at_0[..., None], torch.stack([along, across], -2), deep[..., None]], -1)


def _plane_normals(coefficients: Tensor) -> Tensor:
    """(B, O, 3, 4) gradient of d - a - b X - c Y."""
    normal = torch.zeros(*coefficients.shape[:2], 3, 4)
    normal[..., 0, 0], normal[..., 1, 0] = -coefficients[..., 1], -coefficients[..., 2]
    normal[..., 2, 0] = 1
    return normal


def _quadric_normals(quadrics: Quadrics) -> Tensor:
    """(B, O, 3, 4) half the gradient of q1^2 + q2^2 - e0 - e1 q3 - e2 q3^2."""
    m = quadrics.matrix
    weights = torch.ones(*m.shape[:2], 3)
    weights[..., 2] = -quadrics.shape[..., 2]
    bilinear = m.mT @ (weights[..., None] * m)
    at_0 = -(bilinear @ quadrics.centre[..., None])
    at_0 = at_0 - m[..., 2, :, None] * quadrics.shape[..., 1, None, None] / 2
    return torch.cat([at_0, bilinear], -1)


def _face_normals(boxes: Boxes) -> Tensor:
    """(B, 6 O, 3, 4): face 2 i + 1 looks along row i of the matrix, face 2 i against it."""
    count, number = boxes.exists.shape
    rows = boxes.matrix[:, :, :, None] * torch.tensor([-1.0, 1.0])[:, None]
    normal = torch.zeros(count, 6 * number, 3, 4)
    normal[..., 0] = rows.reshape(count, 6 * number, 3)
    return normal
