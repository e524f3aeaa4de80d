"""Layout `lytro_raw`: a raw capture of a Lytro camera, decoded to 9x9 views as it is read.

`.lfp` or `.lfr` as the camera writes them, or `.raw` with its metadata beside. White images are
taken from the file, or from a folder `white` beside it; docs/raw.md tells more.
"""

from __future__ import annotations

from pathlib import Path

from epinet.io.layout import Layout
from epinet.raw import decode
from epinet.raw.capture import lacks_capture, metadata_beside
from epinet.raw.container import is_container, read_container
from epinet.raw.family import calibration_by_name


def recognises(path: Path) -> bool:
    """Whether it is named like a raw capture."""
    return path.suffix.lower() in LAYOUT.suffixes


def holds_views(path: Path) -> bool:
    """Whether it may be a capture, and no calibration data or what software made of a capture."""
    if calibration_by_name(path):
        return False
    if path.suffix.lower() == ".raw" and not is_container(path):
        return metadata_beside(path) is not None
    return not lacks_capture(read_container(path))


LAYOUT = Layout(
    name="lytro_raw",
    description="raw capture of a Lytro F01 or Illum: .lfp, .lfr, or .raw with .json",
    recognises=recognises,
    read=decode,
    write=None,
    suffixes=(".lfp", ".lfr", ".raw"),
    holds_views=holds_views,
)
