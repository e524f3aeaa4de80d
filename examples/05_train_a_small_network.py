"""Change a recipe, train for a few steps, and predict with the weights."""

import sys
from pathlib import Path

import epinet
from epinet.synth.options import Options
from epinet.train.run import Run
from epinet.train.validation import Validation

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 256  # px, of the rendered views
STEPS = 4  # enough to see that it runs; the shipped weights took thousands

held_out = epinet.render_scene(Options(size=(SIZE, SIZE), held_out=True), seed=1, index=0)
epinet.write_light_field(OUT / "05" / "held_out", held_out, "hci", overwrite=True)

# Everything that decides what a run learns stands in its recipe; these are the values that differ.
recipe = epinet.load_recipe(
    "sweepnet",
    {
        "steps": STEPS,
        "batch": 2,
        "patch_px": 32,
        "large_patches": 0,
        "fewer_views": 0,
        "data": [{"generator": "narrow"}],
        "start": "sweepnet",  # the shipped weights learn on; "own" starts from scratch
        "validate_every": STEPS,
    },
)
run = Run(
    recipe, OUT / "05" / "run", validation=Validation.of_folders([OUT / "05" / "held_out"], 9)
)
run.train()  # the same call goes on after an interruption

result = epinet.load_model(OUT / "05" / "run" / "weights.safetensors").predict(held_out)
print(f"BadPix(.07) {result.scores['badpix_0.07']:.1f} % after {run.step} steps")
