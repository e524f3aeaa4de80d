"""One table of the paper, from runs that are saved one by one:

    python -m benchmarks.paper_tables streams                      # table 1 and figure 3
    python -m benchmarks.paper_tables views                        # table 2
    python -m benchmarks.paper_tables views --data hci/additional --validation hci/training
    python -m benchmarks.paper_tables wide                         # table 3
    python -m benchmarks.paper_tables ensemble SCENES...           # Epinet-fcn and -fcn-m
    python -m benchmarks.paper_tables capture lightfields/lytro_2067   # figure 11

The same command again goes on where it stopped, and with all runs saved only prints the table,
which is also written as Markdown and LaTeX beside the runs. Scores are the benchmark's.
"""

from __future__ import annotations

import argparse
import platform
from pathlib import Path

from benchmarks.paper_tables import predictions, trained
from benchmarks.paper_tables.tables import Table
from epinet.allocator import keep_freed_memory
from epinet.arguments import Parser
from epinet.errors import InputError
from epinet.train.run import StoppedError

RESULTS = Path(__file__).parent.parent / "results" / "paper_tables"


def arguments() -> argparse.Namespace:
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    shared = Parser(add_help=False)
    shared.add_argument("--results", type=Path, default=RESULTS, help="runs and tables")
    shared.add_argument("--machine", default=platform.processor() or platform.machine())
    lasting = Parser(add_help=False)
    lasting.add_argument(
        "--runs", type=Path, default=Path("out/paper_tables"), help="checkpoints and scenes"
    )
    tables = parser.add_subparsers(dest="table", required=True)
    for name in ("streams", "views"):
        training = tables.add_parser(name, parents=[shared, lasting])
        training.add_argument("--budget", choices=trained.BUDGETS, default="hours")
        for option, use in (("--data", "train on"), ("--validation", "judge by")):
            about = f"scenes with truth, or folders of them, to {use} instead of rendered ones"
            training.add_argument(option, type=Path, nargs="+", default=[], help=about)
    tables.add_parser("wide", parents=[shared, lasting])
    ensemble = tables.add_parser("ensemble", parents=[shared])
    ensemble.add_argument("scenes", type=Path, nargs="+", help="scenes with truth, or folders")
    capture = tables.add_parser("capture", parents=[shared])
    capture.add_argument("light_field", type=Path, help="with 9x9 views")
    return parser.parse_args()


def made(args: argparse.Namespace) -> tuple[Path, Table]:
    """The table, and the folder that it belongs to."""
    results: Path = args.results
    if args.table == "ensemble":
        return results, predictions.ensemble(results, args.scenes, args.machine)
    if args.table == "capture":
        return results, predictions.capture(results, args.light_field, args.machine)
    if args.table == "wide":
        return results, predictions.wide(results, args.runs, args.machine)
    results, runs = results / args.budget, args.runs / args.budget
    trainings = trained.Trainings(
        trained.BUDGETS[args.budget],
        results,
        runs,
        args.machine,
        tuple(args.data),
        tuple(args.validation),
    )
    return results, getattr(trained, args.table)(trainings)


def main() -> None:
    args = arguments()
    keep_freed_memory()  # as the command line does
    try:
        folder, table = made(args)
    except (InputError, StoppedError) as error:
        raise SystemExit(str(error)) from error
    (folder / f"{args.table}.md").write_text(table.markdown())
    (folder / f"{args.table}.tex").write_text(table.latex())
    print(table.markdown())


if __name__ == "__main__":
    main()
