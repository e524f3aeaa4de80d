"""Focus set afterwards: what the map says is near is sharp, then what is far, then everything."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import epinet
from epinet.effects.refocus import all_in_focus, refocus
from epinet.synth.options import Options

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 256  # px, of the rendered views

lf = epinet.render_scene(Options(size=(SIZE, SIZE)), seed=11, index=0)
disparity = epinet.load_model().predict(lf).disparity
far_px, near_px = np.percentile(disparity, [5, 95])

(OUT / "03").mkdir(parents=True, exist_ok=True)
pictures = {
    "near": refocus(lf, near_px, disparity),
    "far": refocus(lf, far_px, disparity),
    "everything": all_in_focus(lf, disparity),
}
for name, picture in pictures.items():
    Image.fromarray(picture).save(OUT / "03" / f"{name}.png")
print(f"sharp at {near_px:.1f} px and at {far_px:.1f} px -> {OUT / '03'}")
