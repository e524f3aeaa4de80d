"""The benchmark's submission: a zip of twelve maps and their run times, written and checked.

The root of the zip holds `disp_maps/<scene>.pfm` and `runtimes/<scene>.txt`, twelve of each. The
site asks for these names, gray PFM of 512x512 px and a run time in the first line. This refuses
more: values that are missing, which the site lets pass, another byte order or scale than everybody
reads alike, and files beside the twenty-four.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from epinet.benchmark.maps import (
    MAPS_FOLDER,
    RUNTIMES_FOLDER,
    MapFile,
    check_map,
    missing_values,
    parse_runtime,
)
from epinet.benchmark.scenes import BENCHMARK_SCENES, BENCHMARK_SIDE_PX
from epinet.errors import InputError
from epinet.io.atomic import atomic_path, scratch_folder
from epinet.io.pfm import decode_pfm, write_pfm
from epinet.io.problems import Problems, parsing
from epinet.reading import open_regular

SIZE = (BENCHMARK_SIDE_PX, BENCHMARK_SIDE_PX)
"""(height, width) of every map in px."""

LARGEST_BYTES = 16 * 2**20
"""What is larger is no entry of a submission."""

MOST_ENTRIES = 1000
"""More are not even listed one by one."""

_MADE_AT = (1980, 1, 1, 0, 0, 0)
"""One time for all, so that the same maps make the same zip."""

_THREE_LINES = re.compile(rb"P[Ff][ \t\r]*\n\d+ \d+[ \t\r]*\n[^\s]+[ \t\r]*\n")
"""A header as the site reads it."""

_FOLDERS = (MAPS_FOLDER, RUNTIMES_FOLDER)
_WANTED = {
    f"{folder}/{name}{suffix}"
    for folder, suffix in ((MAPS_FOLDER, ".pfm"), (RUNTIMES_FOLDER, ".txt"))
    for name in BENCHMARK_SCENES
}


def write_submission(path: Path, maps: Mapping[str, MapFile]) -> None:
    """Write the zip, and keep it only if it can be submitted.

    Args:
        path: of the zip.
        maps: of the twelve scenes, with run times.

    Raises:
        InputError: maps that cannot be submitted, or an unwritable path.
    """
    with atomic_path(path) as temporary, scratch_folder() as folder:
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in BENCHMARK_SCENES:
                pfm = folder / f"{name}.pfm"
                write_pfm(pfm, maps[name].read(SIZE))
                _add(archive, f"{MAPS_FOLDER}/{name}.pfm", pfm.read_bytes())
                seconds = f"{maps[name].seconds:.10g}\n"
                _add(archive, f"{RUNTIMES_FOLDER}/{name}.txt", seconds.encode("ascii"))
        check_submission(temporary)


def check_submission(path: Path) -> None:
    """Find out whether a zip can be submitted.

    Raises:
        InputError: everything that is wrong with it.
    """
    problems = Problems()
    with parsing(path, "a zip"), open_regular(path) as file, zipfile.ZipFile(file) as archive:
        if len(archive.infolist()) > MOST_ENTRIES:
            raise InputError(
                f"{path}: {len(archive.infolist())} entries; a submission has {len(_WANTED)}"
            )
        kept = [entry for entry in archive.infolist() if not _of_macos(entry.filename)]
        entries = [entry for entry in kept if not entry.is_dir()]
        problems += _packed_wrong([entry.filename for entry in archive.infolist()], path)
        problems += _wrong_names([_slashed(entry.filename) for entry in entries], path)
        problems += [
            f"{path}: {entry.filename}: a folder that does not belong in a submission"
            for entry in kept
            if entry.is_dir() and entry.filename.rstrip("/") not in _FOLDERS
        ]
        for entry in entries:
            meant = _meant(_slashed(entry.filename))
            if meant:
                with problems.gather():
                    _check_entry(archive, entry, meant, f"{path}: {entry.filename}")
    problems.raise_any()


def _slashed(name: str) -> str:
    """A name as meant where the archive was packed with backslashes."""
    return name.replace("\\", "/")


def _of_macos(name: str) -> bool:
    path = PurePosixPath(_slashed(name))
    return "__MACOSX" in path.parts or path.name == ".DS_Store" or path.name.startswith("._")


def _packed_wrong(names: Sequence[str], path: Path) -> list[str]:
    """What a packer did to all names, in a line each."""
    problems = []
    if backslashed := [name for name in names if "\\" in name]:
        problems.append(
            f"{path}: {len(backslashed)} names hold a backslash, such as {backslashed[0]}; pack it "
            "with slashes: `epinet submit` does, and `python -m zipfile -c`"
        )
    if hidden := [name for name in names if _of_macos(name)]:
        problems.append(
            f"{path}: {len(hidden)} hidden files of macOS, such as {hidden[0]}; leave them out: "
            "`zip -r -X` with `-x '.*' -x '__MACOSX/*'` does"
        )
    return problems


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, _MADE_AT)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, data)


def _meant(name: str) -> str | None:
    """Which of the wanted names an entry is, in whatever folder; None if it is none."""
    inner = "/".join(PurePosixPath(name).parts[-2:])
    return inner if inner in _WANTED else None


def _outer(name: str) -> str:
    """What stands before the last two parts of a name, as it is written there."""
    return "/".join(name.split("/")[:-2])


def _wrong_names(names: Sequence[str], path: Path) -> list[str]:
    meant = [_meant(name) for name in names]
    outer = sorted({_outer(n) for n, m in zip(names, meant, strict=True) if m} - {""})
    problems = [
        f"{path}: {MAPS_FOLDER} and {RUNTIMES_FOLDER} stand in the folder {folder}; they must "
        "stand at the root of the zip"
        for folder in outer
    ]
    problems += [f"{path}: {name}: missing" for name in sorted(_WANTED - set(meant))]
    problems += [
        f"{path}: {name}: there more than once" for name in sorted(_WANTED) if meant.count(name) > 1
    ]
    problems += [
        f"{path}: {name}: does not belong in a submission; leave it out"
        for name in sorted(set(names))
        if not _meant(name)
    ]
    return problems


def _check_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, meant: str, label: str) -> None:
    if entry.flag_bits & 1:
        raise InputError(f"{label}: encrypted; make the zip without a password")
    if entry.file_size > LARGEST_BYTES:
        raise InputError(f"{label}: {entry.file_size} bytes; a map of 512x512 px takes 1 MB")
    try:
        data = archive.read(entry)
    except Exception as error:  # a damaged zip makes zlib and zipfile raise anything
        raise InputError(f"{label}: damaged ({error}); make the zip again") from error
    if meant.startswith(RUNTIMES_FOLDER):
        parse_runtime(data.decode("utf-8", errors="replace"), label)
    else:
        _check_pfm(data, label)


def _check_pfm(data: bytes, label: str) -> None:
    map_, scale = decode_pfm(data, label)
    problems = Problems()
    if not _THREE_LINES.match(data):
        problems.append(f"{label}: the header must be three lines: Pf, 512 512 and -1.0")
    if scale > 0:
        problems.append(f"{label}: big-endian (its scale is {scale:g}); write it little-endian")
    if abs(scale) != 1:
        problems.append(
            f"{label}: its scale is {scale:g}: the site would multiply by {abs(scale):g}; write -1"
        )
    with problems.gather():
        check_map(map_, SIZE, label)
    problems += missing_values(map_, label)
    problems.raise_any()
