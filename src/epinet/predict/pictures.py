"""Pictures of a result, for people to look at."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from numpy.typing import NDArray

from epinet.terminal import printable

if TYPE_CHECKING:
    from epinet.predict.result import Result

COLOUR_MAP = "viridis"
ERROR_LIMIT_PX = 0.1
"""The error map's colours saturate here, about the benchmark's BadPix(0.07)."""


def robust_range(values: NDArray[np.float32]) -> tuple[float, float]:
    """Bounds for colours: 0.5th and 99.5th percentile of the finite values."""
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, [0.5, 99.5]) if finite.size else (0.0, 1.0)
    return float(low), float(max(high, low + 1e-3))


def save_disparity(path: Path, disparity: NDArray[np.float32]) -> None:
    """The map in colour at its own resolution, with a colour bar."""
    height, width = disparity.shape
    dpi, bar_px, edge_px = 100, 90, 10
    low, high = robust_range(disparity)
    total_width, total_height = width + bar_px + edge_px, height + 2 * edge_px
    figure = Figure(figsize=(total_width / dpi, total_height / dpi), dpi=dpi)
    frame = (0, edge_px / total_height, width / total_width, height / total_height)
    axes = figure.add_axes(frame)
    image = axes.imshow(
        disparity, cmap=COLOUR_MAP, vmin=low, vmax=high, interpolation="nearest", aspect="auto"
    )
    axes.axis("off")
    bar_left = (width + edge_px) / total_width
    bar = figure.add_axes((bar_left, frame[1], 14 / total_width, frame[3]))
    figure.colorbar(image, cax=bar)
    if height >= 200:
        bar.set_ylabel("disparity (px)")
    figure.savefig(path, dpi=dpi)


def save_preview(path: Path, result: Result) -> None:
    """Centre view, disparity and confidence side by side, and the error where there is truth."""
    truth = result.lightfield.truth
    panels = 3 if truth is None else 4
    height, width = result.disparity.shape
    panel_width = 4.2
    size = (panels * panel_width, panel_width * height / width + 1.1)
    figure = Figure(figsize=size, layout="constrained", dpi=110)
    axes: list[Any] = list(figure.subplots(1, panels))
    low, high = robust_range(result.disparity)
    shown = axes[0].imshow(result.centre_view)
    source = result.lightfield.source
    axes[0].set_title("centre view" if source is None else drawable(source.name), parse_math=False)
    # As high as its neighbours with their colour bars.
    figure.colorbar(shown, ax=axes[0], location="bottom", label=" ").ax.set_visible(False)
    shown = axes[1].imshow(result.disparity, cmap=COLOUR_MAP, vmin=low, vmax=high)
    axes[1].set_title("disparity")
    figure.colorbar(shown, ax=axes[1], location="bottom", label="px per adjacent view")
    shown = axes[2].imshow(result.confidence, cmap="gray", vmin=0, vmax=1)
    axes[2].set_title("confidence")
    figure.colorbar(shown, ax=axes[2], location="bottom", label=result.confidence_means)
    if truth is not None:
        error = result.disparity - truth
        limit = ERROR_LIMIT_PX
        shown = axes[3].imshow(error, cmap="coolwarm", vmin=-limit, vmax=limit)
        axes[3].set_title(_score_line(result.scores))
        figure.colorbar(
            shown,
            ax=axes[3],
            location="bottom",
            label="estimate - truth (px)",
            extend="both",
            ticks=[-limit, 0, limit],
        )
    for panel in axes:
        panel.set_xticks([])
        panel.set_yticks([])
    figure.savefig(path)


def drawable(name: str) -> str:
    """A name as it can be drawn: characters that the font lacks become question marks."""
    font = get_font(findfont(FontProperties()))
    return "".join(c if font.get_char_index(ord(c)) else "?" for c in printable(name))


def _score_line(scores: dict[str, float] | None) -> str:
    if scores is None:
        return "error"
    return f"BadPix(.07) {scores['badpix_0.07']:.2f} %, MSE x100 {scores['mse_x100']:.2f}"
