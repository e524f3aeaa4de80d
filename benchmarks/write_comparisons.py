"""Write docs/comparisons.md from the runs saved in benchmarks/results.

    python -m benchmarks.write_comparisons

Nothing is measured here: `benchmarks.peers` and `benchmarks.paper_tables` have done that.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.peers.keras_epinet import REQUIREMENT
from benchmarks.peers.methods import OURS
from benchmarks.peers.tables import SCORES, markdown
from benchmarks.stated_ranges import KEPT, note
from epinet.benchmark.published import CLAIM, METRICS, MISSING, PUBLISHED
from epinet.benchmark.scenes import BENCHMARK_SCENES
from epinet.synth.generator import VERSION

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "comparisons.md"

HEAD = """# Comparisons

Written by `python -m benchmarks.write_comparisons` from the runs saved in
[benchmarks/results](../benchmarks/results). Scores are those of the 4D Light Field Benchmark:
BadPix in percent of the pixels, MSE x100 in px^2, a border of 15 px left out, against truth of the
views' own size."""

PEERS = """## What else one would pick

    python -m benchmarks.peers ~/.cache/epinet/pathtraced lightfields/antinous \\
        -o benchmarks/results/peers.json --picture docs/images/peers.png --show toys

runs every method on every light field in a process of its own, with the same number of threads.

- **structure tensor**: slopes of lines in the horizontal and vertical epipolar images, sheared by
  every whole pixel of the range; the most coherent wins; total variation with an L1 data term,
  weighted by the coherence (Wanner and Goldluecke, CVPR 2012 and PAMI 2014). Scales and filters are
  those of the authors' code; two thresholds and the weights of the total variation were chosen on
  rendered scenes.
- **plane sweep**: truncated differences of colour and gradient over the views of the star, .1 px
  apart, each slice filtered by a guided filter with the centre view in colour, the least cost and a
  parabola (Hosni et al., PAMI 2013; its parameters).
- **Keras EPINET**: the reference architecture in Keras (`{requirement}`, which the script
  installs into an environment of its own), with the weights of our `epinet_9x9` written into its
  HDF5 layout. Its time is that of `model.predict` alone, its map that of the network.
- **SweepNet** and **EPINET**: what `epinet predict` does, from views in memory to the map, with the
  search for the range of disparities (SweepNet) and the confidence.

The structure tensor and the plane sweep are told the range of disparities that `parameters.cfg`
states (`antinous` comes without); whether those of SweepNet and EPINET stay within it is said
below. These two were trained on rendered scenes of our own generator, on none of these. SweepNet's
parts and the slants of its training scenes were chosen with the path-traced set in view, which is
of another renderer (`make pathtraced`, 256x256 px); on `antinous` nothing was tuned. Mirrors and
panes are left out but in the scene `mirrors`."""

TABLES = """## The paper's tables

    python -m benchmarks.paper_tables streams                      # table 1, figure 3
    python -m benchmarks.paper_tables views                        # table 2
    python -m benchmarks.paper_tables wide                         # table 3
    python -m benchmarks.paper_tables ensemble SCENES...           # Epinet-fcn and -fcn-m
    python -m benchmarks.paper_tables capture lightfields/lytro_2067   # figure 11

Every run is saved as a file and not repeated; a training that was stopped continues. Tables come
as Markdown and LaTeX beside the runs. Tables 1 and 2 take `--budget hours` unless told otherwise:
the paper's setting, a few scenes that are always the same, with a narrower network and our
optimisation; `days` is the paper's own optimisation for its ten million steps and three seeds. In
every budget the views, streams and augmentations are those of the paper's recipes, and all runs are
judged by the same scenes; `--data` and `--validation` take the benchmark's in place of ours."""


RENDERED = ("hours/streams", "hours/views", "wide")
"""Tables from scenes of the generator, whose version they name."""


def read(name: str) -> Any:
    return json.loads((RESULTS / f"{name}.json").read_text())


def peers() -> Iterator[str]:
    report = read("peers")
    yield PEERS.format(requirement=REQUIREMENT)
    scenes = [scene for of_set in report["sets"].values() for scene in of_set.values()]
    bounded = {m: [scene["methods"][m].get(KEPT) for scene in scenes] for m in OURS}
    runs = "one run" if report["repeats"] == 1 else f"median of {report['repeats']} runs"
    yield (
        f"Measured on {report['machine']}, {report['threads']} thread, float32, {runs} in one "
        "process. Other work kept the machine busy, so that wall "
        "times mean nothing; an idle machine would need about the CPU time, or a little less. Peak "
        "memory is the whole process's, with Python, torch (some 230 MB) and the views. "
        f"{note(bounded)}"
    )
    yield markdown(report)
    yield "![peers](images/peers.png)"
    equal = report["keras_equals_ours"]
    versions = ", ".join(f"{name} {version}" for name, version in equal["versions"].items())
    yield (
        f"**Equality** ({versions}): with the shipped weights, whose input normalisation is "
        "applied to the views beforehand, Keras' map and ours differ by at most "
        f"{equal['epinet_9x9']['largest_difference_px']:.1e} px; with random weights and plain "
        f"gray views by {equal['random']['largest_difference_px']:.1e} px "
        f"(standard deviation of that map: {equal['random']['deviation_of_map_px']} px). The "
        "script ends with an error above 1e-4 px."
    )


def paper_tables() -> Iterator[str]:
    yield TABLES
    for name in (*RENDERED, "ensemble", "capture"):
        file = RESULTS / "paper_tables" / f"{name}.md"
        if not file.exists():
            continue
        table = file.read_text()
        yield table.rstrip()
        if name in RENDERED and VERSION not in table:
            yield f"This table is older than the scenes of {VERSION}: to be measured anew."
        if name == "hours/streams":
            yield f"![figure 3](../benchmarks/results/paper_tables/{name}.png)"


def figures() -> Iterator[str]:
    yield "### Figures 1, 7 and 8: accuracy, rank and run time"
    yield (
        "Published means of the benchmark's twelve scenes, on the site and by the methods' "
        "authors, and run times on their own machines; `epinet evaluate` draws the figures with "
        f"one's own maps, on the scenes that are there. {CLAIM} {MISSING}"
    )
    lines = [["method", *SCORES.values(), "s", "source"]]
    lines.append(["---"] * len(lines[0]))
    for other in PUBLISHED:
        known = [*(other.mean(metric, BENCHMARK_SCENES) for metric in METRICS), other.seconds]
        cells = ["-" if figure is None else f"{figure:g}" for figure in known]
        lines.append([other.name, *cells, other.source])
    yield "\n".join(f"| {' | '.join(line)} |" for line in lines)


def page() -> str:
    return "\n\n".join([HEAD, *peers(), *paper_tables(), *figures()]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
