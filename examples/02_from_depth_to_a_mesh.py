"""From a disparity map and a camera to metric depth and a textured mesh."""

import sys
from pathlib import Path

import epinet
from epinet.geometry.surface import surface
from epinet.geometry.surface_files import write_surface
from epinet.synth.options import Options

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 256  # px, of the rendered views

lf = epinet.render_scene(Options(size=(SIZE, SIZE), disparity_px=(-1.5, 1.5)), seed=3, index=0)
result = epinet.load_model().predict(lf)

# Depth follows from the disparity, the baseline, the focal length and the distance in focus.
camera = lf.camera
depth_mm = camera.depth_mm(result.disparity)
print(f"the nearest point is {depth_mm.min():.0f} mm away, the farthest {depth_mm.max():.0f} mm")

# A mesh of what the centre view sees, cut where no slant explains the jump in depth.
shape = surface(result.disparity, result.centre_view, camera, keep=result.confidence > 0.3)
print(shape.describe())
(OUT / "02").mkdir(parents=True, exist_ok=True)
print(f"open {write_surface(OUT / '02' / 'mesh.glb', shape)[0]} in any viewer")
