"""Progress of long work on standard error: a bar on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from epinet.terminal import printable, remark

PLAIN_INTERVAL_S = 10.0


@contextmanager
def progress(label: str) -> Iterator[Callable[[float], None]]:
    """Yields a function to call with each share (0..1) of the work that has been done."""
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(escape(printable(label)), total=1.0)
            yield lambda share: bar.advance(task, share)
        return
    done, told = 0.0, time.monotonic()

    def advance(share: float) -> None:
        nonlocal done, told
        done += share
        if time.monotonic() - told >= PLAIN_INTERVAL_S:
            told = time.monotonic()
            remark(f"{label}: {100 * done:.0f} %")

    yield advance
