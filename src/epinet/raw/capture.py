"""A raw capture from disk: .lfp and .lfr files, and .raw pixels with their metadata beside."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.documents import JSON_BYTES
from epinet.errors import InputError
from epinet.raw.bayer import packed_bytes, unpack
from epinet.raw.container import Container, is_container, parse_json, read_container
from epinet.raw.family import is_made_by_software, without_capture
from epinet.raw.metadata import Frame, parse_frame
from epinet.reading import read_bytes
from epinet.texts import POINTER, is_pointer

_METADATA_ENDINGS = (".json", ".JSON", ".txt", ".TXT", "_metadata.json")
_PRIVATE_ENDING = "_private_metadata.json"


@dataclass(frozen=True)
class Capture:
    """A raw image and what the camera noted about it."""

    frame: Frame
    raw: NDArray[np.uint16]
    """(H, W) as the sensor read it."""
    embedded_white: NDArray[np.uint16] | None = None
    """(H, W) white image that came in the same file."""


def read_capture(path: Path) -> Capture:
    """Read a raw capture.

    Raises:
        InputError: another kind of file, no raw image in it, an unknown camera, or a file that is
            cut off or damaged.
    """
    if path.suffix.lower() == ".raw" and not is_container(path):
        if is_pointer(path):
            raise InputError(f"{path}: {POINTER}")
        frame = _frame_beside(path)
        return Capture(frame, unpack_frame(frame, read_bytes(path)))
    container = read_container(path)
    references = _frame_references(container)
    private = references.get("privateMetadataRef", "")
    frame = parse_frame(
        container.json(references["metadataRef"]),
        container.json(private) if private in container else {},
        str(path),
    )
    raw = unpack_frame(frame, container.section(references["imageRef"]))
    white = references.get("modulationDataRef", "")
    embedded = None
    if white in container:
        embedded = unpack_frame(frame, container.section(white))
    return Capture(frame, raw, embedded)


def lacks_capture(container: Container) -> bool:
    """Whether no raw image of a sensor is meant to be in it."""
    frame = _first_frame(container.contents)
    if frame is None or not {"imageRef", "metadataRef"} <= frame.keys():
        return True
    return str(frame["imageRef"]) not in container and is_made_by_software(container)


def metadata_beside(path: Path) -> Path | None:
    """The file with the camera's metadata beside a .raw."""
    beside = [path.with_name(path.stem + ending) for ending in _METADATA_ENDINGS]
    return next((file for file in beside if file.exists()), None)


def unpack_frame(frame: Frame, data: bytes) -> NDArray[np.uint16]:
    """(H, W) pixels of a frame.

    Raises:
        InputError: there are too few or too many bytes for its size.
    """
    height, width = frame.size
    due = packed_bytes(height, width, frame.bits)
    if len(data) != due:
        hint = "cut off, copy it again" if len(data) < due else "not of this camera"
        raise InputError(
            f"{frame.where}: the raw image has {len(data)} bytes; {width}x{height} px of "
            f"{frame.bits} bits are {due}: {hint}"
        )
    return unpack(data, frame.size, frame.bits)


def frame_of_document(document: dict[str, Any], where: str) -> Frame:
    """A frame's metadata from the file beside a .raw: alone, or inside a table of contents.

    Raises:
        InputError: as `parse_frame`.
    """
    frame = _first_frame(document.get("master", document))
    if frame is None:
        return parse_frame(document, {}, where)
    return parse_frame(frame.get("metadata"), frame.get("privateMetadata"), where)


def _first_frame(contents: Any) -> dict[str, Any] | None:
    """The entry of the raw frame: an Illum's is in `frames`, all others in `picture`."""
    try:
        entries = contents["frames"] if "frames" in contents else contents["picture"]["frameArray"]
        frame = entries[0]["frame"]
    except (KeyError, IndexError, TypeError):
        return None
    return frame if isinstance(frame, dict) else None


def _frame_references(container: Container) -> dict[str, str]:
    if lacks_capture(container):
        raise InputError(f"{container.path}: {without_capture(container)}")
    frame = _first_frame(container.contents)
    assert frame is not None
    return {key: str(value) for key, value in frame.items()}


def _frame_beside(path: Path) -> Frame:
    """Metadata of a .raw, from the file beside it."""
    found = metadata_beside(path)
    if found is None:
        raise InputError(
            f"{path}: {path.stem}.json or {path.stem}.txt with the camera's metadata is missing "
            "beside it; give the .lfp or .lfr file, which holds both"
        )
    document = parse_json(read_bytes(found, JSON_BYTES), str(found))
    private = path.with_name(path.stem + _PRIVATE_ENDING)
    if private.exists() and _first_frame(document.get("master", document)) is None:
        return parse_frame(
            document, parse_json(read_bytes(private, JSON_BYTES), str(private)), str(path)
        )
    return frame_of_document(document, str(path))
