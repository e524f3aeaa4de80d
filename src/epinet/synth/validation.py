"""The validation set: rendered scenes that no training scene resembles, in parts by difficulty.

Textures and shapes are of the held-out families. It is made once, outside the repository, and is
the same wherever the generator's version is the same.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from epinet.synth.dataset import Existing, write_scenes
from epinet.synth.generator import VERSION
from epinet.synth.options import RANGES_PX, Faults, Options

VALIDATION_SEED = 2_018_000_003
"""Far from any seed that a person gives to training."""


def validation_parts() -> Mapping[str, tuple[Options, ...]]:
    """The options of each scene of each part, 16 scenes in all."""
    few, many = (6, 12), (16, 32)
    textured = {"contrast": (0.5, 1.0), "textureless": 0.0, "thin": 0.1, "reflective": 0.0}
    flat = {"contrast": (0.0, 0.2), "textureless": 0.5, "reflective": 0.0}
    mirrors = {"contrast": (0.3, 1.0), "reflective": 0.5, "highlights": 0.5}
    noise = replace(Faults.none(), noise=1.0, quantise=True, full=True)
    wires = {"contrast": (0.3, 1.0), "thin": 0.9, "reflective": 0.0}
    return {
        "textured": _part(few, few, many, many, **textured),
        "textureless": _part(few, many, **flat),
        "reflective": _part(few, many, **mirrors),
        "thin": _part(many, many, **wires),
        "noisy": _part(few, many, reflective=0.0, faults=noise),
        "narrow": _part(few, many, reflective=0.0, disparity_px=RANGES_PX["narrow"]),
        "wide": _part(few, many, disparity_px=RANGES_PX["wide"]),
    }


def _part(*surfaces: tuple[int, int], **shape: Any) -> tuple[Options, ...]:
    """A scene for each number of surfaces."""
    return tuple(Options(held_out=True, surfaces=count, **shape) for count in surfaces)


def validation_folder() -> Path:
    """Where the set is kept unless told otherwise: the user's cache, by the generator's version."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "epinet" / f"validation-{VERSION}"


def make_validation(
    folder: Path | None = None,
    *,
    parts: Mapping[str, tuple[Options, ...]] | None = None,
    device: str = "cpu",
    existing: Existing = "resume",
    advance: Callable[[float], None] = lambda share: None,
) -> Path:
    """Make what is missing of the validation set: `folder`/<part>_<k>, only the star's views.

    Args:
        folder: default: `validation_folder()`.
        parts: default: `validation_parts()`.
        device: where to render.
        existing: see `write_scenes`.
        advance: told the share of the work after each scene.

    Returns:
        The folder.

    Raises:
        InputError: see `write_scenes`.
    """
    folder = validation_folder() if folder is None else folder
    parts = validation_parts() if parts is None else parts
    write_scenes(
        folder,
        {f"{part}_{k}": options for part, each in parts.items() for k, options in enumerate(each)},
        VALIDATION_SEED,
        {"parts": {part: [options.as_dict() for options in each] for part, each in parts.items()}},
        star_only=True,
        device=device,
        existing=existing,
        advance=advance,
    )
    return folder
