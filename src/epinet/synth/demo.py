"""A small colour scene with exact truth, for a first run without any download."""

from __future__ import annotations

import numpy as np
import torch

from epinet.lightfield import LightField
from epinet.synth.layers import draw_scenes

DEMO_RANGE_PX = (-2.5, 2.5)
NOISE = 0.004


def render_demo(seed: int = 1, size: tuple[int, int] = (320, 448)) -> LightField:
    """A 9x9 light field (8 bit, RGB) of textured slanted layers, with its truth.

    Args:
        seed: another seed gives another scene.
        size: (height, width) of a view in pixels.
    """
    g = torch.Generator().manual_seed(seed)
    scene = draw_scenes(g, 1, size, DEMO_RANGE_PX, layers=12, channels=3)
    rows = []
    for row in range(-4, 5):  # a row of views at a time bounds the memory
        views, disparity = scene.render([(row, col) for col in range(-4, 5)])
        noisy = views[0] + NOISE * torch.randn(views[0].shape, generator=g)
        rows.append(torch.round(noisy.clamp(0, 1) * 255).to(torch.uint8))
        if row == 0:
            truth = disparity[0, 4].clone()
    array = torch.stack(rows).permute(0, 1, 3, 4, 2)
    return LightField(np.ascontiguousarray(array.numpy()), truth=truth.numpy(), layout="rendered")
