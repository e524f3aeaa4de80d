"""A result folder read back, and the views that it came from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.inspect.alignment import estimate_alignment
from epinet.io.camera_file import CameraFacts, camera_facts
from epinet.io.images import read_image
from epinet.io.pfm import read_pfm
from epinet.io.problems import Problems
from epinet.io.read import read_light_field
from epinet.lightfield import LightField
from epinet.predict.record import Record, read_record
from epinet.refine.compensation import compensated

_ANOTHER_SCENE = 0.05
"""Mean difference of the reference view to centre.png from which the views are another scene's."""


@dataclass(frozen=True)
class StoredResult:
    """What `epinet predict` wrote."""

    folder: Path
    disparity: NDArray[np.float32]
    """(H, W) px per adjacent view."""
    centre_view: NDArray[np.uint8]
    """(H, W, 3)."""
    confidence: NDArray[np.float32]
    """(H, W) in 0..1."""
    run: Record
    """What run.json says."""

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) in px."""
        return self.disparity.shape[0], self.disparity.shape[1]

    @property
    def step(self) -> int:
        """The disparity is per so many adjacent views."""
        return self.run.settings.step

    @property
    def camera_facts(self) -> CameraFacts:
        """What run.json says of the camera, which may be nothing.

        Raises:
            InputError: what it says cannot be.
        """
        camera = self.run.camera or {}
        known = {name: value for name, value in camera.items() if name in CameraFacts.model_fields}
        return camera_facts(known, f"{self.folder / 'run.json'}, camera")

    def read_views(self, path: Path | None = None) -> LightField:
        """The views that the disparity was estimated from: in the order used then, compensated.

        Args:
            path: where they are now, if not where run.json says.

        Raises:
            InputError: they are gone, or others stand there.
        """
        source = path or self._source()
        flip_rows, flip_cols, transpose = self.run.order
        layout = self.run.layout if path is None else None  # elsewhere, it may be another
        lf = read_light_field(source, layout).reordered(
            flip_rows=flip_rows, flip_cols=flip_cols, transpose=transpose
        )
        settings = self.run.settings
        lf = lf.central(self.run.views_used[0], settings.step).brightened()
        self._check_same(lf, source)
        if settings.row_spacing != 1:
            return replace(lf, row_spacing=settings.row_spacing)
        alignment = estimate_alignment(lf) if settings.refine else None
        return lf if alignment is None else compensated(lf, alignment)

    def _source(self) -> Path:
        source = self.run.input
        if source is None or not Path(source).exists():
            where = "nowhere on disk" if source is None else f"at {source}"
            raise InputError(
                f"{self.folder}: the views it came from lay {where} and are not there; "
                "say where they are now (--views PATH)"
            )
        return Path(source)

    def _check_same(self, lf: LightField, source: Path) -> None:
        if lf.size == self.size:
            difference = np.abs(lf.rgb(*lf.centre) - self.centre_view / np.float32(255)).mean()
            if difference <= _ANOTHER_SCENE:
                return
        raise InputError(
            f"{source}: its views are not those that {self.folder} came from; "
            "predict it again, or say where they are (--views PATH)"
        )


def read_result(folder: str | Path) -> StoredResult:
    """Read a result folder.

    Raises:
        InputError: it is none, files of it are missing or damaged, or their sizes differ.
    """
    folder = Path(folder)
    if not (folder / "run.json").is_file():
        raise InputError(f"{folder}: not a result folder of epinet predict (no run.json in it)")
    problems = Problems()
    with problems.gather():
        run = read_record(folder / "run.json")
    with problems.gather():
        disparity = read_pfm(folder / "disparity.pfm")
    with problems.gather():
        centre_view = _as_rgb8(read_image(folder / "centre.png"))
    with problems.gather():
        confidence = read_image(folder / "confidence.png")[..., 0]
    problems.raise_any()
    if disparity.ndim != 2:
        raise InputError(f"{folder / 'disparity.pfm'}: in colour; a disparity map has one channel")
    for name, image in (("centre.png", centre_view), ("confidence.png", confidence)):
        if image.shape[:2] != disparity.shape:
            problems.append(
                f"{folder / name}: {image.shape[1]}x{image.shape[0]} px, but disparity.pfm has "
                f"{disparity.shape[1]}x{disparity.shape[0]}; predict the light field again"
            )
    if not np.isfinite(disparity).any():
        problems.append(f"{folder / 'disparity.pfm'}: no pixel has a disparity")
    problems.raise_any()
    scaled = confidence.astype(np.float32) / np.float32(np.iinfo(confidence.dtype).max)
    return StoredResult(folder, disparity, centre_view, scaled, run)


def _as_rgb8(image: NDArray[Any]) -> NDArray[np.uint8]:
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image.astype(np.uint8)
