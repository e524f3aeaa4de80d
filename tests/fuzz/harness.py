"""Mutates valid files and reads them: a good result or InputError, within 10 s and 2 GiB.

Each reader works through its cases in a process of its own, whose memory is bounded, so that a
hang or a crash is a fault like any other and the next case goes on in a new process.
"""

from __future__ import annotations

import multiprocessing
import random
import resource
import shutil
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import torch

from epinet.errors import InputError
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import BROKEN, READERS

SECONDS, BYTES = 10.0, 2 * 2**30
SETUP_SECONDS, READY = 120.0, "ready"

PRELOADED = ["epinet.predict.estimator", "epinet.raw", "epinet.train.run"]
"""Imported once, by the server that all readers' processes are forked from. It has no threads: a
fork of the tests' own process would wait forever for those of torch."""


@dataclass(frozen=True)
class Fault:
    """A case that broke the contract; `python -m tests.fuzz --only READER:CASE` runs it again."""

    reader: str
    case: int
    what: str

    def __str__(self) -> str:
        return f"{self.reader}:{self.case}: {self.what}"


def faults_of(reader: str, cases: range, until: float = float("inf")) -> Iterator[Fault]:
    """Faults among numbered cases of a reader; stops at a time of `time.monotonic`."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    left = list(cases)
    while left and time.monotonic() < until:
        ours, theirs = context.Pipe()
        child = context.Process(target=_work, args=(theirs, reader, left))
        child.start()
        theirs.close()
        if not ours.poll(SETUP_SECONDS) or ours.recv() != READY:
            child.kill()
            raise RuntimeError(f"{reader}: no valid file within {SETUP_SECONDS:g} s")
        while left:
            case, told, ended = left.pop(0), None, False
            if ours.poll(SECONDS):
                try:
                    told = ours.recv()
                except EOFError:
                    child.join()
                    told, ended = f"the process ended ({child.exitcode})", True
            else:
                told, ended = f"took more than {SECONDS:g} s", True
            if told:
                yield Fault(reader, case, told)
            if ended or time.monotonic() > until:
                break
        child.kill()
        child.join()


def case_of(reader: str, case: int, folder: Path, good: Path) -> Path:
    """Writes a mutated copy of a valid input; the file that was mutated."""
    shutil.rmtree(folder, ignore_errors=True)
    root = next(p for p in good.parents if p.name == "good")
    shutil.copytree(root, folder)
    path = folder / good.relative_to(root)
    path.write_bytes(mutated(good.read_bytes(), random.Random(f"{reader} {case}")))
    return path


def _work(pipe: Connection, reader: str, cases: list[int]) -> None:
    warnings.simplefilter("error", RuntimeWarning)
    torch.set_num_threads(1)
    place = Path(tempfile.mkdtemp(prefix="epinet-fuzz-"))
    try:
        (place / "good").mkdir()
        good = _KNOWN[reader].make(place / "good")
        if reader not in _NOT_GOOD:
            _KNOWN[reader].read(good)
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
        pipe.send(READY)
        for case in cases:
            pipe.send(_outcome(reader, case_of(reader, case, place / "case", good)))
    finally:
        shutil.rmtree(place, ignore_errors=True)


_KNOWN = READERS | BROKEN

_NOT_GOOD = {"keras", "raw", "set", *BROKEN}
"""Readers whose files are only valid in part, to be small, and those that read none."""


def _outcome(reader: str, path: Path) -> str | None:
    try:
        _KNOWN[reader].read(path)
    except InputError as error:
        text = str(error)
        return f"no word: {text!r}" if not text or len(text) > 20_000 else None
    except BaseException:
        return traceback.format_exc(limit=-4)
    return None
