"""Memory of this process: freed blocks are kept for reuse.

The C library of Linux takes every large block from the system anew, filled with zeros page by
page, and gives it back when it is freed. A network that makes and frees tensors of a hundred
megabytes spends half of its time so.
"""

from __future__ import annotations

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_MAX = -1, -4  # of mallopt(3)
_LARGEST = 2**31 - 1


def keep_freed_memory() -> None:
    """Let the allocator keep what is freed, up to 2 GB; does nothing where it is not glibc's."""
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_MAX, 0)
        mallopt(_TRIM_THRESHOLD, _LARGEST)
