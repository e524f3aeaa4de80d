"""Render a scene with known truth, predict its disparity, score it and save the result."""

import sys
from pathlib import Path

import epinet
from epinet.synth.options import Options

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 256  # px, of the rendered views

# A light field is an array of views, (rows, columns, H, W, channels), with a camera if it is known.
lf = epinet.render_scene(Options(size=(SIZE, SIZE), textureless=0.0), seed=7, index=0)
print(f"{lf.views.shape} views, centre view {lf.centre}")

# Any layout on disk reads as the same object: epinet.read_light_field("folder or file").
epinet.write_light_field(OUT / "01" / "scene", lf, "hci", overwrite=True)
lf = epinet.read_light_field(OUT / "01" / "scene")

result = epinet.load_model().predict(lf)
low, high = result.disparity.min(), result.disparity.max()
print(f"disparity {low:.2f}..{high:.2f} px per adjacent view, positive is nearer")
print(f"mean confidence {result.confidence.mean():.2f}")

# The scene came with its truth, so there are scores: percent of pixels off by more than .07 px.
print(f"BadPix(.07) {result.scores['badpix_0.07']:.1f} %")
print(f"look at {result.save(OUT / '01' / 'result') / 'preview.png'}")
