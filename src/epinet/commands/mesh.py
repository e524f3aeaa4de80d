"""`epinet mesh`: a disparity map to a surface, points or a solid to print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from epinet.commands.camera import (
    BaselineOption,
    CameraOption,
    FocalLengthOption,
    FocusOption,
    FovOption,
    ResultArgument,
    SensorOption,
    known_camera,
)
from epinet.errors import InputError
from epinet.terminal import remark, say


def mesh(
    result: ResultArgument,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="File to write: .glb (textured, metres), .ply, .obj (mm), or .stl: a solid to "
            "print, in mm as printed.",
        ),
    ],
    points: Annotated[
        bool, typer.Option("--points", help="Only the points, with their colours.")
    ] = False,
    faces: Annotated[
        int | None, typer.Option(min=4, help="Simplify to about so many faces.")
    ] = None,
    cut_px: Annotated[
        float | None,
        typer.Option(
            "--cut-px",
            min=0,
            help="Cut where neighbouring disparities differ by more, inf nowhere; default: by "
            "more than a surface slanted by 80 degrees would give.",
        ),
    ] = None,
    min_confidence: Annotated[
        float,
        typer.Option(
            min=0, max=1, help="Leave out pixels of less confidence; those of none always."
        ),
    ] = 0,
    near_mm: Annotated[
        float | None, typer.Option("--near-mm", help="Leave out (.stl: flatten) what is nearer.")
    ] = None,
    far_mm: Annotated[
        float | None,
        typer.Option(
            "--far-mm",
            help="Leave out (.stl: flatten) what is farther; default: where the map's noise moves "
            "a point by a third of its depth (.stl: nothing).",
        ),
    ] = None,
    size_mm: Annotated[
        float | None, typer.Option("--size-mm", help=".stl: longer side as printed [100].")
    ] = None,
    base_mm: Annotated[
        float | None, typer.Option("--base-mm", help=".stl: thickness of the base [3].")
    ] = None,
    relief_mm: Annotated[
        float | None,
        typer.Option("--relief-mm", help=".stl: height above the base; default: true to scale."),
    ] = None,
    not_metric: Annotated[
        bool,
        typer.Option("--not-metric", help="Make up a camera: a shape whose lengths mean nothing."),
    ] = False,
    camera: CameraOption = None,
    fov: FovOption = None,
    focal_length_mm: FocalLengthOption = None,
    sensor_mm: SensorOption = None,
    baseline_mm: BaselineOption = None,
    focus_mm: FocusOption = None,
) -> None:
    """Make a mesh of a result: what its centre view sees, cut at depth edges, in true size."""
    import numpy as np

    from epinet.geometry.assumed import assumed_camera
    from epinet.geometry.solid import Print, solid
    from epinet.geometry.surface import farthest_mm, surface
    from epinet.geometry.surface_files import check_suffix, is_solid, write_solid, write_surface
    from epinet.predict.stored import read_result

    check_suffix(output, points)
    lengths = {"size_mm": size_mm, "base_mm": base_mm, "relief_mm": relief_mm}
    of_print = {name: mm for name, mm in lengths.items() if mm is not None}
    _check_options(is_solid(output), list(of_print), cut_px is not None, points, faces is not None)
    stored = read_result(result)
    facts, origin = known_camera(
        stored,
        camera,
        fov=fov,
        focal_length=focal_length_mm,
        sensor=sensor_mm,
        baseline=baseline_mm,
        focus=focus_mm,
    )
    if not_metric:
        facts, origin = assumed_camera(stored.disparity, facts)
    try:
        known = facts.camera(stored.size)
    except InputError as error:
        hint = "for a shape without true lengths: --not-metric"
        raise InputError([*error.problems, hint]) from error
    depth_mm = known.depth_mm(stored.disparity)
    sure = (stored.confidence >= min_confidence) & (stored.confidence > 0)
    if is_solid(output):
        depth_mm = np.where(sure, depth_mm, np.float32(np.nan))
        how = Print(**of_print)
        printed = solid(depth_mm, known, how, near_mm=near_mm, far_mm=far_mm, faces=faces)
        write_solid(output, printed.mesh)
        say(printed.describe())
        written = [output]
    else:
        farthest = farthest_mm(known) if far_mm is None else far_mm
        keep = sure & (depth_mm >= (near_mm or 0)) & (depth_mm <= farthest)
        lost = int((sure & (depth_mm > farthest)).sum())
        if far_mm is None and lost:
            remark(
                f"note: {100 * lost / depth_mm.size:.1f} % of the pixels are left out, farther "
                f"than {farthest:.4g} mm, where the map tells little (--far-mm inf keeps them)"
            )
        shape = surface(stored.disparity, stored.centre_view, known, keep=keep, cut_px=cut_px)
        if faces is not None:
            shape = shape.simplified(faces, known)
        if points:
            shape = shape.as_points()
        written = write_surface(output, shape)
        say(shape.describe())
    say(f"camera: {origin}")
    say(f"-> {', '.join(map(str, written))}")


def _check_options(
    printed: bool, of_print: list[str], cut: bool, points: bool, faces: bool
) -> None:
    problems = []
    if of_print and not printed:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in of_print)
        problems.append(f"{names}: only for a solid to print (.stl); other files are in true size")
    if cut and printed:
        problems.append("--cut-px: a solid to print (.stl) is closed, it cannot be cut")
    if points and faces:
        problems.append("--points, --faces: points have no faces; give one of the two")
    if problems:
        raise InputError(problems)
