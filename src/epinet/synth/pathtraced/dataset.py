"""A folder of path-traced scenes: made by one resumable command, with its record beside it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from epinet.documents import JSON_BYTES, parse_json, validated
from epinet.errors import InputError
from epinet.io.atomic import atomic_path, check_writable
from epinet.io.convert import write_light_field
from epinet.io.images import write_png
from epinet.io.problems import parsing
from epinet.progress import progress
from epinet.reading import read_bytes
from epinet.synth.pathtraced.assets import PACKAGES, Library
from epinet.synth.pathtraced.backend import load_mitsuba
from epinet.synth.pathtraced.render import Rendering, Settings, render_scene
from epinet.synth.pathtraced.scenes import SCENES

RECORD = "dataset.json"
OBJECTS = "objectids_lowres.png"
_PARTS = ".parts"


class _Record(BaseModel):
    """What is read of RECORD."""

    scenes: dict[str, dict[str, Any]]


def make_dataset(
    out: Path,
    *,
    scenes: list[str] | None = None,
    settings: Settings | None = None,
    assets: Path | None = None,
    threads: int = 1,
    variant: str | None = None,
) -> dict[str, Any]:
    """Render scenes into folders of layout `hci`; scenes and views that are there stay.

    Each scene's folder holds the star of 9x9 views, truth, depth, the masks `invalid` (mirrors
    and glass) and `discontinuities`, and OBJECTS. RECORD says how each was rendered, how noisy
    it is, and the source and licence of every asset in it.

    Args:
        out: folder of the scenes.
        scenes: names; None makes all of SCENES.
        settings: size and samples.
        assets: folder of downloaded packages, where they are not installed.
        threads: how many threads may render.
        variant: of Mitsuba; None takes the fastest that works.

    Returns:
        what RECORD holds.

    Raises:
        InputError: an unknown scene, missing software or assets, or a folder in the way.
    """
    settings = settings or Settings()
    names = _known(scenes)
    mi = load_mitsuba(threads, variant)
    library = Library(assets, out / _PARTS / "assets")
    check_writable(out)
    record = _read_record(out)
    waiting = [name for name in names if not _finished(out, record, name, settings)]
    for name in waiting:
        scene = SCENES[name]()
        parts = out / _PARTS / f"{name}_{settings.fingerprint(scene)}"
        with progress(name) as done:
            rendering = render_scene(mi, scene, library, settings, parts, done)
        _write_scene(out / name, rendering)
        record["scenes"][name] = rendering.record
        _write_record(out, record)
        shutil.rmtree(parts)
    return record


def _known(scenes: list[str] | None) -> list[str]:
    names = list(SCENES) if scenes is None else scenes
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        raise InputError(f"no scene is named {', '.join(unknown)}; there are {', '.join(SCENES)}")
    return names


def _finished(out: Path, record: dict[str, Any], name: str, settings: Settings) -> bool:
    """Whether a scene is there as wanted; one that is there otherwise is not overwritten."""
    if not (out / name).exists():
        return False
    fingerprint = settings.fingerprint(SCENES[name]())
    if record["scenes"].get(name, {}).get("fingerprint") == fingerprint:
        return True
    if (out / _PARTS / f"{name}_{fingerprint}").exists():
        return False  # stopped between writing the scene and its record
    raise InputError(
        f"{out / name}: holds something else than these settings make; "
        "remove it or choose another folder"
    )


def _write_scene(folder: Path, rendering: Rendering) -> None:
    write_light_field(folder, rendering.light_field, "hci", overwrite=True)
    write_png(folder / OBJECTS, rendering.objects)


def _read_record(out: Path) -> dict[str, Any]:
    path = out / RECORD
    if not path.exists():
        packages = {f"{p.name} {p.version}": f"{p.origin}; {p.licence}" for p in PACKAGES.values()}
        made_by = "python -m epinet.synth.pathtraced"
        return {"made_by": made_by, "packages": packages, "scenes": {}}
    with parsing(path, "the record of this folder"):
        record = parse_json(read_bytes(path, JSON_BYTES), path)
    validated(_Record, record, path)
    found: dict[str, Any] = record
    return found


def _write_record(out: Path, record: dict[str, Any]) -> None:
    with atomic_path(out / RECORD) as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
