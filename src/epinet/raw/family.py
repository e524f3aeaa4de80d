"""Files of Lytro's cameras and software that hold no capture, and which file is meant instead.

Known by their names (optics.miloush.net/lytro lists those of Lytro Desktop's library) or by what
lies in them: a container may refer to a sensor image that is not in it, but in the capture's file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from epinet.raw.container import Container

_JPEG = b"\xff\xd8\xff"
_MOST_DEEP = 12
_CALIBRATION = "calibration data of a camera, no picture; give it with --white beside a capture"
_BY_NAME = (
    (r"(.*[-_ ])?(stk|stack)(lq)?(_filtered)?", "stack"),
    (r"(.*[-_ ])?(dm|depth|depthmap)", "depth"),
    (r"(.*[-_ ])?warp(ed)?", "warped"),
    (r"(.*[-_ ])?compressed", "compressed"),
    (r"(.*[-_ ])?export(ed)?", "exported"),
)
_BY_TYPE = {"refocus": "stack", "depth": "depth", "warp": "warped", "compress": "compressed"}
_SAID = {
    "stack": "a stack of refocused pictures",
    "depth": "a depth map",
    "warped": "a warped picture",
    "compressed": "a compressed picture",
    "exported": "an exported picture",
}
_MADE = re.compile(r"[-_ ]?(stk|stack|dm|depth|warp|compressed|export)\w*$", re.IGNORECASE)


def calibration_by_name(path: Path) -> str | None:
    """What a file of calibration data is, by its name; None for other files."""
    name = path.name.lower()
    if re.fullmatch(r"(caldata|cal-data).*\.tar|data\.c\.\d+", name):
        return _CALIBRATION
    if re.fullmatch(r"(mod|drk|dark)_\d+\.(raw|txt)", name):
        return f"a calibration frame of the factory, no picture; {_CALIBRATION.partition('; ')[2]}"
    return None


def without_capture(container: Container) -> str:
    """What a container without a sensor image is, and what to give instead."""
    if "files" in container.contents:
        return _CALIBRATION
    kind = _kind(container)
    what = _SAID.get(kind, "pictures")
    pictures = sum(_begins_as_jpeg(container, place) for place in container.places.values())
    count = f" ({pictures} JPEG)" if pictures else ""
    return (
        f"{what}{count} that Lytro's software made of a capture, no raw image of the sensor in it; "
        f"give the file that the camera wrote, {_capture_of(container.path)}"
    )


def is_made_by_software(container: Container) -> bool:
    """Whether its name or content says so, be a sensor image referred to or not."""
    return bool(_kind(container))


def _kind(container: Container) -> str:
    for pattern, kind in _BY_NAME:
        if re.fullmatch(pattern, container.path.stem, re.IGNORECASE):
            return kind
    told = " ".join(_types(container.contents)).lower()
    return next((kind for word, kind in _BY_TYPE.items() if word in told), "")


def _types(value: Any, depth: int = 0) -> Iterator[str]:
    """What a table of contents says of the types of its parts, and the names of these."""
    if depth > _MOST_DEEP:
        return
    if isinstance(value, list):
        for item in value:
            yield from _types(item, depth + 1)
    if not isinstance(value, dict):
        return
    for key, item in value.items():
        if key == "type" and isinstance(item, str):
            yield item
        elif item and key in ("imageArray", "refocusStack", "depthLut", "depthMap"):
            yield "refocus" if key == "imageArray" else key
        yield from _types(item, depth + 1)


def _begins_as_jpeg(container: Container, place: tuple[int, int]) -> bool:
    with container.path.open("rb") as file:
        file.seek(place[0])
        return file.read(len(_JPEG)) == _JPEG


def _capture_of(path: Path) -> str:
    stem = _MADE.sub("", path.stem) or "raw"
    for beside in sorted(path.parent.glob("*.lf[pr]")) + sorted(path.parent.glob("*.LF[PR]")):
        if beside.stem.lower() == stem.lower() and beside != path:
            return f"{beside.name} beside it"
    return "such as IMG_0001.lfp or raw.lfp (F01) or IMG_0001.LFR (Illum)"
