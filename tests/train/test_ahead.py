"""Batches made ahead are those made in turn, and their thread ends whatever happens."""

import threading
import time

import pytest
import torch

from epinet.train.ahead import DEPTH, made_ahead, pays


def threads() -> list[threading.Thread]:
    return [t for t in threading.enumerate() if t.name.startswith("batches")]


def settled(wanted: int, made: list[int]) -> None:
    """Waits until so many batches are made, and a little longer."""
    for _ in range(500):
        if len(made) >= wanted:
            break
        time.sleep(0.01)
    time.sleep(0.05)


def test_the_next_batches_are_made_before_they_are_asked_for():
    made: list[int] = []

    def make(step: int) -> int:
        assert threading.current_thread() in threads()
        made.append(step)
        return 10 * step

    with made_ahead([make], end=6) as (ahead,):
        assert ahead(0) == 0
        settled(1 + DEPTH, made)
        assert made == [*range(1 + DEPTH)]
        assert [ahead(step) for step in range(1, 6)] == [10, 20, 30, 40, 50]
        assert ahead(2) == 20  # an earlier one, asked for again
        settled(7, made)
    assert made == [0, 1, 2, 3, 4, 5, 2]
    assert not threads()


def test_makers_share_one_thread_and_never_run_together():
    """They may share scenes, which are rendered at first use."""
    running = threading.Lock()

    def make(step: int) -> int:
        assert running.acquire(blocking=False)
        time.sleep(0.01)
        running.release()
        return step

    with made_ahead([make, make], end=4) as makers:
        assert [[m(step) for m in makers] for step in range(4)] == [[k, k] for k in range(4)]
        assert len(threads()) == 1


def test_an_error_is_raised_where_its_batch_is_asked_for():
    def make(step: int) -> int:
        if step == 2:
            raise MemoryError("of step 2")
        return step

    with made_ahead([make], end=9) as (ahead,):
        assert [ahead(0), ahead(1)] == [0, 1]
        with pytest.raises(MemoryError, match="of step 2"):
            ahead(2)
    assert not threads()


@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_the_thread_ends_with_what_it_works_for(stop):
    made: list[int] = []

    def make(step: int) -> int:
        time.sleep(0.05)
        made.append(step)
        return step

    with pytest.raises(stop), made_ahead([make], end=100) as (ahead,):
        ahead(0)
        raise stop
    assert not threads()
    assert len(made) <= 2  # the one under way is finished, those behind it are not begun


def test_a_thread_takes_a_core_to_spare(monkeypatch):
    cpu = torch.device("cpu")
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {0, 1}, raising=False)
    monkeypatch.setattr(torch, "get_num_threads", lambda: 1)
    assert pays(cpu, processes=1)
    assert not pays(cpu, processes=2)
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    assert not pays(cpu, processes=1)
    assert pays(torch.device("cuda"), processes=1)
