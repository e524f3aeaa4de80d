"""`python -m tests.fuzz`: the long run; ends with status 1 if there are faults."""

from __future__ import annotations

import sys
import time

from epinet.arguments import Parser
from tests.fuzz.harness import faults_of
from tests.fuzz.readers import READERS


def main() -> None:
    parser = Parser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60, help="in all, shared by the readers")
    parser.add_argument("--cases", type=int, default=10_000, help="of each reader, at most")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--only", metavar="READER[:CASE]", help="one reader, or one of its cases")
    chosen = parser.parse_args()
    name, _, case = (chosen.only or "").partition(":")
    names = [name] if name else list(READERS)
    cases = (
        range(int(case), int(case) + 1)
        if case
        else range(chosen.first, chosen.first + chosen.cases)
    )
    found = 0
    for reader in names:
        until = time.monotonic() + 60 * chosen.minutes / len(names)
        for fault in faults_of(reader, cases, until):
            print(fault, flush=True)
            found += 1
        print(f"{reader}: done", file=sys.stderr, flush=True)
    print(f"{found} faults")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
