"""A method's disparity maps on disk: ours or anybody's."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.documents import validated
from epinet.errors import InputError
from epinet.io.mat import read_only_map
from epinet.io.names import folder_name, is_shown
from epinet.io.numpy_file import read_npy
from epinet.io.pfm import read_pfm
from epinet.io.problems import Problems, listed, parsing
from epinet.predict.record import Timed, read_run
from epinet.reading import read_bytes
from epinet.texts import decoded

LOGGER = logging.getLogger(__name__)
Size = tuple[int, int]
"""(height, width) in pixels."""

SUFFIXES = (".pfm", ".npy", ".mat")
MAPS_FOLDER, RUNTIMES_FOLDER = "disp_maps", "runtimes"
"""Where the benchmark's submissions have them."""

CUT_PX = 11
"""What the reference code of EPINET leaves out on each side: the network sees no more."""

_RESULT_MAPS = ("disparity.pfm", "disparity.npy")
_MOST_BYTES = 2**16
"""Of a run time."""
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
"""As every program reads one."""


@dataclass(frozen=True)
class MapFile:
    """A scene's map on disk, and how long it took."""

    path: Path
    seconds: float | None = None
    """Run time; None if it is not stated."""
    bounded: bool | None = None
    """Whether it was kept within the range of disparities that the scene or the user states; None
    if it is not recorded."""

    def read(self, size: Size) -> NDArray[np.float32]:
        """(H, W) in px per adjacent view; not finite where there is no estimate.

        A map that lacks `CUT_PX` on each side has no estimate there.

        Raises:
            InputError: it is in colour, of another size, or cannot be read.
        """
        map_ = self.stored()
        if is_cut(map_, size):
            map_ = np.pad(map_, CUT_PX, constant_values=np.nan)
        check_map(map_, size, self.path)
        return map_

    def stored(self) -> NDArray[np.float32]:
        """The map as the file has it, of any size.

        Raises:
            InputError: it cannot be read.
        """
        suffix = self.path.suffix.lower()
        if suffix == ".pfm":
            return read_pfm(self.path)
        return read_only_map(self.path) if suffix == ".mat" else _read_npy(self.path)


def is_cut(map_: NDArray[Any], size: Size) -> bool:
    """Whether a map lacks `CUT_PX` on each side of what it must be."""
    return map_.shape == (size[0] - 2 * CUT_PX, size[1] - 2 * CUT_PX)


def check_map(map_: NDArray[Any], size: Size, path: Path | str) -> None:
    """Refuse a map in colour or of another size.

    Raises:
        InputError: naming `path`.
    """
    problems = Problems()
    if map_.ndim == 3:
        problems.append(f"{path}: in colour (PF); a map has one value a pixel (Pf)")
    if map_.shape[:2] != size:
        problems.append(
            f"{path}: the map is {_size_text(map_.shape)}, it must be {_size_text(size)}, as large "
            "as the views"
        )
    problems.raise_any()


def missing_values(map_: NDArray[Any], path: Path | str) -> list[str]:
    """What to say of values that are not finite, if there are any."""
    missing = int(np.sum(~np.isfinite(map_)))
    if not missing:
        return []
    return [f"{path}: {missing} of {map_.size} values are not finite; fill in an estimate"]


def find_maps(
    folder: Path,
    sizes: Mapping[str, Size],
    *,
    complete: bool = False,
) -> dict[str, MapFile]:
    """The map of each scene, each read once to check it.

    The log says which maps are left out, since they are of other scenes, and which are cut.

    Args:
        folder: holds `<scene>.pfm`, `.npy` or `.mat` (perhaps in `disp_maps`), or result folders
            `<scene>` of `epinet predict`, or is such a result folder; run times may stand in
            `runtimes/<scene>.txt`.
        sizes: (height, width) in px of the scenes that need a map, by name.
        complete: whether every pixel must have an estimate, and every map a run time.

    Raises:
        InputError: all maps that are missing, ambiguous, of the wrong size or cannot be read.
    """
    if not folder.is_dir():
        what = "a file" if folder.exists() else "no such folder"
        raise InputError(
            f"{folder}: {what}; give a folder of maps, a weights file, sweepnet or epinet"
        )
    candidates = _candidates(folder)
    if not candidates:
        raise InputError(
            f"{folder}: no maps in it; expected <scene>.pfm, .npy or .mat, or folders of results"
        )
    others = sorted(set(candidates) - set(sizes))
    if others and sizes:
        known = listed(sorted(sizes), 12)
        LOGGER.info(
            "left out: maps of %s in %s (the scenes are %s)", listed(others, 12), folder, known
        )
    problems = Problems()
    found = {}
    cut = []
    for name, size in sizes.items():
        with problems.gather():
            file = MapFile(_map_of(folder, name, candidates.get(name, [])))
            with problems.gather():
                map_ = file.read(size)
                if not np.isfinite(map_[:CUT_PX]).any() and is_cut(file.stored(), size):
                    cut.append(name)
                if complete:
                    problems += missing_values(map_, file.path)
            file = _recorded(file)
            found[name] = replace(file, seconds=_stated_seconds(folder, name) or file.seconds)
            if complete and found[name].seconds is None:
                problems.append(
                    f"{file.path}: no run time is stated; write it in seconds to "
                    f"{RUNTIMES_FOLDER}/{name}.txt in the folder of the maps"
                )
    problems.raise_any()
    if cut:
        LOGGER.info(
            "note: the maps of %s in %s lack %d px on each side, as those of EPINET's reference "
            "code do; these pixels count as without an estimate",
            listed(cut, 12),
            folder,
            CUT_PX,
        )
    return found


def scenes_with_maps(folder: Path) -> set[str]:
    """Names of the scenes whose maps a folder holds; none where it is no folder."""
    return set(_candidates(folder)) if folder.is_dir() else set()


def _candidates(folder: Path) -> dict[str, list[Path]]:
    """Maps by the name of their scene."""
    results = [folder, *sorted(p for p in folder.iterdir() if p.is_dir() and is_shown(p))]
    found: dict[str, list[Path]] = {}
    for result in results:
        for path in (result / name for name in _RESULT_MAPS):
            if path.exists():
                found.setdefault(folder_name(result), [path])
    for place in filter(Path.is_dir, (folder, folder / MAPS_FOLDER)):
        for path in filter(is_shown, sorted(place.iterdir())):
            if path.suffix.lower() in SUFFIXES and path.name not in _RESULT_MAPS:
                found.setdefault(path.stem, []).append(path)
    return found


def _map_of(folder: Path, name: str, paths: list[Path]) -> Path:
    if not paths:
        raise InputError(
            f"{folder}: no map of scene {name}; expected {name}.pfm, {name}.npy, {name}.mat or "
            f"{name}/disparity.pfm"
        )
    paths = [path for path in paths if path.suffix.lower() != ".mat"] or paths
    if len(paths) > 1:
        both = " and ".join(str(path) for path in paths)
        raise InputError(f"{both}: more than one map of scene {name}; remove one")
    return paths[0]


def _stated_seconds(folder: Path, name: str) -> float | None:
    stated = folder / RUNTIMES_FOLDER / f"{name}.txt"
    if not stated.exists():
        return None
    with parsing(stated, "text"):
        return parse_runtime(decoded(read_bytes(stated, _MOST_BYTES)), stated)


def result_map(folder: Path) -> MapFile:
    """The map of a result folder of `epinet predict`, with what run.json says of it.

    Raises:
        InputError: its run.json cannot be read, or its map is not per adjacent view.
    """
    paths = (folder / name for name in _RESULT_MAPS)
    return _recorded(MapFile(next(path for path in paths if path.exists())))


def _recorded(file: MapFile) -> MapFile:
    """With what run.json beside it says, where it is a result's."""
    record = file.path.parent / "run.json"
    if file.path.name not in _RESULT_MAPS or not record.exists():
        return file
    run = validated(Timed, read_run(record), record)
    step, bounded = run.settings.step, None
    if "stated_px" in run.settings.model_fields_set:
        bounded = run.settings.stated_px is not None
    if step != 1:
        raise InputError(
            f"{record}: predicted with --step {step}: the map is in px per {step} views, the "
            "truth in px per adjacent view; predict without --step"
        )
    return MapFile(file.path, math.fsum(run.seconds.values()), bounded)


def parse_runtime(text: str, path: Path | str) -> float:
    """Seconds in the first line of a text.

    Raises:
        InputError: it is no positive number.
    """
    first = text.partition("\n")[0].strip()
    seconds = float(first) if _NUMBER.fullmatch(first) else math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise InputError(
            f"{path}: the first line must be the run time in seconds, a number such as 2.5, "
            f"not {first[:40]!r}"
        )
    return seconds


def _read_npy(path: Path) -> NDArray[np.float32]:
    with parsing(path, "a numpy file"):
        array = read_npy(path)
        if array.ndim != 2 or array.dtype.kind not in "fiu":
            raise InputError(
                f"{path}: a map must be one (H, W) array of numbers, "
                f"not {array.shape} {array.dtype}"
            )
        return array.astype(np.float32)


def _size_text(shape: tuple[int, ...]) -> str:
    return f"{shape[1]}x{shape[0]} px"
