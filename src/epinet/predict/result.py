"""What a prediction gives, and the folder it is saved as."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.errors import InputError
from epinet.inspect.alignment import Alignment
from epinet.io import write_pfm
from epinet.io.atomic import atomic_folder
from epinet.io.images import write_png
from epinet.io.names import named_path, strangers
from epinet.io.problems import listed
from epinet.lightfield import LightField
from epinet.metrics.disparity import BORDER_PX, score
from epinet.predict.confidence import AGREEMENT

FILES = frozenset(
    {
        "disparity.pfm",
        "disparity.npy",
        "disparity.png",
        "confidence.png",
        "centre.png",
        "preview.png",
        "run.json",
    }
)
"""What a result folder holds."""
EXPECTED_ERROR = "expected_error.pfm"
"""What it holds where the network predicts its error."""


@dataclass(frozen=True)
class Result:
    """A disparity map with all that is known about it."""

    disparity: NDArray[np.float32]
    """(H, W) of the reference view, px per adjacent view of the grid used; positive is nearer."""
    confidence: NDArray[np.float32]
    """(H, W) in 0..1, see `epinet.predict.confidence`."""
    lightfield: LightField
    """The views that were used."""
    expected_error: NDArray[np.float32] | None = None
    """(H, W) mean error to expect, px per adjacent view, where the network predicts it."""
    confidence_means: str = AGREEMENT
    """What the confidence says, for people."""
    settings: dict[str, Any] = field(default_factory=dict)
    weights: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    request: dict[str, Any] = field(default_factory=dict)
    """What was asked for, where a batch asked: the same request need not run again."""
    input_sha256: str | None = None
    """Of the light field's files, where a batch read them."""
    warnings: tuple[str, ...] = ()
    alignment: Alignment | None = None
    """Of the views as they were read, where it was measured; `lightfield` is compensated."""

    @property
    def centre_view(self) -> NDArray[np.uint8]:
        """(H, W, 3) the reference view."""
        rgb = self.lightfield.rgb(*self.lightfield.centre)
        return np.round(255 * rgb).astype(np.uint8)

    @cached_property
    def scores(self) -> dict[str, float] | None:
        """Scores against the light field's truth; None where there is none to compare with."""
        truth = self.lightfield.truth
        if truth is None or min(truth.shape) <= 2 * BORDER_PX:
            return None
        if not np.isfinite(truth[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]).any():
            return None
        return score(self.disparity, truth)

    def describe(self) -> dict[str, Any]:
        """The content of run.json."""
        from epinet import __version__

        lf = self.lightfield
        low, high = np.percentile(self.disparity, [1, 99])
        return {
            "epinet": __version__,
            "input": None if lf.source is None else str(named_path(lf.source)),
            "input_sha256": self.input_sha256,
            "layout": lf.layout,
            "order": list(lf.order),
            "views_used": list(lf.grid),
            "reference_view": lf.reference,
            "size_px": {"height": lf.size[0], "width": lf.size[1]},
            "camera": None if lf.camera is None else lf.camera.as_dict(),
            "request": self.request,
            "settings": self.settings,
            "weights": self.weights,
            "seconds": {name: round(s, 3) for name, s in self.seconds.items()},
            "disparity_px": {
                "min": float(self.disparity.min()),
                "percentile_1": float(low),
                "median": float(np.median(self.disparity)),
                "percentile_99": float(high),
                "max": float(self.disparity.max()),
            },
            "confidence_means": self.confidence_means,
            "median_confidence": float(np.median(self.confidence)),
            "alignment": None if self.alignment is None else self.alignment.as_dict(),
            "scores": self.scores,
            "scores_border_px": BORDER_PX,
            "notes": list(lf.notes),
            "warnings": list(self.warnings),
        }

    def save(self, folder: Path | str) -> Path:
        """Write the result folder; an existing one is replaced only once all is written.

        Holds disparity.pfm and disparity.npy (the map), disparity.png (in colour, with a bar),
        confidence.png (16-bit, 65535 is 1), centre.png, preview.png and run.json; and where the
        network predicts its error expected_error.pfm, in px per adjacent view.

        Raises:
            InputError: the folder cannot be written, or holds something else than a result.
        """
        from epinet.predict import pictures

        check_replaceable(Path(folder))
        with atomic_folder(Path(folder)) as out:
            write_pfm(out / "disparity.pfm", self.disparity)
            np.save(out / "disparity.npy", self.disparity)
            pictures.save_disparity(out / "disparity.png", self.disparity)
            write_png(out / "confidence.png", np.round(65535 * self.confidence).astype(np.uint16))
            if self.expected_error is not None:
                write_pfm(out / EXPECTED_ERROR, self.expected_error)
            write_png(out / "centre.png", self.centre_view)
            pictures.save_preview(out / "preview.png", self)
            (out / "run.json").write_text(json.dumps(self.describe(), indent=1) + "\n")
        return Path(folder)


def check_replaceable(folder: Path, ours: frozenset[str] = FILES | {EXPECTED_ERROR}) -> None:
    """Refuse to replace a folder that holds anything but the files we write into it.

    Raises:
        InputError: something else stands there.
    """
    if folder.is_dir():
        others = strangers(folder, ours.__contains__)
        if not others:
            return
        found = f"a folder with other things in it ({listed(others, 3)}) stands"
    elif folder.exists():
        found = "a file stands"
    else:
        return
    raise InputError(f"{folder}: {found} where the result would go; choose another output")
