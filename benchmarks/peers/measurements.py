"""Times and memory of a call; nothing but the standard library, so that any Python can use it."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")


def measured(call: Callable[[], T], repeats: int) -> tuple[T, dict[str, Any]]:
    """What the last of so many calls returns, and all their times with the process's peak memory.

    The peak comes from Linux' VmHWM: what wait4 and getrusage give counts the parent's memory, too,
    where it is larger.
    """
    seconds, cpu_s = [], []
    for _ in range(repeats):
        begun, cpu_begun = time.perf_counter(), time.process_time()
        result = call()
        seconds.append(time.perf_counter() - begun)
        cpu_s.append(time.process_time() - cpu_begun)
    peak = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    assert peak is not None, "Linux states it"
    return result, {"seconds": seconds, "cpu_s": cpu_s, "peak_memory_mb": int(peak[1]) / 1024}
