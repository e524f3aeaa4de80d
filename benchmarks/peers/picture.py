"""The saved comparison as a figure: accuracy against time, and maps side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from benchmarks.peers.methods import METHODS
from benchmarks.peers.tables import mean
from epinet.lightfield import LightField
from epinet.predict.pictures import COLOUR_MAP, robust_range

ERROR_LIMIT_PX = 0.3
MARKERS = "osD^v"
COLOURS = ("tab:brown", "tab:orange", "tab:gray", "tab:blue", "tab:green")


def save_picture(
    path: Path, report: dict[str, Any], lf: LightField, maps: dict[str, NDArray[np.float32]]
) -> None:
    """Above, a point for each method and set; below, the maps of one scene and their errors."""
    figure = Figure(figsize=(13, 8.6), layout="constrained", dpi=100)
    above, below = cast(Any, figure.subfigures(2, 1, height_ratios=(1, 1.25)))
    _accuracy_against_time(above, report)
    _maps(below, lf, maps)
    figure.savefig(path)


def _accuracy_against_time(figure: Any, report: dict[str, Any]) -> None:
    panels = figure.subplots(1, len(report["sets"]), squeeze=False)[0]
    for panel, (name, scenes) in zip(panels, report["sets"].items(), strict=True):
        for method, marker, colour in zip(METHODS, MARKERS, COLOURS, strict=True):
            cpu_s, bad, mb = (
                mean(scenes, method, key) for key in ("cpu_s", "badpix_0.07", "peak_memory_mb")
            )
            if cpu_s is None or bad is None:
                continue
            label = f"{method}, {mb:,.0f} MB"
            panel.plot(cpu_s, bad, marker, color=colour, ms=9, label=label)
        count = f"mean of {len(scenes)} scenes" if len(scenes) > 1 else "one scene"
        height, width = next(iter(scenes.values()))["size"]
        panel.set_title(f"{name}: {count}, {width}x{height} px")
        panel.set_xlabel(f"CPU s a scene, {report['threads']} thread(s), {report['machine']}")
        panel.set_ylabel("BadPix(.07), %")
        panel.set_xscale("log")
        panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.set_ylim(bottom=0)
        panel.grid(alpha=0.3, which="both")
        panel.legend(fontsize=8)


def _maps(figure: Any, lf: LightField, maps: dict[str, NDArray[np.float32]]) -> None:
    assert lf.truth is not None
    upper, lower = figure.subplots(2, 1 + len(maps))
    low, high = robust_range(lf.truth)
    upper[0].imshow(lf.rgb(*lf.centre))
    upper[0].set_title(f"{lf.source.name if lf.source else ''}: centre view")
    lower[0].imshow(lf.truth, cmap=COLOUR_MAP, vmin=low, vmax=high)
    lower[0].set_title(f"truth, {low:.1f}..{high:.1f} px")
    for k, (method, disparity) in enumerate(maps.items(), 1):
        upper[k].imshow(disparity, cmap=COLOUR_MAP, vmin=low, vmax=high)
        upper[k].set_title(method)
        shown = lower[k].imshow(
            disparity - lf.truth, cmap="coolwarm", vmin=-ERROR_LIMIT_PX, vmax=ERROR_LIMIT_PX
        )
    for axes in (*upper, *lower):
        axes.axis("off")
    figure.colorbar(shown, ax=lower, label="estimate - truth, px", extend="both")
