"""`epinet depth`: a disparity map to distances in mm."""

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
from epinet.terminal import say


def depth(
    result: ResultArgument,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="File to write: .pfm, .png (16 bit), .tiff or .npz."),
    ],
    camera: CameraOption = None,
    fov: FovOption = None,
    focal_length_mm: FocalLengthOption = None,
    sensor_mm: SensorOption = None,
    baseline_mm: BaselineOption = None,
    focus_mm: FocusOption = None,
    step_mm: Annotated[
        float | None,
        typer.Option("--step-mm", help="What 1 means in a PNG; default: as fine as fits."),
    ] = None,
) -> None:
    """Write the depth along the optical axis in mm, from a result and its camera."""
    import numpy as np

    from epinet.geometry.depth_files import check_suffix, write_depth
    from epinet.predict.stored import read_result

    check_suffix(output)
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
    depth_mm = facts.camera(stored.size, metric_depth_only=True).depth_mm(stored.disparity)
    meaning = write_depth(output, depth_mm, facts, step_mm)
    finite = depth_mm[np.isfinite(depth_mm)]
    span = "{:.6g}..{:.6g} mm".format(*np.percentile(finite, [1, 99])) if finite.size else "none"
    far, unknown = int(np.isinf(depth_mm).sum()), int(np.isnan(depth_mm).sum())
    say(f"depth {span}, {far} px infinitely far, {unknown} px unknown; camera: {origin}")
    say(f"{meaning} -> {output}")
