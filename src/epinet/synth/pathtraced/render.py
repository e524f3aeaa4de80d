"""Rendering one scene's star of views, view by view, so that an interrupted run goes on."""

from __future__ import annotations

import hashlib
import time
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import isqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.lightfield import LightField
from epinet.srgb import encoded
from epinet.synth.pathtraced.assets import Library
from epinet.synth.pathtraced.elements import Scene
from epinet.synth.pathtraced.rig import VIEWS, Rig, centre_rig, fitted_rig
from epinet.synth.pathtraced.stage import Stage, build
from epinet.synth.pathtraced.truth import Truth, discontinuities, trace

PASS_SAMPLES = 36
"""At most so many samples per pixel in one pass; a view is the mean of an even number of them."""
WHITE_LIMIT = 4.0
"""Linear values of one pass are clipped at this multiple of white, against stray bright paths."""
_MAX_BOUNCES = 8
_METHOD = 1
"""To be raised with every change of how the same description is rendered."""


@dataclass(frozen=True)
class Settings:
    """How to render; part of what a rendering is recognised by."""

    size: int = 256
    """Width and height of a view in pixels."""
    samples: int = 144
    """Per pixel; 2 or 4 times a square takes the fewest passes."""

    def __post_init__(self) -> None:
        if self.size < 32:
            raise InputError(f"size {self.size}: views must be at least 32 px wide")
        if self.samples < 2 or self.samples % 2:
            raise InputError(f"samples {self.samples}: must be even, as noise is told from halves")

    @property
    def passes(self) -> int:
        """The least even number whose passes have a square number of samples, as strata need."""
        counts = range(2, self.samples + 1, 2)
        return next(n for n in counts if self.samples % n == 0 and self._fits(self.samples // n))

    @staticmethod
    def _fits(samples: int) -> bool:
        return samples <= PASS_SAMPLES and isqrt(samples) ** 2 == samples

    def fingerprint(self, scene: Scene) -> str:
        """Changes with whatever changes the images."""
        text = repr((_METHOD, VIEWS, self, PASS_SAMPLES, WHITE_LIMIT, _MAX_BOUNCES, scene))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Rendering:
    """A finished scene and what is known about it."""

    light_field: LightField
    objects: NDArray[np.uint8]
    """(H, W) number of the scene's element; 0 where there is nothing."""
    record: dict[str, Any]


def render_scene(
    mi: Any,
    scene: Scene,
    library: Library,
    settings: Settings,
    parts: Path,
    done: Callable[[float], None] = lambda share: None,
) -> Rendering:
    """Render what is not in the parts' folder yet, and put the scene together.

    Args:
        mi: Mitsuba, from `load_mitsuba`.
        scene: what to render.
        library: its assets.
        settings: how.
        parts: folder that keeps finished views, of this scene and these settings only.
        done: told the share (0..1) of the scene after each view.
    """
    library.used.clear()
    models = parts / "models"
    models.mkdir(parents=True, exist_ok=True)
    stage = build(mi, scene, library, models)
    rig = centre_rig(scene, settings.size)
    truth = trace(stage, rig)
    rig = fitted_rig(rig, truth.depth_mm, scene.disparity_px)
    star = star_positions(VIEWS)
    views = np.zeros((VIEWS, VIEWS, settings.size, settings.size, 3), dtype=np.uint8)
    noise, seconds = [], []
    for row, col in star:
        part = parts / f"view_{row:02d}_{col:02d}.npz"
        if not part.exists():
            _render_to(part, stage, scene, rig, settings, row, col)
        with np.load(part) as saved:
            views[row, col] = saved["view"]
            noise.append(float(saved["noise"]))
            seconds.append(float(saved["seconds"]))
        done(1 / len(star))
    light_field = _light_field(views, star, rig, truth)
    record = {
        "about": scene.about,
        "fingerprint": settings.fingerprint(scene),
        **asdict(settings),
        "passes": settings.passes,
        "mitsuba": f"{mi.__version__} {mi.variant()}",
        "exposure": scene.exposure,
        "noise_rms_8bit": round(float(np.mean(noise)), 3),
        "seconds_per_view": round(float(np.mean(seconds)), 2),
        **_truth_record(light_field, truth),
        "assets": dict(sorted(library.used.items())),
    }
    return Rendering(light_field, truth.objects, record)


def render_view(
    stage: Stage, scene: Scene, rig: Rig, settings: Settings, row: int, col: int
) -> tuple[NDArray[np.uint8], float]:
    """One view.

    Returns:
        (H, W, 3) sRGB pixels, and the root mean square of their noise in 8-bit levels: half of
        how much the two halves of the passes differ, before rounding.
    """
    mi = stage.mi
    description = rig.sensor(mi, row, col)
    description["sampler"] = {"type": "multijitter"}
    sensor = mi.load_dict(description)
    integrator = mi.load_dict({"type": "path", "max_depth": _MAX_BOUNCES + 1})
    halves = np.zeros((2, rig.camera.height_px, rig.camera.width_px, 3))
    for number in range(settings.passes):
        seed = zlib.crc32(f"{scene.name} {row} {col} {number}".encode())
        image = integrator.render(
            stage.scene, sensor, seed=seed, spp=settings.samples // settings.passes
        )
        linear = np.nan_to_num(np.array(image, dtype=np.float64)) * scene.exposure
        halves[number % 2] += np.clip(linear, 0, WHITE_LIMIT) * 2 / settings.passes
    difference = encoded(halves[0]) - encoded(halves[1])
    noise = 255 * float(np.sqrt((difference**2).mean())) / 2
    return np.round(255 * encoded(halves.mean(axis=0))).astype(np.uint8), noise


def _render_to(
    part: Path, stage: Stage, scene: Scene, rig: Rig, settings: Settings, row: int, col: int
) -> None:
    start = time.monotonic()
    view, noise = render_view(stage, scene, rig, settings, row, col)
    with atomic_path(part) as temporary:
        np.savez(temporary, view=view, noise=noise, seconds=time.monotonic() - start)


def _light_field(
    views: NDArray[np.uint8], star: list[tuple[int, int]], rig: Rig, truth: Truth
) -> LightField:
    present = np.zeros((VIEWS, VIEWS), dtype=bool)
    present[tuple(np.array(star).T)] = True
    disparity = rig.camera.disparity_px(truth.depth_mm)
    masks = {
        "invalid": truth.unreliable,
        "discontinuities": discontinuities(disparity.astype(np.float64)),
    }
    return LightField(views, present, rig.camera, disparity, masks)


def _truth_record(lf: LightField, truth: Truth) -> dict[str, Any]:
    assert lf.truth is not None and lf.camera is not None
    quantiles = np.quantile(lf.truth, [0, 0.25, 0.5, 0.75, 1])
    return {
        "camera": lf.camera.as_dict(),
        "disparity_px_quartiles": [round(float(value), 3) for value in quantiles],
        "depth_mm": [
            round(float(value), 1) for value in (truth.depth_mm.min(), truth.depth_mm.max())
        ],
        "share_invalid": round(float(lf.masks["invalid"].mean()), 4),
        "share_discontinuities": round(float(lf.masks["discontinuities"].mean()), 4),
    }
