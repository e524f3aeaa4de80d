"""Reading a light field in whatever layout it lies on disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from epinet.errors import InputError
from epinet.io import array, eslf, hci, hci_hdf5, lftoolbox, lytro_raw, numbered, rows_cols
from epinet.io.images import IMAGE_SUFFIXES, image_files
from epinet.io.layout import Layout
from epinet.io.names import is_shown
from epinet.lightfield import LightField
from epinet.raw import DEFAULT_VIEWS, decode
from epinet.raw.family import calibration_by_name
from epinet.texts import is_pointer

_MODULES = (hci, rows_cols, numbered, eslf, hci_hdf5, lftoolbox, array, lytro_raw)

LAYOUTS: dict[str, Layout] = {module.LAYOUT.name: module.LAYOUT for module in _MODULES}
"""Every layout by name, in the order in which they are tried."""

_ARCHIVES = frozenset({".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar"})
SMALLEST_VIEW_PX = 23
"""The network's receptive field: no estimate can be made from less."""


def read_light_field(path: str | Path, layout: str | None = None) -> LightField:
    """Read a light field from a folder of views or a single file.

    Args:
        path: the folder or file.
        layout: a name of LAYOUTS, to override the guess.

    Raises:
        InputError: everything found wrong, each problem naming its file and what would help.

    Example:
        >>> lf = read_light_field("scenes/antinous")  # doctest: +SKIP
        >>> lf.layout, lf.grid, lf.size  # doctest: +SKIP
        ('hci', (9, 9), (512, 512))
    """
    path = Path(path)
    return _read(path, lambda: _recognised(path) if layout is None else named_layout(layout))


def read_raw(
    path: Path,
    white: Path | None = None,
    views: int = DEFAULT_VIEWS,
    progress: Callable[[float], None] = lambda share: None,
) -> LightField:
    """Read a raw capture, as `read_light_field` does, with a say in how it is decoded.

    Args and errors: as of `epinet.raw.decode`.
    """
    told = replace(lytro_raw.LAYOUT, read=lambda raw: decode(raw, white, views, progress))
    return _read(path, lambda: told)


def _read(path: Path, choose: Callable[[], Layout]) -> LightField:
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    try:
        if path.is_dir():
            _check_names(path)
        chosen = choose()
        if chosen.is_folder != path.is_dir():
            due, found = ("folder", "file") if chosen.is_folder else ("file", "folder")
            raise InputError(
                f"{path}: a {found}, but the layout {chosen.name} is a {due}: {chosen.description}"
            )
        lf = chosen.read(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    _check(lf, path)
    captured = lf.captured or not chosen.rendered
    return replace(lf, source=path, layout=chosen.name, captured=captured)


def is_light_field(path: Path) -> bool:
    """Whether some layout recognises the folder or file, be it whole or damaged."""
    return any(layout.fits(path) for layout in LAYOUTS.values())


def is_stray(path: Path, layout: str | None = None) -> bool:
    """Whether a file has the ending of a light field, but by its header holds something else.

    Args:
        path: of a file or a folder; a folder is none.
        layout: a name of LAYOUTS that it would be read as; None guesses.
    """
    if path.is_dir() or is_pointer(path):
        return False
    layouts = LAYOUTS.values() if layout is None else [named_layout(layout)]
    chosen = next((each for each in layouts if each.fits(path)), None)
    try:
        return chosen is not None and not chosen.holds_views(path)
    except Exception:  # damaged: reading it tells how
        return False


def named_layout(name: str) -> Layout:
    """The layout of that name.

    Raises:
        InputError: there is none.
    """
    if name not in LAYOUTS:
        raise InputError(f"no layout is named {name}; there are {', '.join(LAYOUTS)}")
    return LAYOUTS[name]


def _recognised(path: Path) -> Layout:
    for layout in LAYOUTS.values():
        if layout.fits(path):
            return layout
    understood = "; ".join(f"{each.name}: {each.description}" for each in LAYOUTS.values())
    raise InputError(f"{path}: {_found(path)}. Layouts understood: {understood}")


def _found(path: Path) -> str:
    """What is there, in words, for a path that no layout recognises."""
    if path.is_file():
        if calibration := calibration_by_name(path):
            return calibration
        kind = f"a {path.suffix or 'nameless'} file holds no light field"
        archive = path.suffix.lower() in _ARCHIVES
        return f"{kind}; unpack the archive and give the folder" if archive else kind
    entries = [entry for entry in path.iterdir() if is_shown(entry)]
    if not entries:
        return "the folder is empty"
    images, folders = image_files(path), [entry for entry in entries if entry.is_dir()]
    files = [entry for entry in entries if entry not in images and entry not in folders]
    counts = f"{len(images)} images, {len(folders)} folders and {len(files)} other files"
    if images:
        counts += f", such as {images[0].name}; views are named view_<row>_<column>.png or alike"
    elif folders:
        counts += "; the views may lie in one of the folders"
    endings = Counter(file.suffix.lower() for file in files if file.suffix)
    if not images and endings:
        ending, count = endings.most_common(1)[0]
        read = ", ".join(sorted(IMAGE_SUFFIXES))
        counts += f"; {count} of them end in {ending}, images that are read end in {read}"
    return f"not recognised: {counts}"


def _check_names(path: Path) -> None:
    """Refuse what a packer for Windows and an unpacker that takes its names literally have left."""
    backslashed = sorted(file.name for file in path.iterdir() if "\\" in file.name)
    if backslashed:
        raise InputError(
            f"{path}: {len(backslashed)} names hold a backslash, such as {backslashed[0]}: folders "
            "of an archive packed by Windows that were not made; unpack it again with `unzip`, "
            "which makes them, or rename the files"
        )


def _check(lf: LightField, path: Path) -> None:
    (rows, cols), (height, width) = lf.grid, lf.size
    problems = []
    if rows != cols:
        problems.append(f"{path}: {rows} rows and {cols} columns of views; a square grid is needed")
    if min(rows, cols) < 3:
        problems.append(f"{path}: {rows}x{cols} views; at least 3x3 are needed")
    if min(height, width) < SMALLEST_VIEW_PX:
        problems.append(
            f"{path}: too small: views of {width}x{height} px; at least "
            f"{SMALLEST_VIEW_PX}x{SMALLEST_VIEW_PX} px are needed, the network's field of view"
        )
    if problems:
        raise InputError(problems)
