"""The pictures of each scene in the page: its views, and every method's map and errors."""

from __future__ import annotations

import re
from html import escape

import numpy as np

from epinet.benchmark import pictures
from epinet.benchmark.evaluate import Evaluation, Method
from epinet.benchmark.pictures import Kind, Rgb
from epinet.benchmark.scenes import Scene
from epinet.benchmark.table import score_text
from epinet.metrics.general import badpix
from epinet.predict.pictures import COLOUR_MAP, robust_range

PICTURE_PX, THUMBNAIL_PX = 272, 140
THRESHOLDS_PX = (0.07, 0.03)
OVERVIEW_THRESHOLD_PX = 0.03

COLUMNS = 2 + len(THRESHOLDS_PX)
"""Pictures of a method: its map, its signed error, its bad pixels at each threshold."""


def overview(evaluation: Evaluation) -> str:
    """Maps and BadPix(.03) of all methods in one table, as in the paper's figure 10."""
    methods = "".join(f'<th colspan="2">{escape(m.name)}</th>' for m in evaluation.methods)
    rows = [f"<thead><tr><th>scene</th><th>truth</th>{methods}</tr></thead><tbody>"]
    for scene in evaluation.scenes:
        bounds = robust_range(scene.truth)
        cells = [
            f'<td><a href="#{_anchor(scene)}">{escape(scene.name)}</a></td>',
            f"<td>{_thumbnail(pictures.disparity_picture(scene.truth, bounds), scene.name)}</td>",
        ]
        for method in evaluation.methods:
            map_ = evaluation.estimate(method, scene)
            label = f"{scene.name}, {method.name}"
            bad = pictures.badpix_picture(
                map_, scene.truth, OVERVIEW_THRESHOLD_PX, evaluation.border_px
            )
            cells.append(
                f"<td>{_thumbnail(pictures.disparity_picture(map_, bounds), label)}</td>"
                f"<td>{_thumbnail(bad, label, 'classes')}</td>"
            )
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return (
        "<p>Disparity and BadPix(.03) of each method (the paper's figure 10): green is within "
        ".03 px of the truth, red is not.</p>"
        f'<div class="wide"><table class="overview">{"".join(rows)}</tbody></table></div>'
    )


def legend(evaluation: Evaluation) -> str:
    """What the colours of the pictures mean."""
    good, bad = (
        pictures.colour(pictures.BADPIX_COLOURS, share) for share in (pictures.GOOD, pictures.BAD)
    )
    limit = pictures.ERROR_LIMIT_PX
    missing = "#{:02x}{:02x}{:02x}".format(*pictures.MISSING)
    keys = [
        f"disparity: far{_bar(COLOUR_MAP)}near",
        f"error: {limit:g} px too near{_bar(pictures.ERROR_COLOURS)}{limit:g} px too far",
        f"{_swatch(good)}within the threshold",
        f"{_swatch(bad)}beyond it, or missing",
        f"{_swatch(missing)}no estimate",
    ]
    return (
        "<p>Pictures show the truth of low resolution, whatever the scores used. Gray is not "
        f"scored: the border of {evaluation.border_px} px, and pixels without truth.</p>"
        f'<div class="legend">{"".join(f"<span>{key}</span>" for key in keys)}</div>'
    )


def card(evaluation: Evaluation, scene: Scene) -> str:
    """Centre view and truth, then a row of pictures for each method."""
    low, high = robust_range(scene.truth)
    known = 100 * float(np.mean(np.isfinite(scene.truth)))
    about = (
        f"{scene.size[1]}x{scene.size[0]} px, truth {low:.2f}..{high:.2f} px on {known:.0f} % "
        "of the pixels"
    )
    centre = scene.centre_view()
    beside = [
        "<span></span>" if centre is None else _picture(centre, "centre view", kind="photograph"),
        _picture(pictures.disparity_picture(scene.truth, (low, high)), "truth"),
    ]
    rows = [_row(evaluation, scene, method, (low, high)) for method in evaluation.methods]
    if len(rows) == 1:
        columns = len(beside) + COLUMNS
        cells = "".join(beside) + rows[0]
    else:
        columns = 1 + COLUMNS
        beside += ["<span></span>"] * (len(rows) - len(beside))
        cells = "".join(left + row for left, row in zip(beside, rows, strict=True))
    return (
        f'<article id="{_anchor(scene)}"><div class="heading">'
        f"<h3>{escape(scene.name)}</h3><span>{about}</span></div>"
        f'<div class="maps" style="grid-template-columns: repeat({columns}, 1fr)">{cells}</div>'
        "</article>"
    )


def _row(evaluation: Evaluation, scene: Scene, method: Method, bounds: tuple[float, float]) -> str:
    """A method's map, its signed error and where it is bad, with the scores below."""
    map_ = evaluation.estimate(method, scene)
    texts = {
        metric.id: f"{score_text(value)} {metric.unit}"
        for metric in evaluation.metrics
        if (value := evaluation.value(method, scene, metric)) is not None
    }
    seconds = f", {texts['runtime']}" if "runtime" in texts else ""
    mse = f", MSE x100 {texts['mse_x100']}" if "mse_x100" in texts else ""
    cells = [
        _picture(
            pictures.disparity_picture(map_, bounds), f"disparity{seconds}", method=method.name
        ),
        _picture(pictures.error_picture(map_, scene.truth), f"error{mse}"),
    ]
    for threshold in THRESHOLDS_PX:
        picture = pictures.badpix_picture(map_, scene.truth, threshold, evaluation.border_px)
        metric = badpix(threshold)
        caption = f"{metric.name} {texts.get(metric.id, '')}"
        cells.append(_picture(picture, caption, kind="classes"))
    return "".join(cells)


def _picture(picture: Rgb, caption: str, *, method: str = "", kind: Kind = "map") -> str:
    uri = pictures.data_uri(picture, PICTURE_PX, kind)
    text, name = escape(caption), escape(method)
    before = f'<b class="ours">{name}</b> ' if method else ""
    return (
        f'<figure><img src="{uri}" alt="{name} {text}"><figcaption>{before}{text}</figcaption>'
        "</figure>"
    )


def _thumbnail(picture: Rgb, label: str, kind: Kind = "map") -> str:
    return f'<img src="{pictures.data_uri(picture, THUMBNAIL_PX, kind)}" alt="{escape(label)}">'


def _anchor(scene: Scene) -> str:
    return "scene-" + re.sub(r"\W", "-", scene.name)


def _bar(name: str) -> str:
    return f'<i style="background: {pictures.gradient(name)}"></i>'


def _swatch(colour: str) -> str:
    return f'<i class="swatch" style="background: {colour}"></i>'
