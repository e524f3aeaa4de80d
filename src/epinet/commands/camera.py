"""What commands on a result ask of its camera, and where the answer may come from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from epinet.io.camera_file import CameraFacts
    from epinet.predict.stored import StoredResult

ResultArgument = Annotated[
    Path, typer.Argument(metavar="RESULT", help="Result folder of epinet predict.")
]
CameraOption = Annotated[
    Path | None,
    typer.Option(
        "--camera",
        help="Camera file, .json, .yaml or a parameters.cfg; default: what came with the views.",
    ),
]
FovOption = Annotated[
    float | None,
    typer.Option("--fov", help="Field of view across the picture's longer side, in degrees."),
]
FocalLengthOption = Annotated[
    float | None, typer.Option("--focal-length-mm", help="Focal length; with --sensor-mm.")
]
SensorOption = Annotated[
    float | None, typer.Option("--sensor-mm", help="Longer side of the sensor's part in use.")
]
BaselineOption = Annotated[
    float | None, typer.Option("--baseline-mm", help="Distance between adjacent views.")
]
FocusOption = Annotated[
    float | None,
    typer.Option("--focus-mm", help="Distance at which the disparity is 0; inf if parallel."),
]


def known_camera(
    stored: StoredResult,
    file: Path | None,
    *,
    fov: float | None = None,
    focal_length: float | None = None,
    sensor: float | None = None,
    baseline: float | None = None,
    focus: float | None = None,
) -> tuple[CameraFacts, str]:
    """What is known of a result's camera, and from where: flags over the file over the views.

    Files and flags tell the distance of neighbouring views; the map of a result of every second
    view is per two of them.
    """
    from epinet.io.camera_file import camera_facts, read_camera

    facts, origins = stored.camera_facts, []
    if facts.known():
        origins.append("the views")
    if file is not None:
        facts = facts.completed_by(read_camera(file).of_every(stored.step))
        origins.append(str(file))
    flags = {
        "fov_deg": fov,
        "focal_length_mm": focal_length,
        "sensor_size_mm": sensor,
        "baseline_mm": baseline,
        "focus_distance_mm": focus,
    }
    given = {name: value for name, value in flags.items() if value is not None}
    if given:
        facts = facts.completed_by(camera_facts(given, "camera").of_every(stored.step))
        origins.append("options")
    if stored.step != 1:
        origins.append(f"baselines times the step of {stored.step} views")
    return facts, ", ".join(origins)
