"""How far SweepNet's map in tiles is from that of the whole picture.

    python -m benchmarks.tiles LIGHTFIELD ... [--memory 40]

Of each light field: the largest and the mean difference, and the share of pixels that differ by
more than .02 px.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import epinet
from epinet.arguments import Parser

WHOLE_MB = 1e5


def main() -> None:
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("lightfields", type=Path, nargs="+")
    parser.add_argument("--memory", type=float, default=40.0, help="MB; default: %(default)s")
    args = parser.parse_args()
    model = epinet.load_model(model="sweepnet")
    for path in args.lightfields:
        lf = epinet.read_light_field(path)
        whole, tiled = (
            model.predict(lf, refine=False, memory_mb=megabytes).disparity
            for megabytes in (WHOLE_MB, args.memory)
        )
        difference = np.abs(tiled - whole)
        print(
            f"{path.name}: at most {difference.max():.2f} px, {difference.mean():.5f} px in the "
            f"mean, {100 * (difference > 0.02).mean():.2f} % of the pixels beyond .02 px",
            flush=True,
        )


if __name__ == "__main__":
    main()
