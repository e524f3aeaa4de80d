"""Writing a light field in any layout that can be read."""

from __future__ import annotations

import re
from pathlib import Path

from epinet.errors import InputError
from epinet.io.atomic import atomic_folder, atomic_path
from epinet.io.names import strangers
from epinet.io.problems import listed
from epinet.io.read import LAYOUTS, named_layout
from epinet.lightfield import LightField


def write_light_field(
    path: str | Path, lf: LightField, layout: str, *, overwrite: bool = False
) -> None:
    """Write a light field, its views without loss.

    Camera, truth and masks are kept by `hci`; truth also by `array` (.npz), and by `hci_hdf5`
    where the camera is known. A failure leaves what was there before.

    Args:
        path: the folder or file to make.
        lf: what to write.
        layout: a name of LAYOUTS.
        overwrite: replace what is at `path`; a folder as a whole, see `check_target`.

    Raises:
        InputError: an unknown layout or one that is only read, a suffix that is not the layout's,
            what `check_target` refuses, a light field that the layout cannot hold, or an
            unwritable path.

    Example:
        >>> write_light_field("antinous.npz", lf, "array")  # doctest: +SKIP
    """
    path = Path(path)
    chosen = named_layout(layout)
    if chosen.write is None:
        raise InputError(f"{path}: the layout {layout} can only be read")
    if chosen.suffixes and path.suffix.lower() not in chosen.suffixes:
        raise InputError(
            f"{path}: a file of the layout {layout} is named {' or '.join(chosen.suffixes)}"
        )
    if path.exists() and not overwrite:
        raise InputError(f"{path}: already exists; remove it or choose another name")
    check_target(path)
    atomic = atomic_folder if chosen.is_folder else atomic_path
    with atomic(path) as temporary:
        try:
            chosen.write(temporary, lf)
        except InputError as error:
            said = [p.replace(str(temporary), str(path)) for p in error.problems]
            raise InputError([p if str(path) in p else f"{path}: {p}" for p in said]) from error


def check_target(path: Path) -> None:
    """Refuse to replace a folder that holds more than a light field.

    Raises:
        InputError: files are in it that are not named as a layout names what it writes.
    """
    if not path.is_dir():
        return
    ours = "|".join(layout.file_names for layout in LAYOUTS.values() if layout.file_names)
    if others := strangers(path, re.compile(ours).fullmatch):
        raise InputError(
            f"{path}: other things than the files of a light field are in it "
            f"({listed(others, 3)}); choose another name"
        )


def left_out(path: Path, lf: LightField, layout: str) -> tuple[str, ...]:
    """What a light field holds and a layout does not, in words for the user."""
    has = {
        "camera": lf.camera is not None,
        "truth": lf.truth is not None,
        "masks": bool(lf.masks) or lf.objects is not None,
    }
    kept = {
        "hci": {*has},
        "hci_hdf5": {"truth"} if lf.camera is not None else set(),
        "array": {"truth"} if path.suffix.lower() == ".npz" else set(),
    }.get(layout, set())
    lost = [what for what in has if has[what] and what not in kept]
    return (f"not written, as {layout} does not hold it: {', '.join(lost)}",) if lost else ()


def layout_for(path: Path) -> str:
    """Name of the layout that a path asks for by its ending; without one, the benchmark's folder.

    Raises:
        InputError: no layout is written with that ending.

    Example:
        >>> layout_for(Path("scene")), layout_for(Path("scene_eslf.png"))
        ('hci', 'eslf')
    """
    suffix = path.suffix.lower()
    if not suffix or path.is_dir():
        return "hci"
    written = [layout for layout in LAYOUTS.values() if layout.write is not None]
    for layout in written:
        if suffix in layout.suffixes:
            return layout.name
    endings = ", ".join(suffix for layout in written for suffix in layout.suffixes)
    raise InputError(f"{path}: nothing is written as {suffix}; use a folder's name or {endings}")
