"""Folders with one image per view: which views are needed, and reading and writing them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.io.images import (
    check_decoded_images,
    check_samples,
    image_size,
    read_image,
    write_png,
)
from epinet.io.names import alike
from epinet.io.problems import Problems, listed
from epinet.lightfield import LightField

_MOST_PATTERNS = 3
_FEW_OTHERS = 4
"""Numbered images beside the views that a small grid may have."""
_SMALLEST_STAR = 9
_SIDE_OF_ANY, _SIDE_PER_FILE = 9, 4
"""No grid has fewer views of its star than a quarter of its rows: indices are bounded by files."""
Position = tuple[int, int]
"""(row, col) of a view in the grid."""


def one_kind(files: list[Path]) -> tuple[list[Path], list[Path]]:
    """Split images into those named alike, which are the views, and the rest.

    Raises:
        InputError: more than a fifth as many images of the same size are numbered in other ways, or
            as many of any size: which of them are the views, or what pattern all follow, is
            anyone's guess.
    """
    group, rest = alike(files)
    others, _ = alike(rest)
    if len(others) == len(group) > 1:
        raise InputError(
            f"{group[0].parent}: {len(group)} images named like {group[0].name} and as many like "
            f"{others[0].name}; leave only the views in the folder"
        )
    check_rest(group, rest)
    return group, rest


def check_rest(views: list[Path], rest: list[Path]) -> None:
    """Refuse to take some of the views for all of them.

    Args:
        views: images whose names fit a pattern.
        rest: of the same folder, others; those without a number are no views.

    Raises:
        InputError: more than a fifth as many of the rest have the size of the views.
    """
    few = max(_FEW_OTHERS, len(views) // 5)
    rest = [file for file in rest if any(c.isdecimal() for c in file.stem)]
    if len(rest) <= few:
        return
    size = image_size(views[0])
    rest = [file for file in rest if image_size(file) == size]
    if len(rest) <= few:
        return
    patterns: list[str] = []
    left = rest
    while left and len(patterns) < _MOST_PATTERNS:
        group, left = alike(left)
        patterns.append(f"{len(group)} like {group[0].name}")
    patterns += [f"{len(left)} others"] * bool(left)
    raise InputError(
        f"{views[0].parent}: {len(views)} images are named like {views[0].name}, and of the same "
        f"size there are {', '.join(patterns)}; name all views alike, such as "
        "view_<row>_<column>.png, and leave only them in the folder"
    )


def sublattice(files: Mapping[Position, Path]) -> tuple[int, Position, int] | None:
    """(step, first position, side) where the views are every step-th of a larger square grid.

    None where they are no such grid of at least 3x3.
    """
    rows, cols = ({position[axis] for position in files} for axis in (0, 1))
    first = min(rows), min(cols)
    step = gcd(*(row - first[0] for row in rows), *(col - first[1] for col in cols))
    span = max(rows) - first[0]
    if step < 2 or span != max(cols) - first[1] or span < 2 * step:
        return None
    return step, first, span // step + 1


def read_grid(
    files: Mapping[Position, Path],
    side: int,
    name: Callable[[int, int], str],
    folder: Path,
    ignored: list[Path] | None = None,
) -> LightField:
    """Read the views of a `side` x `side` grid.

    The star of views that the network sees must be complete; other views may be missing. A star
    smaller than the grid is taken as a smaller grid: n is the largest odd size whose outermost
    star views are (partly) there, and the central n x n grid is returned.

    Args:
        files: the file of each view that is there.
        side: rows and columns of the grid.
        name: the file name that a view at (row, col) should have.
        folder: where they were looked for.
        ignored: images whose names do not fit, for a note.

    Raises:
        InputError: every missing view of the star, every image that cannot be read, and every
            one whose size or type differs from the others'.
    """
    if lattice := sublattice(files):
        step, (row0, col0), inner = lattice
        lf = read_grid(
            {((r - row0) // step, (c - col0) // step): file for (r, c), file in files.items()},
            inner,
            lambda row, col: name(row0 + step * row, col0 + step * col),
            folder,
            ignored,
        )
        note = f"every {step}. row and column of a {side}x{side} grid is there; disparity is from "
        origin_ = (row0 + step * lf.grid_origin[0], col0 + step * lf.grid_origin[1])
        return replace(
            lf,
            grid_origin=origin_,
            grid_step=step,
            notes=(*lf.notes, f"{note}one of these views to the next"),
        )
    if side > max(_SIDE_OF_ANY, _SIDE_PER_FILE * len(files)):
        last = max(files.values())
        raise InputError(
            f"{folder}: numbers in the names go up to {last.name}, as in a grid of {side}x{side} "
            f"views, of which {len(files)} are there; remove what is no view"
        )
    n = side if len(files) == side * side else _star_side(files, side, folder)
    origin = (side - 1) // 2 - (n - 1) // 2
    inside = {
        (row - origin, col - origin): file
        for (row, col), file in sorted(files.items())
        if origin <= row < origin + n and origin <= col < origin + n
    }
    star = star_positions(n) if n % 2 else []
    missing = [(row + origin, col + origin) for row, col in star if (row, col) not in inside]
    if 2 * len(missing) > len(star) > _SMALLEST_STAR:
        raise InputError(
            f"{folder}: numbers in the names span {n}x{n} views, of whose centre row and column "
            f"and diagonals, {len(star)} views, only {len(star) - len(missing)} are there; remove "
            "what is no view of this grid, or name the views view_<row>_<column>.png"
        )
    problems = Problems(
        f"{folder / name(row, col)}: missing; "
        f"{n}x{n} views need the centre row and column and both diagonals, {len(star)} in all"
        for row, col in missing
    )
    with problems.gather():
        check_decoded_images(folder, inside.values())
        images = _read_all(inside, problems)
    problems.raise_any()

    first = next(iter(images.values()))
    views = np.zeros((n, n, *first.shape), dtype=first.dtype)
    present = np.zeros((n, n), dtype=bool)
    for position, image in images.items():
        views[position] = image
        present[position] = True
    notes = _notes(n, set(inside) - set(star), ignored or [])
    return LightField(views, present, grid_origin=(origin, origin), notes=notes)


def write_views(folder: Path, lf: LightField, name: Callable[[int, int], str]) -> None:
    """Write every view that is present as PNG, named by its (row, col).

    Raises:
        InputError: float views, which a PNG cannot hold.
    """
    check_samples(lf.views)
    for row, col in np.argwhere(lf.present):
        write_png(folder / name(row, col), lf.views[row, col])


def _star_side(files: Mapping[Position, Path], side: int, folder: Path) -> int:
    centre = (side - 1) // 2
    reaches = {max(abs(row - centre), abs(col - centre)) for row, col in files}
    for reach in sorted((r for r in reaches if 1 <= r <= centre), reverse=True):
        n = 2 * reach + 1
        inner = {(row + 1, col + 1) for row, col in star_positions(n - 2)}
        ring = set(star_positions(n)) - inner
        offset = centre - reach
        if any((row + offset, col + offset) in files for row, col in ring):
            return n
    raise InputError(
        f"{folder}: only {len(files)} of the {side}x{side} views and none around the centre; "
        "at least the central 3x3 are needed"
    )


def _read_all(files: Mapping[Position, Path], problems: Problems) -> dict[Position, NDArray[Any]]:
    """Read images of equal size and type; what cannot be read or differs joins the problems."""

    def attempt(file: Path) -> NDArray[Any] | InputError:
        try:
            return read_image(file)
        except InputError as error:
            return error

    with ThreadPoolExecutor(max_workers=4) as pool:  # Pillow decodes outside the GIL
        results = dict(zip(files, pool.map(attempt, files.values()), strict=True))
    images = {}
    for position, result in results.items():
        if isinstance(result, InputError):
            problems.extend(result.problems)
        else:
            images[position] = result
    kinds = Counter(_kind(image) for image in images.values())
    for position, image in images.items():
        usual = kinds.most_common(1)[0][0]
        if _kind(image) != usual:
            problems.append(f"{files[position]}: {_kind(image)}, the other views are {usual}")
    return images


def _kind(image: NDArray[Any]) -> str:
    height, width, channels = image.shape
    colour = "RGB" if channels == 3 else "gray"
    return f"{width}x{height} px {8 * image.itemsize}-bit {colour}"


def _notes(n: int, off_star: set[Position], ignored: list[Path]) -> tuple[str, ...]:
    notes = []
    possible = n * n - (4 * n - 3)
    if 0 < len(off_star) < possible and n % 2:
        notes.append(f"{len(off_star)} of the {possible} views off the star are there")
    if ignored:
        names = listed([file.name for file in ignored], 5)
        notes.append(f"images whose names do not fit the others' were ignored: {names}")
    return tuple(notes)
