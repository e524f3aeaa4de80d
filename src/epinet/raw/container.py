"""The container of Lytro's files (.lfp, .lfr, data.C.*): a table of contents and named sections.

After a 16-byte head come sections: 8 bytes of magic (LFM: the table of contents, JSON; LFC:
content), 4 zeros, the length (4 bytes, big endian), the name ("sha1-" and the content's SHA-1, 45
bytes) padded to 80 bytes, the content, and zeros up to the next section. As found out by N. Patel
(lfptools) and J. Kučera (optics.miloush.net/lytro).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from epinet import documents
from epinet.errors import InputError
from epinet.reading import check_regular, open_regular
from epinet.texts import POINTER, decoded, is_pointer

MAGIC = b"\x89LFP\r\n\x1a\n"

_CONTENTS, _CONTENT = b"\x89LFM\r\n\x1a\n", b"\x89LFC\r\n\x1a\n"
_HEAD_BYTES = 16
_CHUNK_BYTES = 2**16
_MOST_SECTIONS = 10_000
"""Volumes of calibration data have some hundred."""
_NAME_BYTES, _NAME_FIELD_BYTES = 45, 80
_KNOWN_OTHERS = {
    b"\xff\xd8\xff": "a JPEG image",
    b"\x89PNG": "a PNG image",
    b"II*\0": "a TIFF image",
    b"MM\0*": "a TIFF image",
    b"PK\x03\x04": "a ZIP archive",
}


@dataclass(frozen=True)
class Container:
    """A file's table of contents, and where its sections lie."""

    path: Path
    contents: dict[str, Any]
    places: dict[str, tuple[int, int]]
    """(offset, length) in bytes of each section by name."""

    def __contains__(self, name: object) -> bool:
        return name in self.places

    def section(self, name: str) -> bytes:
        """Content of a section.

        Raises:
            InputError: no such section, or its content is not what its name says.
        """
        if name not in self.places:
            raise InputError(
                f"{self.path}: section {name} is missing; the file may be incomplete, copy it again"
            )
        offset, length = self.places[name]
        with open_regular(self.path) as file:
            file.seek(offset)
            data = file.read(length)
        if name != _name_of(data):
            raise InputError(
                f"{self.path}: damaged between bytes {offset} and {offset + length} "
                "(the content does not have its checksum); copy it again"
            )
        return data

    def json(self, name: str) -> dict[str, Any]:
        """Content of a section of metadata.

        Raises:
            InputError: as `section`, or it is no JSON object.
        """
        return parse_json(self.section(name), f"{self.path}, section {name}")


def is_container(path: Path) -> bool:
    """Whether a file begins as a container does."""
    with open_regular(path) as file:
        return file.read(len(MAGIC)) == MAGIC


def read_container(path: Path) -> Container:
    """Read the table of contents and find the sections.

    Raises:
        InputError: another kind of file, or one that is cut off or damaged.
    """
    size = check_regular(path).st_size
    places: dict[str, tuple[int, int]] = {}
    contents = None
    with open_regular(path) as file:
        _check_head(path, file.read(_HEAD_BYTES))
        while (place := _next_section(path, file, size)) is not None:
            magic, name, offset, length = place
            if len(places) == _MOST_SECTIONS:
                raise InputError(f"{path}: more than {_MOST_SECTIONS} sections; no Lytro file")
            places[name] = offset, length
            if magic == _CONTENTS:
                contents = name
    if contents is None:
        raise InputError(
            f"{path}: no table of contents; the end of the file may be missing, copy it again"
        )
    found = Container(path, {}, places)
    return Container(path, found.json(contents), places)


def parse_json(data: bytes, where: str) -> dict[str, Any]:
    """A JSON object from bytes; the cameras end some with zeros.

    Raises:
        InputError: it is none.
    """
    value = documents.parse_json(decoded(data).rstrip("\0 \n"), where)
    if not isinstance(value, dict):
        raise InputError(f"{where}: unreadable metadata (not a JSON object)")
    return value


def _name_of(data: bytes) -> str:
    return "sha1-" + hashlib.sha1(data, usedforsecurity=False).hexdigest()


def _check_head(path: Path, head: bytes) -> None:
    if head.startswith(MAGIC):
        return
    if is_pointer(path):
        raise InputError(f"{path}: {POINTER}")
    kinds = (kind for start, kind in _KNOWN_OTHERS.items() if head.startswith(start))
    kind = next(kinds, "not a Lytro file" if head else "an empty file")
    raise InputError(
        f"{path}: {kind}; a raw file of a Lytro camera begins with LFP. Give the .lfp or .lfr "
        "file as the camera wrote it"
    )


def _next_section(path: Path, file: BinaryIO, size: int) -> tuple[bytes, str, int, int] | None:
    """(magic, name, offset, length) of the section from here on, or None at the end."""
    here = file.tell()
    while zeros := file.read(_CHUNK_BYTES):
        here += len(zeros) - len(zeros.lstrip(b"\0"))
        if zeros.strip(b"\0"):
            break
    else:
        return None
    file.seek(here)
    head = file.read(_HEAD_BYTES)
    magic = head[: len(_CONTENT)]
    if magic not in (_CONTENTS, _CONTENT) and len(head) == _HEAD_BYTES:
        raise InputError(f"{path}: damaged at byte {here} (no section begins there); copy it again")
    length = int.from_bytes(head[-4:], "big")
    name = file.read(_NAME_FIELD_BYTES if length else 0)
    offset = here + len(head) + len(name)
    if len(head) < _HEAD_BYTES or (length and len(name) < _NAME_FIELD_BYTES):
        raise _cut_off(path, size)
    if offset + length > size:
        raise _cut_off(path, size, offset + length)
    file.seek(offset + length)
    return magic, name[:_NAME_BYTES].decode("ascii", "replace"), offset, length


def _cut_off(path: Path, size: int, needed: int | None = None) -> InputError:
    of = "" if needed is None else f" of at least {needed}"
    return InputError(
        f"{path}: the file is cut off (it has {size} bytes{of}); copy it from the camera again"
    )
