"""What a set of light fields with truth looks like in numbers, scene by scene.

- Disparity: of every pixel whose truth is known.
- Step: between two neighbouring pixels, where the truth differs by more than STEP_PX and by more
  than STEP_SLOPES times what it does around them.
- Slant: magnitude of the truth's gradient at pixels that no step touches.
- Contrast: standard deviation of the centre view's luma (0..1) in a window around each pixel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from epinet.errors import InputError
from epinet.lightfield import LightField

STEP_PX = 0.02
STEP_SLOPES = 3.0
CONTRAST_WINDOW_PX = 7
TEXTURELESS = 0.01
"""Contrast below which a pixel counts as textureless: 2.5 gray levels of 255."""

PERCENTILES = (1, 10, 25, 50, 75, 90, 99)


class Histogram:
    """Counts in fixed bins, to which scenes are added one at a time."""

    def __init__(self, edges: NDArray[np.float64]) -> None:
        self.edges = edges
        self.counts = np.zeros(len(edges) - 1, dtype=np.int64)
        self.low, self.high = np.inf, -np.inf
        """Of all values, be they within the bins or beyond them."""

    def add(self, values: NDArray[Any]) -> None:
        """Count values; those beyond the bins count in the outermost ones."""
        if values.size:
            within = np.clip(values, self.edges[0], self.edges[-1])
            self.counts += np.histogram(within, self.edges)[0]
            self.low = min(self.low, float(values.min()))
            self.high = max(self.high, float(values.max()))

    def describe(self) -> dict[str, float | int | None]:
        """Number, bounds and percentiles of the values, these to within a bin."""
        total = int(self.counts.sum())
        report: dict[str, float | int | None] = {"count": total}
        names = ["min", *(f"percentile_{p}" for p in PERCENTILES), "max"]
        if total == 0:
            return report | dict.fromkeys(names)
        upto = np.cumsum(self.counts)
        wanted = np.array(PERCENTILES) / 100 * total
        bins = np.searchsorted(upto, wanted)  # never an empty one, as `wanted` is above 0
        share = 1 - (upto[bins] - wanted) / self.counts[bins]
        inner = self.edges[bins] + share * np.diff(self.edges)[bins]
        values = [self.low, *np.clip(inner, self.low, self.high).tolist(), self.high]
        return report | {name: float(f"{v:.6g}") for name, v in zip(names, values, strict=True)}


class Statistics:
    """Distributions over the scenes added so far.

    Example:
        >>> statistics = Statistics()
        >>> statistics.add(lf)  # doctest: +SKIP
        >>> print("\\n".join(statistics.lines()))  # doctest: +SKIP
    """

    def __init__(self) -> None:
        self.scenes = 0
        self.pixels = 0
        self.beside_steps = 0
        self.textureless = 0
        self.marked_pixels = 0
        """Pixels of the scenes that have a mask of what is occluded in some view."""
        self.occluded = 0
        self.disparity = Histogram(np.linspace(-32, 32, 1281))
        self.slant = Histogram(np.geomspace(1e-5, 10, 121))
        self.step = Histogram(np.geomspace(STEP_PX, 64, 121))
        self.contrast = Histogram(np.geomspace(5e-4, 0.5, 121))

    def add(self, lf: LightField) -> None:
        """Take a scene into account.

        Raises:
            InputError: its truth is not known.
        """
        if lf.truth is None:
            raise InputError(f"{lf.source or 'light field'}: statistics need the truth")
        heights, beside = steps(lf.truth)
        slants = np.hypot(*np.gradient(lf.truth.astype(np.float64)))[~beside]
        contrasts = local_contrast(lf.gray(*lf.centre))
        self.scenes += 1
        self.pixels += lf.truth.size
        self.disparity.add(lf.truth[np.isfinite(lf.truth)])
        self.slant.add(slants[np.isfinite(slants)])
        self.step.add(heights)
        self.contrast.add(contrasts)
        self.beside_steps += int(beside.sum())
        self.textureless += int((contrasts < TEXTURELESS).sum())
        if "occluded" in lf.masks:
            self.marked_pixels += lf.truth.size
            self.occluded += int(lf.masks["occluded"].sum())

    def report(self) -> dict[str, Any]:
        """All of it, for JSON."""
        marked = self.marked_pixels
        return {
            "scenes": self.scenes,
            "pixels": self.pixels,
            "disparity_px": self.disparity.describe(),
            "slant_px_per_px": self.slant.describe(),
            "step_px": self.step.describe(),
            "contrast": self.contrast.describe(),
            "share_beside_steps": self.beside_steps / max(self.pixels, 1),
            "share_textureless": self.textureless / max(self.pixels, 1),
            "share_occluded": self.occluded / marked if marked else None,
        }

    def lines(self) -> list[str]:
        """The gist, for people."""
        report = self.report()
        rows = {
            "disparity (px)": "disparity_px",
            "slant (px per px)": "slant_px_per_px",
            "step (px)": "step_px",
            "contrast (0..1)": "contrast",
        }
        columns = ("min", "percentile_10", "percentile_50", "percentile_90", "max")
        heads = ("min", "10 %", "median", "90 %", "max")
        lines = [f"{'':18}" + "".join(f"{head:>10}" for head in heads)]
        for title, key in rows.items():
            values = [report[key][column] for column in columns]
            cells = ("-" if value is None else f"{value:.3g}" for value in values)
            lines.append(f"{title:18}" + "".join(f"{cell:>10}" for cell in cells))
        return [*lines, ", ".join(self._shares())]

    def _shares(self) -> list[str]:
        report = self.report()
        names = {"beside_steps": "beside a step", "textureless": "textureless"}
        if self.marked_pixels:
            names["occluded"] = "occluded in some view"
        return [f"{text} {100 * report[f'share_{key}']:.1f} %" for key, text in names.items()]

    def save_plot(self, path: Path) -> None:
        """The four distributions as a picture."""
        figure = Figure(figsize=(11, 7), layout="constrained", dpi=110)
        figure.suptitle(f"{self.scenes} scenes: pixels {', '.join(self._shares())}")
        (top_left, top_right), (left, right) = figure.subplots(2, 2)
        _draw(top_left, self.disparity, "disparity (px per adjacent view)", "pixels")
        _draw(top_right, self.step, "height of steps (px)", "pairs of pixels")
        top_right.set_xscale("log")
        _draw(left, self.slant, "slant away from steps (px per px)", "pixels")
        left.set_xscale("log")
        _draw(
            right,
            self.contrast,
            f"contrast in {CONTRAST_WINDOW_PX}x{CONTRAST_WINDOW_PX} px",
            "pixels",
        )
        right.set_xscale("log")
        right.axvline(TEXTURELESS, color="tab:red", linewidth=1, label="textureless below")
        right.legend(frameon=False)
        figure.savefig(path)


def steps(truth: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Discontinuities of a disparity map (H, W) with at least 4 pixels each way.

    Returns:
        the height in px of each step between two neighbouring pixels, and the pixels (H, W) that
        a step touches.
    """
    beside = np.zeros(truth.shape, dtype=bool)
    heights = []
    for values, touched in ((truth, beside), (truth.T, beside.T)):
        difference = np.abs(np.diff(values.astype(np.float64), axis=1))
        padded = np.pad(difference, ((0, 0), (2, 2)), mode="reflect")
        width = difference.shape[1]
        around = np.stack([padded[:, i : i + width] for i in (0, 1, 3, 4)])
        # The third of four: two may belong to the other edge of a thin thing, or to the other
        # side of a crease, without hiding the one or showing the other as a step.
        slope = np.partition(around, 2, axis=0)[2]
        step = difference > np.maximum(STEP_PX, STEP_SLOPES * slope)
        heights.append(difference[step])
        touched[:, 1:] |= step
        touched[:, :-1] |= step
    return np.concatenate(heights), beside


def local_contrast(gray: NDArray[np.float32]) -> NDArray[np.float64]:
    """Standard deviation in a window around each pixel."""
    values = gray.astype(np.float64)
    mean = uniform_filter(values, CONTRAST_WINDOW_PX)
    square: NDArray[np.float64] = uniform_filter(values**2, CONTRAST_WINDOW_PX)
    deviation: NDArray[np.float64] = np.sqrt(np.maximum(square - mean**2, 0))
    return deviation


def _draw(axes: Axes, histogram: Histogram, label: str, of: str) -> None:
    axes.set_xlabel(label)
    axes.set_ylabel(f"% of {of}")
    used = np.flatnonzero(histogram.counts)
    if not used.size:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center")
        return
    start, stop = int(used[0]), int(used[-1]) + 1
    width = -(-(stop - start) // 100)  # at most 100 bars
    starts = np.arange(start, stop, width)
    shares = 100 * np.add.reduceat(histogram.counts[:stop], starts) / histogram.counts.sum()
    edges = np.append(histogram.edges[starts], histogram.edges[stop])
    axes.stairs(shares, edges, fill=True, color="tab:blue")
    axes.spines[["top", "right"]].set_visible(False)
