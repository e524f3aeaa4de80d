"""The paper's real-data figures (11 and 12) on a Lytro capture, and a mesh in true size beside it.

    python -m benchmarks.real_captures FOLDER

FOLDER holds lytro_2067, kitchen and reference/lytro_2067_epinet9x9.pfm. Written are
docs/real_captures.md, its pictures in docs/images, and benchmarks/results/real_captures.json.
Pictures that show the views themselves (the centre view, meshes in its colours, anything of
kitchen, which is CC BY-NC-SA) go to out/real_captures only: no data set is committed. It needs
Mitsuba (pip install 'epinet[render]') for the renderings of meshes.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from benchmarks.real_light_fields import CLOSE_PX, REFERENCE_BORDER_PX, agreement
from benchmarks.write_results import table
from epinet.arguments import Parser
from epinet.inspect.alignment import estimate_alignment
from epinet.io import read_light_field, read_pfm
from epinet.lightfield import LightField
from epinet.metrics.disparity import BORDER_PX
from epinet.predict.estimator import load_model
from epinet.predict.pictures import COLOUR_MAP, robust_range
from epinet.refine import compensated, refined
from epinet.synth.pathtraced.backend import load_mitsuba

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "real_captures.md"
IMAGES = ROOT / "docs" / "images"
RESULTS = ROOT / "benchmarks" / "results" / "real_captures.json"

CAPTURE, SCENE = "lytro_2067", "kitchen"
NETWORKS = {"epinet": "EPINET", "sweepnet": "SweepNet"}
SIDES = (7, 9)
DETAIL = (slice(60, 190), slice(130, 330))
"""Rows and columns: the neck and the first plates of the capture: edges before a far ground."""
MIN_CONFIDENCE = 0.5
MESH_OPTIONS = {CAPTURE: ["--not-metric"], SCENE: []}
MESH_VIEWS_DEG = {CAPTURE: ((-30, 15), (25, 15)), SCENE: ((-25, 20), (30, 20))}
"""(to the right, up) from where the camera stood, about the middle of the mesh."""
PICTURE_PX = (640, 480)
SAMPLES = 16

Map = NDArray[np.float32]


@dataclass(frozen=True)
class Estimate:
    """What one network says of so many views, before and after the median."""

    raw: Map
    median: Map
    weights: str
    """Name and sha256."""


def estimate(lf: LightField, model: str, side: int) -> Estimate:
    """As `epinet predict --refine` does it, step by step: both maps are of compensated views."""
    used = lf.central(side)
    alignment = estimate_alignment(used)
    if alignment is not None:
        used = compensated(used, alignment)
    estimator = load_model(model=model)
    result = estimator.predict(used, refine=False)
    guide = np.ascontiguousarray(used.unit(*used.centre))
    images = (torch.from_numpy(image) for image in (result.disparity, guide, result.confidence))
    file = Path(result.weights["file"])
    digest = next(w.sha256 for w in estimator.weights if w.source == str(file))
    return Estimate(result.disparity, refined(*images).numpy(), f"{file.stem} {digest}")


def difference(a: Map, b: Map) -> dict[str, float]:
    """How two maps differ, the benchmark's border left out."""
    inner = slice(BORDER_PX, -BORDER_PX)
    apart = np.abs(a - b)[inner, inner]
    return {
        "median_px": round(float(np.median(apart)), 4),
        "mean_px": round(float(apart.mean()), 4),
        "percent_above_0.07": round(100 * float((apart > CLOSE_PX).mean()), 2),
    }


def compare(estimates: dict[int, Estimate], reference: Map) -> dict[str, Any]:
    """All figures of one network."""
    small, large = (estimates[side] for side in SIDES)
    return {
        "weights": {f"{side}x{side}": e.weights for side, e in estimates.items()},
        "9x9_to_7x7": {
            "raw": difference(large.raw, small.raw),
            "median": difference(large.median, small.median),
        },
        "raw_to_median": {f"{s}x{s}": difference(e.raw, e.median) for s, e in estimates.items()},
        "reference": {
            f"{side}x{side}": {
                "raw": agreement(e.raw, reference, None),
                "median": agreement(e.median, reference, None),
            }
            for side, e in estimates.items()
        },
    }


def run(command: list[str]) -> str:
    """What a command of epinet prints."""
    whole = [sys.executable, "-m", "epinet", *command]
    return subprocess.run(whole, check=True, stdout=subprocess.PIPE, text=True).stdout


def make_mesh(folder: Path, name: str, out: Path) -> dict[str, Any]:
    """Predict and mesh by the commands that a user would give."""
    predict = ["predict", str(folder / name), "-o", str(out), "--force"]
    options = ["--min-confidence", str(MIN_CONFIDENCE), *MESH_OPTIONS[name]]
    mesh = ["mesh", str(out / name), "-o", str(out / f"{name}.ply"), *options]
    run(predict)
    said = run(mesh).splitlines()
    solid = trimesh.load_mesh(out / f"{name}.ply", process=False)
    width, height, depth = (round(float(mm), 1) for mm in np.ptp(solid.vertices, axis=0))
    record = json.loads((out / name / "run.json").read_text())
    return {
        "commands": [
            f"epinet predict {name} -o out",
            f"epinet mesh out/{name} -o {name}.ply {' '.join(options)}",
        ],
        "refined": record["settings"]["refine"],
        "printed": said[:2],
        "points": len(solid.vertices),
        "faces": len(solid.faces),
        "width_height_depth": [width, height, depth],
        "camera": record["camera"],
    }


def by_depth(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """(N, 3) colours of the points, in the colours of a disparity map."""
    nearness = (-1 / mesh.vertices[:, 2]).astype(np.float32)
    low, high = np.percentile(nearness, [1, 98])
    return np.asarray(colormaps[COLOUR_MAP]((nearness - low) / (high - low))[:, :3])


def by_view(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """(N, 3) the centre view's colours, its white at their 99th percentile as captures are dark."""
    colours = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255
    return np.clip(colours / np.percentile(colours, 99), 0, 1)


def render(
    mi: Any, mesh: trimesh.Trimesh, colours: NDArray[np.float64], angles_deg: tuple[float, float]
) -> NDArray[np.uint8]:
    """(H, W, 3) the mesh from aside, on white.

    Points shine in their colour, shaded by a lamp above the camera: shadows of a surface that is
    rough by a fraction of a pixel would only be noise.
    """
    lamp = np.array([-0.4, 0.6, 0.7])
    facing = np.abs(mesh.vertex_normals @ lamp) / np.linalg.norm(lamp)
    linear = colours**2.2 * (0.5 + 0.5 * facing[:, None])
    properties = mi.Properties()
    properties["emitter"] = mi.load_dict(
        {"type": "area", "radiance": {"type": "mesh_attribute", "name": "vertex_color"}}
    )
    shape = mi.Mesh("mesh", len(mesh.vertices), len(mesh.faces), props=properties)
    shape.add_attribute("vertex_color", 3, linear.astype(np.float32).ravel())
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 1},
            "sensor": oblique(mi, mesh.vertices, angles_deg),
            "sky": {"type": "constant", "radiance": 1.0},
            "mesh": shape,
        }
    )
    image = mi.util.convert_to_bitmap(mi.render(scene, spp=SAMPLES))
    return np.array(image)[..., :3]


def oblique(
    mi: Any, points: NDArray[np.float64], angles_deg: tuple[float, float]
) -> dict[str, Any]:
    """A camera turned about the middle of the points, at the distance of the true one."""
    middle = np.median(points, axis=0)
    right, up = np.radians(angles_deg)
    away = [math.sin(right) * math.cos(up), math.sin(up), math.cos(right) * math.cos(up)]
    place = middle + 1.15 * np.linalg.norm(middle) * np.array(away)
    look = mi.ScalarTransform4f().look_at(place.tolist(), middle.tolist(), [0, 1, 0])
    width, height = PICTURE_PX
    return {
        "type": "perspective",
        "fov": 45,
        "to_world": look,
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
    }


def show_maps(
    path: Path, estimates: dict[str, dict[int, Estimate]], part: tuple[slice, slice]
) -> None:
    """A row for each network; 7x7 and 9x9 views, raw and after the median, on one scale."""
    low, high = robust_range(estimates["sweepnet"][9].median)
    height, width = estimates["sweepnet"][9].raw[part].shape
    across = 2.9
    size = (4 * across + 0.8, 2 * (across * height / width + 0.3))
    figure = Figure(figsize=size, layout="constrained", dpi=110)
    axes = figure.subplots(2, 4)
    for row, (model, of_model) in zip(axes, estimates.items(), strict=True):
        panels = [(s, kind) for s in SIDES for kind in ("raw", "median")]
        for panel, (side, kind) in zip(row, panels, strict=True):
            map_ = getattr(of_model[side], kind)[part]
            shown = panel.imshow(map_, cmap=COLOUR_MAP, vmin=low, vmax=high, interpolation="none")
            panel.set_title(f"{NETWORKS[model]}, {side}x{side} views, {kind}", fontsize=9)
            panel.set_xticks([])
            panel.set_yticks([])
    figure.colorbar(shown, ax=axes, label="px per adjacent view", shrink=0.8, pad=0.01)
    figure.savefig(path, pil_kwargs={"quality": 88})


def show_meshes(out: Path, mi: Any) -> None:
    """Each mesh from both sides, in colours of its depth and in those of its view."""
    for name, views in MESH_VIEWS_DEG.items():
        mesh = trimesh.load_mesh(out / f"{name}.ply", process=False)
        for kind, colours in (("depth", by_depth(mesh)), ("view", by_view(mesh))):
            sides = [render(mi, mesh, colours, angles) for angles in views]
            ours = name == CAPTURE and kind == "depth"
            path = (IMAGES if ours else out) / f"{name}_mesh_{kind}.jpg"
            Image.fromarray(np.concatenate(sides, axis=1)).save(path, quality=85)


def page(report: dict[str, Any]) -> str:
    """docs/real_captures.md."""
    networks, meshes = report["networks"], report["meshes"]
    rows = []
    for model, r in networks.items():
        apart, changed = r["9x9_to_7x7"], r["raw_to_median"]
        rows += [
            [
                NETWORKS[model],
                kind,
                f"{apart[kind]['median_px']:.3f} px",
                f"{apart[kind]['percent_above_0.07']:.1f} %",
                *(
                    f"{r['reference'][f'{s}x{s}'][kind]['percent_within_0.07']:.1f} %"
                    for s in SIDES
                ),
                *(
                    f"{changed[f'{s}x{s}']['percent_above_0.07']:.1f} %"
                    if kind == "median"
                    else "-"
                    for s in SIDES
                ),
            ]
            for kind in ("raw", "median")
        ]
    head = ["network", "map", "9x9 - 7x7, median", "above .07 px"]
    head += [f"{s}x{s}, reference within .07 px" for s in SIDES]
    head += [f"{s}x{s}, changed by more than .07 px" for s in SIDES]
    lytro, kitchen = meshes[CAPTURE], meshes[SCENE]
    width, height, depth = kitchen["width_height_depth"]
    parts = [
        "# Real captures",
        "Written by `python -m benchmarks.real_captures FOLDER`; all figures, and the sha256 of "
        "the weights, are in [real_captures.json](../benchmarks/results/real_captures.json). It is "
        "what the paper shows in its figures 11 and 12, on the capture that came with its code: "
        f"`{CAPTURE}`, a Lytro Illum's 9x9 views of 552x383 px. Nothing here was trained on it or "
        "tuned to it, and there is no truth for it.",
        "## 7x7 and 9x9 views, with and without the weighted median",
        "![maps](images/lytro_2067_maps.jpg)",
        "The neck and the first plates:",
        "![details](images/lytro_2067_details.jpg)",
        "All maps have one scale of colours. The views were put in place and exposed alike before "
        '([refinement](refinement.md)), for the raw maps too; "median" is the weighted median '
        "with its filling of holes, as `epinet predict --refine` has it.",
        table(head, rows),
        f"A border of {BORDER_PX} px is left out ({REFERENCE_BORDER_PX} px against the reference). "
        "The corners of the views are black: nothing can "
        "be known there, but they are counted. The reference is the map that the "
        "reference implementation gives of 9x9 views: to be near it is to agree with another "
        "estimate, not to be right.",
        "## The mesh, not metric",
        code(lytro),
        "![mesh](images/lytro_2067_mesh_depth.jpg)",
        "Seen from both sides, in the colours of its disparity. The capture came without "
        "calibration, so **this mesh is not metric**: a field of view and the depths are made up "
        "(`--not-metric`), and lengths mean nothing. "
        f"{lytro['points']} points, {lytro['faces']} faces. White is what the centre view does not "
        "see: the mesh is cut at depth edges.",
        "## A metric one",
        code(kitchen),
        f"`{SCENE}` of the 4D Light Field Benchmark comes with its camera (`parameters.cfg`), so "
        f"its mesh is in mm: {width:.0f} wide, {height:.0f} high, {depth:.0f} deep, "
        f"{kitchen['points']} points, {kitchen['faces']} faces. It says:",
        "\n".join(f"    {line}" for line in kitchen["printed"]),
        "Its walls and worktop meet at right angles ([how exact](camera_to_mesh.md#how-exact)). "
        "Pixels of a confidence below "
        f"{MIN_CONFIDENCE:g} are left out.",
        "The script renders this mesh, and both in the colours of their views, to "
        "`out/real_captures`. They are not shown here: no data set is committed, and the "
        "benchmark's scenes are CC BY-NC-SA 4.0 (Honauer, Johannsen, Kondermann, Goldluecke, "
        "ACCV 2016).",
    ]
    return "\n\n".join(parts) + "\n"


def code(mesh: dict[str, Any]) -> str:
    return "\n".join(f"    {command}" for command in mesh["commands"])


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "real_captures")
    args = parser.parse_args()
    mi = load_mitsuba()
    args.out.mkdir(parents=True, exist_ok=True)
    IMAGES.mkdir(exist_ok=True)
    meshes = {name: make_mesh(args.folder, name, args.out) for name in (CAPTURE, SCENE)}
    lf = read_light_field(args.folder / CAPTURE)
    estimates = {m: {side: estimate(lf, m, side) for side in SIDES} for m in NETWORKS}
    by_command = read_pfm(args.out / CAPTURE / "disparity.pfm")
    if not np.array_equal(by_command, estimates["sweepnet"][9].median):
        raise SystemExit("the map of epinet predict is not the one shown here")
    reference = read_pfm(args.folder / "reference" / f"{CAPTURE}_epinet9x9.pfm")
    report = {
        "capture": CAPTURE,
        "border_px": BORDER_PX,
        "networks": {m: compare(e, reference) for m, e in estimates.items()},
        "meshes": meshes,
        "rendering": {"mitsuba": f"{mi.__version__} {mi.variant()}", "samples": SAMPLES},
    }
    whole = (slice(None), slice(None))
    show_maps(IMAGES / f"{CAPTURE}_maps.jpg", estimates, whole)
    show_maps(IMAGES / f"{CAPTURE}_details.jpg", estimates, DETAIL)
    show_meshes(args.out, mi)
    RESULTS.write_text(json.dumps(report, indent=1) + "\n")
    PAGE.write_text(page(report))


if __name__ == "__main__":
    main()
