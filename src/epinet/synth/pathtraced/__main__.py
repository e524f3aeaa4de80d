"""`python -m epinet.synth.pathtraced OUT`: render the path-traced scenes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from epinet.arguments import Parser
from epinet.errors import InputError
from epinet.synth.pathtraced.assets import HOW_TO_GET
from epinet.synth.pathtraced.backend import VARIANTS
from epinet.synth.pathtraced.dataset import RECORD, make_dataset
from epinet.synth.pathtraced.render import Settings
from epinet.synth.pathtraced.scenes import SCENES
from epinet.terminal import remark


def main(arguments: list[str] | None = None) -> int:
    """Render, telling progress on standard error; returns the exit status."""
    given = _parser().parse_args(arguments)
    try:
        record = make_dataset(
            given.out,
            scenes=given.scenes,
            settings=Settings(given.size, given.samples),
            assets=given.assets,
            threads=given.threads,
            variant=given.variant,
        )
    except InputError as error:
        for problem in error.problems:
            remark(f"error: {problem}")
        return 2
    remark(f"{given.out / RECORD}: {len(record['scenes'])} scenes")
    return 0


def _parser() -> Parser:
    defaults = Settings()
    parser = Parser(
        prog="python -m epinet.synth.pathtraced",
        description="Render path-traced light fields of real models; run again to go on.",
        epilog=HOW_TO_GET,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("out", type=Path, help="folder of the scenes")
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--assets", type=Path, help="folder of the downloaded asset packages")
    parser.add_argument("--size", type=int, default=defaults.size, help="px (%(default)s)")
    parser.add_argument(
        "--samples", type=int, default=defaults.samples, help="per pixel (%(default)s)"
    )
    parser.add_argument("--threads", type=int, default=1, help="(%(default)s)")
    parser.add_argument("--variant", choices=VARIANTS, help="of Mitsuba; else the fastest")
    return parser


if __name__ == "__main__":
    sys.exit(main())
