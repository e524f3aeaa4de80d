"""The report of an evaluation: a page, CSV, JSON, tables in LaTeX, and the figures as files."""

from __future__ import annotations

from pathlib import Path

from epinet.benchmark import pictures
from epinet.benchmark.evaluate import Evaluation
from epinet.benchmark.latex import as_latex
from epinet.benchmark.page import drawn_figures, render
from epinet.benchmark.table import as_csv, as_json
from epinet.io.atomic import atomic_path
from epinet.io.images import write_png
from epinet.predict.pictures import robust_range

FIGURES = "figures"


def write_report(evaluation: Evaluation, folder: Path) -> Path:
    """Write report.html, scores.csv, scores.json, scores.tex and `figures` into a folder.

    The figures are those of the page in PDF, and SCENE_METHOD_map.png and SCENE_METHOD_error.png
    in its colours, a pixel each.

    Returns:
        The page's path.

    Raises:
        InputError: a centre view cannot be read, or they cannot be written.
    """
    drawn = drawn_figures(evaluation)
    files = {
        "scores.csv": as_csv(evaluation).encode(),
        "scores.json": as_json(evaluation).encode(),
        "scores.tex": as_latex(evaluation).encode(),
        "report.html": render(evaluation, drawn).encode(),
    } | {f"{FIGURES}/{name}.pdf": figure.pdf for name, figure in drawn.items()}
    for name, content in files.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_bytes(content)
    _write_maps(evaluation, folder / FIGURES)
    return folder / "report.html"


def _write_maps(evaluation: Evaluation, folder: Path) -> None:
    for scene in evaluation.scenes:
        bounds = robust_range(scene.truth)
        for method in evaluation.methods:
            estimate = evaluation.estimate(method, scene)
            name = f"{scene.name}_{method.name}".replace("/", "_")
            write_png(folder / f"{name}_map.png", pictures.disparity_picture(estimate, bounds))
            error = pictures.error_picture(estimate, scene.truth)
            write_png(folder / f"{name}_error.png", error)
