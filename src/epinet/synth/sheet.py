"""A page of rendered scenes, for people to look at before anything is trained on them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from epinet.lightfield import LightField

SCENES_PER_PAGE = 8

MASKS = {
    "planes": ("planes", "#4c8bf5"),
    "smooth_surfaces": ("smooth surfaces", "#2fb47c"),
    "discontinuities": ("discontinuities", "#f5b700"),
    "occluded": ("occluded in a view", "#e0383e"),
    "invalid": ("invalid", "#b04ad8"),
}
"""Title and colour of each mask, later ones drawn over earlier ones."""

_DPI = 120
_PANEL_IN, _GAP_IN, _EDGE_IN = 3.6, 0.3, 0.45
_TITLE_IN, _STRIP_IN, _FOOT_IN = 0.3, 0.75, 0.42


@dataclass(frozen=True)
class _Row:
    """What is drawn of a scene; the views themselves need not stay in memory."""

    title: str
    centre: NDArray[np.float32]
    line: int
    """Image row of the EPI."""
    epi: NDArray[np.float32]
    truth: NDArray[np.float32] | None
    masks: dict[str, NDArray[np.bool_]]


def save_sheet(path: Path, scenes: Iterable[LightField]) -> None:
    """A row per scene: centre view over an EPI, disparity, and masks.

    The EPI holds the marked image row of every view of the centre row, the leftmost view on top:
    a point of disparity d runs down it by d pixels to the left per view.
    """
    rows = [_row(lf) for lf in scenes]
    heights = [_PANEL_IN * row.centre.shape[0] / row.centre.shape[1] for row in rows]
    page = [_TITLE_IN + _GAP_IN / 4 + height + _STRIP_IN + _FOOT_IN for height in heights]
    width, height = 3 * _PANEL_IN + 2 * _GAP_IN + 2 * _EDGE_IN, sum(page)
    figure = Figure(figsize=(width, height), dpi=_DPI)
    top = 0.0
    for row, panel_height, row_height in zip(rows, heights, page, strict=True):
        _draw_row(figure, row, top, panel_height)
        top += row_height
    figure.savefig(path)


def _row(lf: LightField) -> _Row:
    row, col = lf.centre
    line = lf.size[0] // 2
    columns = [c for c in range(lf.grid[1]) if lf.present[row, c]]
    (rows, cols), (height, width) = lf.grid, lf.size
    text = f"{rows}x{cols} views{'' if lf.present.all() else ' (star)'}, {width}x{height} px"
    name = lf.source.name if lf.source else "scene"
    return _Row(
        title=f"{name}: {text}",
        centre=lf.rgb(row, col),
        line=line,
        epi=np.stack([lf.rgb(row, c)[line] for c in columns]),
        truth=lf.truth,
        masks={name: lf.masks[name] for name in MASKS if name in lf.masks},
    )


def _draw_row(figure: Figure, row: _Row, top: float, height: float) -> None:
    """Draw into the page `top` inches below its upper edge, panels `height` inches high."""
    panels = top + _TITLE_IN
    strip = panels + height + _GAP_IN / 4
    lefts = [_EDGE_IN + i * (_PANEL_IN + _GAP_IN) for i in range(3)]
    view, disparity, overlay = (_place(figure, left, panels, height) for left in lefts)
    epi, bar, legend = (_place(figure, left, strip, _STRIP_IN) for left in lefts)

    view.set_title(row.title, loc="left", fontsize=9, parse_math=False)
    view.imshow(row.centre, aspect="auto")
    for colour, width in (("black", 2.4), ("white", 1.0)):  # seen on dark and on bright
        view.axhline(row.line, color=colour, linewidth=width)
    epi.imshow(row.epi, aspect="auto", interpolation="nearest")
    epi.set_xlabel("EPI of the marked row: a line per view, left to right", fontsize=8, labelpad=3)

    _draw_disparity(disparity, bar, row.truth)
    _draw_masks(overlay, legend, row)


def _place(
    figure: Figure, left: float, top: float, height: float, width: float = _PANEL_IN
) -> Axes:
    """Axes without ticks at a place in inches from the page's top left corner."""
    page_width, page_height = figure.get_size_inches()
    bottom = page_height - top - height
    axes = figure.add_axes(
        (left / page_width, bottom / page_height, width / page_width, height / page_height)
    )
    axes.set(xticks=[], yticks=[])
    return axes


def _draw_disparity(axes: Axes, bar: Axes, truth: NDArray[np.float32] | None) -> None:
    bar.axis("off")
    if truth is None or not np.isfinite(truth).any():
        axes.set_title("no truth", loc="left", fontsize=9)
        axes.axis("off")
        return
    low, high = float(np.nanmin(truth)), float(np.nanmax(truth))
    axes.set_title(f"disparity {low:.2f} to {high:.2f} px", loc="left", fontsize=9)
    shown = axes.imshow(truth, cmap="viridis", aspect="auto", interpolation="nearest")
    inner = bar.inset_axes((0.0, 0.7, 1.0, 0.24))
    bar.figure.colorbar(shown, cax=inner, orientation="horizontal")
    inner.tick_params(labelsize=8)
    inner.set_xlabel("px per adjacent view, larger is nearer", fontsize=8, labelpad=3)


def _draw_masks(axes: Axes, legend: Axes, row: _Row) -> None:
    legend.axis("off")
    picture = np.repeat(0.35 + 0.65 * row.centre.mean(axis=2, keepdims=True), 3, axis=2)
    patches: list[Any] = []
    for name, mask in row.masks.items():
        title, colour = MASKS[name]
        picture[mask] = 0.45 * picture[mask] + 0.55 * np.array(to_rgb(colour))
        patches.append(Patch(color=colour, label=f"{title} {100 * mask.mean():.1f} %"))
    axes.set_title("masks" if patches else "no masks", loc="left", fontsize=9)
    axes.imshow(picture, aspect="auto", interpolation="nearest")
    if patches:
        legend.legend(
            handles=patches,
            loc="upper left",
            ncols=2,
            fontsize=8,
            frameon=False,
            borderaxespad=0,
            borderpad=0,
            handlelength=1.2,
            columnspacing=1.0,
        )
