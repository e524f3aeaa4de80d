"""A data set on disk: rendered scenes as folders of the 4D Light Field Benchmark's layout.

OUT/dataset.json says what the scenes were rendered from. Scenes are independent of each other and
appear whole or not at all, so an interrupted data set can be continued, and a scene that was
removed comes back as it was.
"""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from epinet import __version__
from epinet.documents import JSON_BYTES, parse_json, validated
from epinet.errors import InputError
from epinet.io import hci, write_light_field
from epinet.io.atomic import atomic_path, check_writable, remove_leftovers
from epinet.io.problems import listed, parsing
from epinet.io.read import SMALLEST_VIEW_PX
from epinet.lightfield import LightField
from epinet.reading import read_bytes
from epinet.synth.generator import VERSION, render_scene
from epinet.synth.options import RANGES_PX, Options

Existing = Literal["refuse", "resume", "replace"]
"""What to do where a data set of ours stands already."""

RECORD = "dataset.json"
SHEETS = ("sheet.png", "sheet_2.png")
STATISTICS = ("statistics.json", "statistics.png")

_KIND = "rendered light fields"
_BESIDES_SCENES = frozenset({RECORD, *SHEETS, *STATISTICS})
_PNG_SHARE = 0.7
"""Bytes of a view as PNG per byte of its pixels; noise hardly compresses."""


class _Record(BaseModel):
    """What is read of dataset.json; the rest is compared only."""

    model_config = ConfigDict(strict=True, extra="allow")

    kind: str
    scenes: list[Annotated[str, Field(pattern=r"^\w[\w.-]*$", max_length=200)]]
    """Names of folders beside it."""


def write_dataset(
    out: Path,
    options: Options,
    seed: int,
    scenes: int,
    *,
    star_only: bool = False,
    truths: bool = False,
    textures: Path | None = None,
    device: str = "cpu",
    existing: Existing = "refuse",
    advance: Callable[[float], None] = lambda share: None,
) -> list[Path]:
    """Write `scenes` scenes to `out`/scene_00000 and so on; see `write_scenes`."""
    if scenes < 1:
        raise InputError(f"a data set of {scenes} scenes: at least 1 is needed")
    return write_scenes(
        out,
        {f"scene_{index:05d}": options for index in range(scenes)},
        seed,
        {"options": options.as_dict()},
        star_only=star_only,
        truths=truths,
        textures=textures,
        device=device,
        existing=existing,
        advance=advance,
    )


def write_scenes(
    out: Path,
    scenes: Mapping[str, Options],
    seed: int,
    about: Mapping[str, Any],
    *,
    star_only: bool = False,
    truths: bool = False,
    textures: Path | None = None,
    device: str = "cpu",
    existing: Existing = "refuse",
    advance: Callable[[float], None] = lambda share: None,
) -> list[Path]:
    """Render scenes into a folder each, and dataset.json; nothing is lost to a refusal.

    Args:
        out: the folder of the data set.
        scenes: name and options of each; a scene's index is its place here.
        seed: scenes of different seeds have nothing in common.
        about: what dataset.json says of the options.
        star_only: only the views that the network sees.
        truths: with the truth of the eight views around the centre.
        textures: a folder of photographs to take textures from.
        device: where to render; the scenes are the same on all.
        existing: "resume" makes the scenes that are missing from a data set of the same options,
            more of them if more are asked for; "replace" removes a data set of ours first.
        advance: told the share of the work after each scene.

    Returns:
        The folder of every scene.

    Raises:
        InputError: `out` holds something else, is begun with other options, cannot be written or
            has too little space, or the scenes cannot be rendered.
    """
    record = _record(scenes, seed, about, star_only, truths, textures)
    old = _check_output(out, record, existing)
    todo = [name for name in scenes if existing == "replace" or not (out / name).is_dir()]
    _check_sizes({scenes[name].size for name in todo})
    _check_space(out, [scenes[name] for name in todo], star_only, truths, old)
    check_writable(out)
    places = {name: index for index, name in enumerate(scenes)}
    for done, name in enumerate(todo):
        lf = render_scene(
            scenes[name],
            seed,
            places[name],
            device,
            star_only=star_only,
            truths=truths,
            textures=textures,
        )
        if done == 0:  # only now: what cannot be rendered must not cost the old data set
            _begin(out, record, old)
        _write_scene(out, name, lf, len(scenes) - len(todo) + done, len(scenes))
        advance(1 / len(todo))
    return [out / name for name in scenes]


def read_record(out: Path) -> dict[str, Any]:
    """The content of dataset.json.

    Raises:
        InputError: the folder holds no data set of ours.
    """
    path = out / RECORD
    foreign = f"{out}: no data set of epinet ({RECORD} is missing or of something else)"
    if not path.exists():
        raise InputError(foreign)
    with parsing(path, "the record of a data set"):
        record = parse_json(read_bytes(path, JSON_BYTES), path)
    if not isinstance(record, dict) or record.get("kind") != _KIND:
        raise InputError(foreign)
    validated(_Record, record, path)
    found: dict[str, Any] = record
    return found


def existing_from(resume: bool, force: bool) -> Existing:
    """What two switches of a command mean together.

    Raises:
        InputError: they contradict each other.
    """
    if resume and force:
        raise InputError("--resume keeps what is there, --force replaces it: give one of them")
    return "resume" if resume else "replace" if force else "refuse"


def parse_range(text: str) -> tuple[float, float]:
    """Bounds of disparity from the name of a preset or "LOW,HIGH".

    Raises:
        InputError: neither.
    """
    if text in RANGES_PX:
        return RANGES_PX[text]
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = math.nan
    if not math.isfinite(low) or not math.isfinite(high):
        raise InputError(
            f"range {text}: give {', '.join(RANGES_PX)} or LOW,HIGH in px per view, as in -4,4"
        )
    return low, high


def parse_size(text: str) -> tuple[int, int]:
    """(height, width) from "WIDTHxHEIGHT".

    Raises:
        InputError: the text is something else.
    """
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text)
    if match is None:
        raise InputError(f"size {text}: give WIDTHxHEIGHT in px, as in 512x512")
    return int(match[2]), int(match[1])


def _record(
    scenes: Mapping[str, Options],
    seed: int,
    about: Mapping[str, Any],
    star_only: bool,
    truths: bool,
    textures: Path | None,
) -> dict[str, Any]:
    record = {
        "kind": _KIND,
        "epinet": __version__,
        "generator": VERSION,
        "seed": seed,
        "star_only": star_only,
        "truths": truths,
        "textures": None if textures is None else str(textures.resolve()),
        **about,
        "scenes": list(scenes),
    }
    same: dict[str, Any] = json.loads(json.dumps(record))  # as it will be read back
    return same


def _check_output(out: Path, record: Mapping[str, Any], existing: Existing) -> list[Path]:
    """What is to be removed before the first scene is written."""
    if not out.is_dir():
        if out.exists():
            raise InputError(f"{out}: a file stands where the data set would go")
        return []
    remove_leftovers(out)
    entries = _entries(out)
    if not entries:
        return []
    if existing == "refuse":
        raise InputError(
            f"{out}: not empty; --resume continues a data set that stands there, "
            "--force replaces it"
        )
    held = read_record(out)
    leftovers = [p for p in entries if _is_leftover(p, {*held["scenes"], *record["scenes"]})]
    if existing == "resume":
        _check_same(out, held, record)
        return leftovers
    ours = [p for p in entries if p.name in _BESIDES_SCENES or p.name in held["scenes"]]
    foreign = sorted(set(entries) - set(ours) - set(leftovers))
    inside = [file for p in ours if p.is_dir() for file in _entries(p)]
    foreign += [file for file in inside if not re.fullmatch(hci.LAYOUT.file_names, file.name)]
    if foreign:
        names = listed([str(p.relative_to(out)) for p in foreign], 3)
        raise InputError(f"{out}: other things than the data set are in it, move them: {names}")
    # The record goes last, by being overwritten: it tells what else is ours until then.
    return [p for p in ours if p.name != RECORD] + leftovers


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder}: cannot be listed ({error.strerror})") from error


def _is_leftover(path: Path, scenes: set[str]) -> bool:
    """Whether this is the temporary name of a thing of ours, as earlier versions left it when they
    were killed."""
    match = re.fullmatch(r"\.(\w+)\.[0-9a-f]{8}(\.\w+)?", path.name)
    return match is not None and match[1] + (match[2] or "") in scenes | _BESIDES_SCENES


def _check_same(out: Path, held: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    free = ("epinet", "scenes")
    there, here = (_flat({k: v for k, v in r.items() if k not in free}) for r in (held, wanted))
    differences = [
        f"{key} is {there.get(key)} there, {here.get(key)} here"
        for key in sorted(there.keys() | here.keys())
        if there.get(key) != here.get(key)
    ]
    if not set(held["scenes"]) <= set(wanted["scenes"]):
        counts = len(held["scenes"]), len(wanted["scenes"])
        differences.append("{} scenes are there or begun, {} are asked for".format(*counts))
    if differences:
        raise InputError(
            f"{out}: cannot be continued, as it was begun otherwise: {'; '.join(differences)}"
        )


def _flat(tree: Any, prefix: str = "") -> dict[str, Any]:
    """Leaves of nested mappings by dotted name."""
    if not isinstance(tree, dict):
        return {prefix: tree}
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return leaves


def _check_sizes(sizes: set[tuple[int, int]]) -> None:
    small = [f"{w}x{h}" for h, w in sorted(sizes) if min(h, w) < SMALLEST_VIEW_PX]
    if small:
        raise InputError(
            f"views of {', '.join(small)} px are too small to be read again: "
            f"{SMALLEST_VIEW_PX}x{SMALLEST_VIEW_PX} px at least"
        )


def _check_space(
    out: Path, todo: list[Options], star_only: bool, truths: bool, old: list[Path]
) -> None:
    needed = sum(_scene_bytes(options, star_only, truths) for options in todo)
    parent = next(p for p in (out.resolve(), *out.resolve().parents) if p.is_dir())
    files = [file for p in old for file in (p.iterdir() if p.is_dir() else [p])]
    free = shutil.disk_usage(parent).free + sum(file.stat().st_size for file in files)
    if needed > free:
        raise InputError(
            f"{out}: about {math.ceil(needed / 1e6)} MB are needed, "
            f"{free // 1_000_000} MB are free; "
            "fewer or smaller scenes or --star need less"
        )


def _scene_bytes(options: Options, star_only: bool, truths: bool) -> int:
    """About what a scene takes on disk: views, disparities and depth."""
    views = 4 * options.views - 3 if star_only else options.views**2
    maps = 10 if truths else 2
    return int(math.prod(options.size) * (3 * _PNG_SHARE * views + 4 * maps))


def _begin(out: Path, record: Mapping[str, Any], old: list[Path]) -> None:
    for path in old:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    with atomic_path(out / RECORD) as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _write_scene(out: Path, name: str, lf: LightField, done: int, total: int) -> None:
    try:
        write_light_field(out / name, lf, "hci")
    except InputError as error:
        kept = f"{out}: {done} of {total} scenes are finished; --resume makes the others"
        raise InputError([*error.problems, kept]) from error
