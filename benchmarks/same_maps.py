"""Whether a change of the code leaves every map as it was, to the last bit on one machine.

    python -m benchmarks.same_maps FOLDER -o before.json     # before the change
    python -m benchmarks.same_maps FOLDER --than before.json # after it; status 1 if any differs

Takes the central part of each light field in FOLDER (the four real ones, say) and of three
rendered ones. All shipped weights predict them; the first also in tiles, at half size and as an
ensemble.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

import epinet
from epinet.arguments import Parser
from epinet.lightfield import LightField
from epinet.networks.weights import shipped_weights
from epinet.predict.batch import find_light_fields
from epinet.predict.result import Result
from epinet.synth.generator import render_scene
from epinet.synth.options import RANGES_PX, Options

SIDE_PX = 96


def light_fields(folder: Path) -> Iterator[tuple[str, LightField]]:
    """Central parts of those of a folder, then rendered ones."""
    for path in find_light_fields([folder]):
        lf = epinet.read_light_field(path)
        top, left = ((side - SIDE_PX) // 2 for side in lf.size)
        rows, cols = slice(top, top + SIDE_PX), slice(left, left + SIDE_PX)
        truth = None if lf.truth is None else lf.truth[rows, cols]
        views = lf.views[:, :, rows, cols]
        part = replace(lf, views=views, truth=truth, view_truths={}, masks={}, objects=None)
        yield path.name, part
    for seed, name in enumerate(RANGES_PX, 1):
        options = Options(size=(SIDE_PX, SIDE_PX), disparity_px=RANGES_PX[name])
        yield f"rendered {name}", render_scene(options, seed, 0)


def digest(result: Result) -> str:
    """Of the map."""
    return hashlib.sha256(np.ascontiguousarray(result.disparity).tobytes()).hexdigest()[:16]


def digests(folder: Path) -> dict[str, str]:
    """Of every light field by every shipped network."""
    found = {}
    for k, (name, lf) in enumerate(light_fields(folder)):
        for weights in shipped_weights():
            model = epinet.load_model(weights)
            found[f"{name}, {weights}"] = digest(model.predict(lf))
            if k == 0:
                found[f"{name}, {weights}, tiles"] = digest(model.predict(lf, memory_mb=10))
                found[f"{name}, {weights}, half"] = digest(model.predict(lf, scale=2))
        print(name, file=sys.stderr, flush=True)
        if k == 0:
            ensemble = epinet.load_model().predict(lf, ensemble=True)
            found[f"{name}, ensemble"] = digest(ensemble)
    return found


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of light fields")
    parser.add_argument("-o", "--output", type=Path, help="JSON to write")
    parser.add_argument("--than", type=Path, help="JSON written before, to compare with")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    found = digests(chosen.folder)
    if chosen.output:
        chosen.output.write_text(json.dumps(found, indent=1) + "\n")
    if chosen.than:
        before = json.loads(chosen.than.read_text())
        names = before.keys() | found.keys()
        others = sorted(name for name in names if before.get(name) != found.get(name))
        print(f"{len(names) - len(others)} maps are the same, {len(others)} are not", *others)
        sys.exit(1 if others else 0)


if __name__ == "__main__":
    main()
