"""The strip of pictures at the top of the README: views, map, surface and focus of a light field.

`python -m benchmarks.strip SCENE -o docs/images/strip.jpg`; the picture there shows `toys` of the
path-traced scenes, made by
`python -m epinet.synth.pathtraced OUT --scenes toys --size 288 --samples 36 --assets ASSETS`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from matplotlib.figure import Figure
from numpy.typing import NDArray

import epinet
from epinet.effects.refocus import refocus
from epinet.lightfield import LightField

TURN_DEG = 18
"""How far the surface is turned."""


def main(
    scene: Annotated[Path, typer.Argument(help="A light field.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write.")],
) -> None:
    """Draw the strip."""
    lf = epinet.read_light_field(scene)
    result = epinet.load_model().predict(lf)
    near_px = float(np.percentile(result.disparity, 70))
    panels: list[tuple[str, NDArray[Any], dict[str, Any]]] = [
        (f"{lf.grid[0]}x{lf.grid[1]} views", _views(lf), {}),
        ("disparity", result.disparity, {"cmap": "viridis"}),
        ("surface, seen from the side", _turned(result.disparity, result.centre_view), {}),
        ("focused on what is near", refocus(lf, near_px, result.disparity), {}),
    ]
    figure = Figure(figsize=(3 * len(panels), 3.3), dpi=100, layout="constrained")
    for axes, (name, picture, how) in zip(figure.subplots(1, len(panels)), panels, strict=True):
        axes.imshow(picture, interpolation="lanczos", **how)
        axes.set_title(name, fontsize=11)
        axes.axis("off")
    figure.savefig(output, pil_kwargs={"quality": 88} if output.suffix == ".jpg" else {})


def _views(lf: LightField) -> NDArray[np.float32]:
    """The corner views behind the centre view, each a bit lower and to the right."""
    last = lf.grid[0] - 1
    height, width = lf.size
    step = height // 8
    sheet = np.ones((height + 2 * step, width + 2 * step, 3), np.float32)
    for k, (row, col) in enumerate([(0, 0), (last, last), lf.centre]):
        view = lf.rgb(row, col)
        view[[0, -1]] = view[:, [0, -1]] = 1
        sheet[k * step : k * step + height, k * step : k * step + width] = view
    return sheet


def _turned(disparity: NDArray[np.float32], picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The surface seen from the side, as far as the centre view knows it; white elsewhere."""
    height, width = disparity.shape
    fine = 4
    d = disparity.repeat(fine, 0).repeat(fine, 1)
    colours = picture.repeat(fine, 0).repeat(fine, 1)
    jump = np.maximum(*(np.abs(g) for g in np.gradient(disparity))).repeat(fine, 0).repeat(fine, 1)
    y, x = np.mgrid[: d.shape[0], : d.shape[1]] / fine
    middle = float(np.median(disparity))
    shift = np.tan(np.radians(TURN_DEG)) * (d - middle) * width / 12
    to_x = np.rint(x + shift).astype(int)
    to_y = np.rint(y - 0.3 * shift).astype(int)
    seen = (jump < 0.25) & (to_x >= 0) & (to_x < width) & (to_y >= 0) & (to_y < height)
    order = np.argsort(d[seen], kind="stable")  # the nearest comes last
    out = np.full((height, width, 3), 255, np.uint8)
    out[to_y[seen][order], to_x[seen][order]] = colours[seen][order]
    return out


if __name__ == "__main__":
    typer.run(main)
