"""Mitsuba 3, imported only when scenes are rendered, in its fastest variant that works here."""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path
from typing import Any

from epinet.errors import InputError

_LLVM_LIBRARY = re.compile(r"libLLVM(?:-|\.so\.)(\d+)[\d.]*(?:\.so[\d.]*)?")
_LLVM_VERSIONS = range(16, 20)
"""Older ones abort the process inside the code generator (15, as tried with Dr.Jit 1.5)."""
VARIANTS = ("llvm_ad_rgb", "scalar_rgb")


def load_mitsuba(threads: int = 1, variant: str | None = None) -> Any:
    """The module `mitsuba` with its variant and number of threads set.

    Args:
        threads: how many threads may render.
        variant: one of VARIANTS; None takes the first that works. llvm_ad_rgb is about 3 times
            as fast and needs the LLVM library (Debian: libllvm19).

    Raises:
        InputError: Mitsuba is not installed, or not this variant.
    """
    library = os.environ.get("DRJIT_LIBLLVM_PATH") or _llvm_library()
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    try:
        mi: Any = importlib.import_module("mitsuba")
        dr: Any = importlib.import_module("drjit")
    except ImportError as error:
        raise InputError(
            f"path-traced scenes need Mitsuba 3 ({error}): pip install 'epinet[render]'"
        ) from error
    wanted = (variant,) if variant else VARIANTS if library else VARIANTS[1:]
    for name in wanted:
        if _takes_effect(mi, name):
            dr.set_thread_count(threads)
            mi.set_log_level(mi.LogLevel.Warn)
            return mi
    raise InputError(
        f"Mitsuba cannot run as {' or '.join(wanted)}; llvm_ad_rgb needs the LLVM library "
        "(apt install libllvm19, or DRJIT_LIBLLVM_PATH=/path/to/libLLVM.so.19.1)"
    )


def _takes_effect(mi: Any, variant: str) -> bool:
    try:
        mi.set_variant(variant)
        return bool((mi.Float(1) + 1) == 2)
    except (ImportError, RuntimeError):
        return False


def _llvm_library() -> Path | None:
    """The newest LLVM library of a version that Dr.Jit works with."""
    found: list[tuple[int, Path]] = []
    for pattern in ("lib/*-linux-gnu/libLLVM*", "lib64/libLLVM*", "lib/llvm-*/lib/libLLVM*"):
        for path in sorted(Path("/usr").glob(pattern)):
            match = _LLVM_LIBRARY.fullmatch(path.name)
            if match and int(match[1]) in _LLVM_VERSIONS:
                found.append((int(match[1]), path))
    return max(found)[1] if found else None
