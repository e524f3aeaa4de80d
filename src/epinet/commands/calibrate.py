"""`epinet calibrate`: a camera's depth scale from points of known distance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epinet.commands.camera import (
    FocalLengthOption,
    FovOption,
    ResultArgument,
    SensorOption,
    known_camera,
)
from epinet.terminal import remark, say

if TYPE_CHECKING:
    from epinet.geometry.calibration import Calibration

FARTHEST_MM = 1e7
"""What is farther is called infinitely far."""


def calibrate(
    result: ResultArgument,
    point: Annotated[
        list[str],
        typer.Option(
            metavar="X,Y,MM",
            help="A pixel of the centre view and its distance along the optical axis, inf for "
            "infinity. Give two or more, at different distances.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Camera file to write: .json or .yaml.")
    ],
    fov: FovOption = None,
    focal_length_mm: FocalLengthOption = None,
    sensor_mm: SensorOption = None,
) -> None:
    """Find a camera's depth scale from points of known distance, for --camera of depth and mesh."""
    from epinet.geometry.calibration import Point
    from epinet.geometry.calibration import calibrate as fit
    from epinet.io.camera_file import write_camera
    from epinet.io.problems import Problems
    from epinet.predict.stored import read_result

    points, problems = [], Problems()
    for text in point:
        with problems.gather():
            points.append(Point.parse(text))
    problems.raise_any()
    stored = read_result(result)
    calibration = fit(stored.disparity, points)
    known, _ = known_camera(stored, None, fov=fov, focal_length=focal_length_mm, sensor=sensor_mm)
    height, width = stored.size
    known = known.completed_by(calibration.facts).of_every(1 / stored.step)
    facts = known.model_copy(update={"width_px": width, "height_px": height})
    write_camera(output, facts)
    _tell(calibration)
    if facts.has_view:
        say(f"baseline {facts.camera(stored.size).baseline_mm:.4g} mm between adjacent views")
    else:
        say(
            "not known from distances: how wide things are. depth works; "
            "for a mesh give --fov, or --focal-length-mm and --sensor-mm"
        )
    say(f"-> {output}")


def _tell(calibration: Calibration) -> None:
    """The fit, point by point, and what it gives."""
    rows = zip(calibration.readings, calibration.residuals_px, calibration.depths_mm, strict=True)
    for reading, residual, depth_mm in rows:
        say(
            f"point {reading.point}: {_distance(1 / reading.point.depth_mm)}, "
            f"disparity {reading.pick.disparity_px:.3f} px, "
            f"residual {residual:+.3f} px, fitted {_distance(1 / depth_mm)}"
        )
        if reading.pick.on_edge:
            remark(
                f"warning: point {reading.point} lies on an edge (disparities spread by "
                f"{reading.pick.spread_px:.2f} px around it); a point inside a surface is safer"
            )
    c = calibration
    low, high = (c.inverse_focus_per_mm + sign * c.inverse_focus_error_per_mm for sign in (1, -1))
    say(
        f"disparity 0 is at {_distance(c.inverse_focus_per_mm)} "
        f"({_distance(low)} to {_distance(high)} with {c.error_px:.2g} px error of a point)"
    )
    say(
        f"baseline x focal length {c.baseline_focal_mm_px:.5g} "
        f"+- {c.baseline_focal_error_mm_px:.2g} mm px"
    )


def _distance(inverse_per_mm: float) -> str:
    far = inverse_per_mm < 1 / FARTHEST_MM
    return "infinity or beyond" if far else f"{1 / inverse_per_mm:.5g} mm"
