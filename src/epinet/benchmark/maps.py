"""A method's disparity maps on disk: ours or anybody's."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.documents import validated
from epinet.errors import InputError
from epinet.io.names import folder_name, is_shown
from epinet.io.numpy_file import read_npy
from epinet.io.pfm import read_pfm
from epinet.io.problems import Problems, listed, parsing
from epinet.predict.record import Timed, read_run
from epinet.reading import read_bytes
from epinet.texts import decoded

Size = tuple[int, int]
"""(height, width) in pixels."""

SUFFIXES = (".pfm", ".npy")
MAPS_FOLDER, RUNTIMES_FOLDER = "disp_maps", "runtimes"
"""Where the benchmark's submissions have them."""

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

        Raises:
            InputError: it is in colour, of another size, or cannot be read.
        """
        is_pfm = self.path.suffix.lower() == ".pfm"
        map_ = read_pfm(self.path) if is_pfm else _read_npy(self.path)
        check_map(map_, size, self.path)
        return map_


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
    others: Collection[str] | None = (),
    *,
    complete: bool = False,
) -> dict[str, MapFile]:
    """The map of each scene, each read once to check it.

    Args:
        folder: holds `<scene>.pfm` or `<scene>.npy` (perhaps in `disp_maps`), or result folders
            `<scene>` of `epinet predict`, or is such a result folder; run times may stand in
            `runtimes/<scene>.txt`.
        sizes: (height, width) in px of the scenes that need a map, by name.
        others: names of scenes whose maps are passed over, as those of the benchmark's scenes are;
            None passes over all others.
        complete: whether every pixel must have an estimate, and every map a run time.

    Raises:
        InputError: all maps that are missing, ambiguous, of no known scene, of the wrong size or
            cannot be read.
    """
    if not folder.is_dir():
        what = "a file" if folder.exists() else "no such folder"
        raise InputError(
            f"{folder}: {what}; give a folder of maps, a weights file, sweepnet or epinet"
        )
    candidates = _candidates(folder)
    if not candidates:
        raise InputError(
            f"{folder}: no maps in it; expected <scene>.pfm, <scene>.npy or folders of results"
        )
    problems = Problems()
    for name, paths in candidates.items():
        if others is not None and name not in {*sizes, *others, *BENCHMARK_SCENES}:
            known = listed(sorted({*sizes, *others}), 12)
            problems.append(f"{paths[0]}: no scene is named {name}; there are {known}")
    found = {}
    for name, size in sizes.items():
        with problems.gather():
            file = MapFile(_map_of(folder, name, candidates.get(name, [])))
            with problems.gather():
                map_ = file.read(size)
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
    return found


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
            f"{folder}: no map of scene {name}; expected {name}.pfm, {name}.npy or "
            f"{name}/disparity.pfm"
        )
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
