"""Batches made ahead of time, by a thread of their own while the network runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import torch

from epinet.networks.base import Batch

DEPTH = 2
"""So many batches are made ahead."""

CPU = torch.device("cpu")

Maker = Callable[[int], Batch]
"""Makes the batch of a step."""


class _Ahead:
    """A maker whose next batches are under way while steps go on."""

    def __init__(
        self, make: Maker, worker: ThreadPoolExecutor, end: int, stream: torch.cuda.Stream | None
    ) -> None:
        self._make, self._worker, self._end, self._stream = make, worker, end, stream
        self._coming: dict[int, Future[Batch]] = {}
        self._next = 0

    def __call__(self, step: int) -> Batch:
        wanted = [step]
        if step >= self._next:  # and no earlier one, asked for again
            wanted += range(step + 1, min(step + 1 + DEPTH, self._end))
            self._next = step + 1
        for k in wanted:
            if k not in self._coming:
                self._coming[k] = self._worker.submit(self._made, k)
        batch = self._coming.pop(step).result()
        if self._stream is not None:  # whose memory must outlive what the network does with it
            for tensor in (batch.stacks, batch.disparity, batch.weight):
                tensor.record_stream(torch.cuda.current_stream(tensor.device))
        return batch

    def _made(self, step: int) -> Batch:
        if self._stream is None:
            return self._make(step)
        with torch.cuda.stream(self._stream):
            batch = self._make(step)
        self._stream.synchronize()
        return batch


@contextmanager
def made_ahead(
    makers: Sequence[Maker], end: int, device: torch.device = CPU
) -> Iterator[list[Maker]]:
    """The same batches, made by one thread, which does nothing else and ends with the block.

    On a GPU it has a stream of its own, so that it need not wait for the network.

    What goes wrong in it is raised where its batch is asked for.

    Args:
        makers: of batches; from here on the thread alone calls them.
        end: the first step that no batch is needed for.
        device: of the batches.
    """
    stream = None
    if device.type == "cuda":
        stream = torch.cuda.Stream(device)  # type: ignore[no-untyped-call]
        stream.wait_stream(torch.cuda.current_stream(device))  # for scenes rendered before
    worker = ThreadPoolExecutor(1, "batches")
    try:
        yield [_Ahead(make, worker, end, stream) for make in makers]
    finally:
        worker.shutdown(cancel_futures=True)


def pays(device: torch.device, processes: int) -> bool:
    """Whether there is something to make batches on while the network runs: a core to spare.

    Args:
        device: of the network.
        processes: that train together on this machine.
    """
    if device.type != "cpu":
        return True
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (cores or 1) > processes * torch.get_num_threads()
