"""The short run of the harness: some cases of every reader, each time the same."""

from __future__ import annotations

import time

import pytest

from tests.fuzz.harness import Fault, faults_of
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import READERS, Reader

CASES, SECONDS = 8, 1.5
"""Of each reader; on a slow machine fewer cases."""


@pytest.mark.parametrize("reader", READERS)
def test_mutated_files_are_read_or_refused(reader: str) -> None:
    faults = list(faults_of(reader, range(CASES), time.monotonic() + SECONDS))
    assert not faults, "\n".join(map(str, faults))


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda path: {}["key"], "KeyError"),
        (lambda path: bytearray(4 * 2**30), "MemoryError"),
        (lambda path: __import__("os")._exit(3), "the process ended"),
    ],
)
def test_the_harness_sees_faults(monkeypatch: pytest.MonkeyPatch, read: object, says: str) -> None:
    broken = Reader(READERS["log"].make, read)  # type: ignore[arg-type]
    monkeypatch.setitem(READERS, "set", broken)  # one whose file is not read before it is mutated
    faults = list(faults_of("set", range(2)))
    assert [type(fault) for fault in faults] == [Fault, Fault]
    assert says in faults[0].what


def test_a_case_is_the_same_each_time() -> None:
    import random

    data = bytes(range(256)) * 9
    cases = [mutated(data, random.Random(f"a {k}")) for k in (1, 1, 2)]
    assert cases[0] == cases[1] != cases[2]
