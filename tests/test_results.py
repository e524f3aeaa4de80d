"""The page of results says what the saved runs and the weights say."""

import re
import runpy
from pathlib import Path

from benchmarks.paper_tables.predictions import WIDE_SET
from epinet.networks.weights import load_weights, shipped_weights

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
HASHES = re.compile(r'"(\w+)(?: |": "|": \{\s*"sha256": ")([0-9a-f]{12,64})"')
"""Of weights, behind their names, in the ways that reports have them."""


def test_the_page_is_what_its_script_writes():
    script = runpy.run_path(str(ROOT / "benchmarks" / "write_results.py"))
    assert (ROOT / "docs" / "results.md").read_text() == script["page"]()


def test_all_is_measured_with_the_shipped_weights():
    shipped = {name: load_weights(name).sha256 for name in shipped_weights()}
    measured, stale = set(), set()
    for path in RESULTS.rglob("*.json"):
        if path.parent.name.startswith("wide_") and path.parent.name != WIDE_SET:
            continue  # of an older generator: the page of comparisons says so
        for name, digest in HASHES.findall(path.read_text()):
            if name in shipped:
                measured.add(path.relative_to(RESULTS).parts[0])
                if not shipped[name].startswith(digest):
                    stale.add((str(path.relative_to(RESULTS)), name))
    assert not stale
    assert measured >= {
        "calibration.json",
        "held_out.json",
        "paper_tables",
        "peers.json",
        "real_captures.json",
        "real_light_fields.json",
        "validation_sets.json",
    }
