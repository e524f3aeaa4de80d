"""Layout `hci`: folders of the 4D Light Field Benchmark.

`input_Cam000.png` onwards (index = columns * row + col from the top-left), and where they exist
`parameters.cfg`, `gt_disp_lowres.pfm`, `objectids_lowres.png` (16 bit) and the masks
`invalid_mask.png`, `valid_mask.png` and `mask_<name>_lowres.png`; the reference code of EPINET has
its masks of mirrors as `input_Cam040_invalid_ver2.png`, which is read where there is no other. A
folder that we write from a camera's views says so in `parameters.cfg` (captured = true); others
hold rendered scenes.
`gt_depth_lowres.pfm` (depth in mm) is written where the camera is known and never read: it follows
from the disparity and the camera. Truths of further views, `gt_disp_lowres_Cam000.pfm` onwards, are
read by `read_view_truths` only: few want them. The benchmark's download of all scenes lacks them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import gcd, isqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io.folder import check_rest, read_grid, write_views
from epinet.io.images import image_files, read_image, read_mask, write_png
from epinet.io.layout import Layout
from epinet.io.numbered import check_arrangement
from epinet.io.parameters import Parameters, read_parameters, write_parameters
from epinet.io.pfm import read_pfm, write_pfm
from epinet.io.problems import Problems
from epinet.io.truth import checked_truth
from epinet.lightfield import LightField

Size = tuple[int, int]
"""(height, width) in pixels."""

_VIEW = re.compile(r"input_cam(\d+)", re.IGNORECASE)
_TRUTH = "gt_disp_lowres.pfm"
_DEPTH = "gt_depth_lowres.pfm"
_PARAMETERS = "parameters.cfg"
_OBJECTS = "objectids_lowres.png"
_INVALID_OF_EPINET = "input_Cam040_invalid_ver2.png"
"""Not transparent where it mirrors."""
_BENCHMARK_SIDE = 9


def recognises(folder: Path) -> bool:
    """Whether any image is named like a view of the benchmark."""
    return any(_VIEW.fullmatch(file.stem) for file in image_files(folder))


def read(folder: Path) -> LightField:
    """Read a scene: all views or only the star, with camera, truth and masks where present.

    Raises:
        InputError: all that is wrong with any of its files.
    """
    problems = Problems()
    parameters = Parameters()
    if (folder / _PARAMETERS).exists():
        with problems.gather():
            parameters = read_parameters(folder / _PARAMETERS)
    lf: LightField | None = None
    with problems.gather():
        lf = _read_views(folder, parameters.side)
    size = None if lf is None else lf.size
    with problems.gather():
        _check_camera(parameters.camera, size, folder)
    truth, objects, masks = None, None, {}
    if (folder / _TRUTH).exists():
        with problems.gather():
            truth = checked_truth(read_pfm(folder / _TRUTH), size, folder / _TRUTH)
    if (folder / _OBJECTS).exists():
        with problems.gather():
            objects = _read_objects(folder / _OBJECTS, size)
    for name, path in _mask_files(folder).items():
        with problems.gather():
            masks[name] = _read_mask(path, size)
    if lf is None or problems:
        raise InputError(problems)
    step, camera = lf.grid_step, parameters.camera
    return replace(
        lf,
        camera=None if camera is None else camera.at_every(step),
        truth=truth if truth is None or step == 1 else truth * np.float32(step),
        masks=masks,
        objects=objects,
        captured=parameters.captured,
    )


def write(folder: Path, lf: LightField) -> None:
    """Write everything that `read` reads, and the depth for those who want it."""
    side = lf.grid[1]
    write_views(folder, lf, lambda row, col: f"input_Cam{side * row + col:03d}.png")
    write_parameters(folder / _PARAMETERS, lf)
    if lf.truth is not None:
        write_pfm(folder / _TRUTH, lf.truth)
        if lf.camera is not None:
            write_pfm(folder / _DEPTH, lf.camera.depth_mm(lf.truth))
    for (row, col), truth in lf.view_truths.items():
        write_pfm(folder / view_truth_name(side, row, col), truth)
    if lf.objects is not None:
        write_png(folder / _OBJECTS, lf.objects)
    for name, mask in lf.masks.items():
        write_png(folder / _mask_name(name), mask.astype(np.uint8) * np.uint8(255))


def view_truth_name(side: int, row: int, col: int) -> str:
    """File of the truth of a view in a grid of `side` columns."""
    return f"gt_disp_lowres_Cam{side * row + col:03d}.pfm"


def read_view_truths(
    folder: Path, lf: LightField, positions: Iterable[tuple[int, int]]
) -> dict[tuple[int, int], NDArray[np.float32]]:
    """Truths (H, W) of views other than the centre, in px per adjacent view.

    Args:
        folder: where `lf` was read from.
        positions: (row, col) in `lf`.

    Raises:
        InputError: all files that are missing or cannot be used.
    """
    problems = Problems()
    truths = {}
    row0, col0 = lf.grid_origin
    step = lf.grid_step
    side = step * (lf.grid[1] - 1) + 1 + 2 * col0
    for row, col in positions:
        path = folder / view_truth_name(side, step * row + row0, step * col + col0)
        with problems.gather():
            truths[row, col] = checked_truth(read_pfm(path), lf.size, path) * np.float32(step)
    problems.raise_any()
    return truths


def _read_views(folder: Path, stated_side: int | None) -> LightField:
    problems = Problems()
    by_index: dict[int, Path] = {}
    for file in image_files(folder):
        if match := _VIEW.fullmatch(file.stem):
            index = int(match[1])
            if index in by_index:
                problems.append(f"{file}: view {index} is also {by_index[index].name}; remove one")
            by_index[index] = file
    if not by_index:
        raise InputError(f"{folder}: no image is named input_Cam000.png or alike")
    problems.raise_any()
    check_rest(list(by_index.values()), _look_alikes(folder, set(by_index.values())))
    if stated_side is None:
        by_index = _renumbered(by_index)
    side = stated_side or _guess_side(folder, by_index)
    if max(by_index) >= side * side:
        raise InputError(
            f"{by_index[max(by_index)]}: {_PARAMETERS} says {side}x{side} views, "
            f"so the last is input_Cam{side * side - 1:03d}"
        )
    files = {divmod(index, side): file for index, file in by_index.items()}
    suffix = next(iter(by_index.values())).suffix
    lf = read_grid(files, side, lambda row, col: f"input_Cam{side * row + col:03d}{suffix}", folder)
    if stated_side is None and side != _BENCHMARK_SIDE:
        check_arrangement(folder, lf, len(files))
    return lf


def _look_alikes(folder: Path, views: set[Path]) -> list[Path]:
    """Images whose names begin as a view's and go on in another way."""
    others = (file for file in image_files(folder) if file not in views)
    return [file for file in others if file.name.lower().startswith("input")]


def _renumbered(by_index: Mapping[int, Path]) -> dict[int, Path]:
    """Counted from 0, where the numbers begin at 1 or are every k-th and fill a square grid."""
    first, last = min(by_index), max(by_index)
    step = gcd(*(index - first for index in by_index)) or 1
    count = (last - first) // step + 1
    fills = count == len(by_index) and isqrt(count) ** 2 == count and count >= 9
    if not fills or first not in (0, 1, step) or _on_a_line(by_index):
        return dict(by_index)
    return {(index - first) // step: file for index, file in by_index.items()}


def _on_a_line(by_index: Iterable[int]) -> bool:
    """Whether all are of one row, column or diagonal of the benchmark's grid."""
    positions = [divmod(index, _BENCHMARK_SIDE) for index in by_index]
    rows, cols = zip(*positions, strict=True)
    sums, differences = {r + c for r, c in positions}, {r - c for r, c in positions}
    return min(map(len, (set(rows), set(cols), sums, differences))) == 1


def _guess_side(folder: Path, by_index: dict[int, Path]) -> int:
    """9 as in the benchmark, unless the indexes can only mean another square grid."""
    count = max(by_index) + 1
    side = isqrt(count)
    beyond = count > _BENCHMARK_SIDE**2
    if side * side == count and (beyond or 2 * len(by_index) > count):
        return side
    if beyond:
        raise InputError(
            f"{folder}: views go up to {by_index[count - 1].name}, {count} is no square number; "
            f"state num_cams_x and num_cams_y under [extrinsics] in {_PARAMETERS}"
        )
    return _BENCHMARK_SIDE


def _check_camera(camera: Camera | None, size: Size | None, folder: Path) -> None:
    if camera and size and (camera.height_px, camera.width_px) != size:
        raise InputError(
            f"{folder / _PARAMETERS}: image_resolution is {camera.width_px}x{camera.height_px} px, "
            f"the views are {size[1]}x{size[0]} px"
        )


def _mask_files(folder: Path) -> dict[str, Path]:
    candidates = {name: folder / _mask_name(name) for name in ("invalid", "valid")}
    if not candidates["invalid"].exists():
        candidates["invalid"] = folder / _INVALID_OF_EPINET
    for path in sorted(folder.glob("mask_*_lowres.png")):
        candidates[path.name.removeprefix("mask_").removesuffix("_lowres.png")] = path
    return {name: path for name, path in candidates.items() if path.exists()}


def _mask_name(name: str) -> str:
    return f"{name}_mask.png" if name in ("invalid", "valid") else f"mask_{name}_lowres.png"


def _read_objects(path: Path, size: Size | None) -> NDArray[np.uint16]:
    """Gray levels are the numbers; in a colour image every colour is another object."""
    image = read_image(path)
    _check_size("the map of objects", image.shape[:2], size, path)
    if image.shape[2] == 1:
        return image[..., 0].astype(np.uint16)
    _, numbers = np.unique(image.reshape(-1, 3), axis=0, return_inverse=True)
    return numbers.reshape(image.shape[:2]).astype(np.uint16)


def _read_mask(path: Path, size: Size | None) -> NDArray[np.bool_]:
    mask = read_mask(path)
    _check_size("the mask", mask.shape, size, path)
    return mask


def _check_size(what: str, shape: tuple[int, ...], size: Size | None, path: Path) -> None:
    if size is not None and shape != size:
        raise InputError(
            f"{path}: {what} is {shape[1]}x{shape[0]} px, the views are {size[1]}x{size[0]} px"
        )


LAYOUT = Layout(
    name="hci",
    description="folder of input_Cam000.png ..., as in the 4D Light Field Benchmark",
    recognises=recognises,
    read=read,
    write=write,
    file_names=r"input_Cam\d{3,}\.png|parameters\.cfg|gt_(disp|depth)_lowres(_Cam\d{3,})?\.pfm"
    r"|(in)?valid_mask\.png|mask_\w+_lowres\.png|objectids_lowres\.png",
    rendered=True,
)
