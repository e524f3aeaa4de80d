"""The short run of the harness: some cases of every reader, each time the same."""

from __future__ import annotations

import random
import time

import pytest
import torch

from tests.fuzz.harness import Fault, faults_of
from tests.fuzz.mutations import mutated
from tests.fuzz.readers import READERS

CASES, SECONDS = 8, 1.5
"""Of each reader; on a slow machine fewer cases."""


@pytest.mark.parametrize("reader", READERS)
def test_mutated_files_are_read_or_refused(reader: str) -> None:
    faults = list(faults_of(reader, range(CASES), time.monotonic() + SECONDS))
    assert not faults, "\n".join(map(str, faults))


@pytest.mark.parametrize(
    ("reader", "says"),
    [("raises", "KeyError"), ("grows", "MemoryError"), ("ends", "the process ended")],
)
def test_the_harness_sees_faults(reader: str, says: str) -> None:
    faults = list(faults_of(reader, range(2)))
    assert [type(fault) for fault in faults] == [Fault, Fault]
    assert says in faults[0].what


def test_threads_of_torch_do_not_stop_the_readers() -> None:
    torch.rand(512, 512) @ torch.rand(512, 512)
    faults = list(faults_of("weights", range(1)))
    assert not faults, "\n".join(map(str, faults))


def test_a_case_is_the_same_each_time() -> None:
    data = bytes(range(256)) * 9
    cases = [mutated(data, random.Random(f"a {k}")) for k in (1, 1, 2)]
    assert cases[0] == cases[1] != cases[2]
