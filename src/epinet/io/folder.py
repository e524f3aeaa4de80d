"""Folders with one image per view: which views are needed, and reading and writing them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.io.images import check_decoded_images, check_samples, read_image, write_png
from epinet.io.problems import Problems, listed
from epinet.lightfield import LightField

Position = tuple[int, int]
"""(row, col) of a view in the grid."""


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
    n = side if len(files) == side * side else _star_side(files, side, folder)
    origin = (side - 1) // 2 - (n - 1) // 2
    inside = {
        (row - origin, col - origin): file
        for (row, col), file in sorted(files.items())
        if origin <= row < origin + n and origin <= col < origin + n
    }
    star = star_positions(n) if n % 2 else []
    problems = Problems(
        f"{folder / name(row + origin, col + origin)}: missing; "
        f"{n}x{n} views need the centre row and column and both diagonals, {len(star)} in all"
        for row, col in star
        if (row, col) not in inside
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
