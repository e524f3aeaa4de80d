"""Layout `lytro_raw`: a raw capture of a Lytro camera, decoded to 9x9 views as it is read.

`.lfp` or `.lfr` as the camera writes them, or `.raw` with its metadata beside. White images are
taken from the file, or from a folder `white` beside it; docs/raw.md tells more.
"""

from __future__ import annotations

from pathlib import Path

from epinet.io.layout import Layout
from epinet.raw import decode


def recognises(path: Path) -> bool:
    """Whether it is named like a raw capture."""
    return path.suffix.lower() in LAYOUT.suffixes


LAYOUT = Layout(
    name="lytro_raw",
    description="raw capture of a Lytro F01 or Illum: .lfp, .lfr, or .raw with .json",
    recognises=recognises,
    read=decode,
    write=None,
    suffixes=(".lfp", ".lfr", ".raw"),
)
