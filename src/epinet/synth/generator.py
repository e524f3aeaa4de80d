"""Scenes by number: scene k of a seed is the same on any machine and device."""

from __future__ import annotations

from epinet.lightfield import LightField
from epinet.synth.demo import render_demo
from epinet.synth.options import Options


def render_scene(options: Options, seed: int, index: int, device: str = "cpu") -> LightField:
    """PLACEHOLDER until the renderer lands: same interface."""
    return render_demo(seed * 1000 + index, options.size)
