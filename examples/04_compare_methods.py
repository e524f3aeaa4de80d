"""Score a model and somebody's maps on the same scenes, and write a report."""

import sys
from pathlib import Path

import numpy as np

import epinet
from epinet.benchmark.evaluate import evaluate
from epinet.benchmark.methods import prepare
from epinet.benchmark.report import write_report
from epinet.progress import progress
from epinet.synth.options import Options

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 256  # px, of the rendered views

scenes, maps = OUT / "04" / "scenes", OUT / "04" / "constant"
for index in range(2):
    lf = epinet.render_scene(Options(size=(SIZE, SIZE)), seed=21, index=index)
    epinet.write_light_field(scenes / f"scene_{index}", lf, "hci", overwrite=True)
    # Any program's maps will do: SCENE.pfm, .npy or .mat, px per adjacent view, positive is nearer.
    constant = np.full(lf.size, np.nanmedian(lf.truth), np.float32)
    epinet.write_pfm(maps / f"scene_{index}.pfm", constant)

prepared = prepare(["sweepnet", f"constant={maps}"], scenes)
methods = prepared.run(OUT / "04" / "report" / "maps", progress=progress)
metrics = epinet.benchmark_metrics()
scored = evaluate(methods, prepared.scenes, metrics)
for method in methods:
    mean, _ = scored.mean(method, metrics[0])
    print(f"{method.name:10} {metrics[0].name} {mean:.1f} {metrics[0].unit}")
print(f"look at {write_report(scored, OUT / '04' / 'report')}")
