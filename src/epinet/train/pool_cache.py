"""Rendered scenes kept on disk, for runs that learn from the same ones."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save

from epinet.errors import InputError
from epinet.io.atomic import atomic_path
from epinet.synth.generator import VERSION, Pool


def kept(folder: Path, what: Mapping[str, Any], make: Callable[[], Pool], device: str) -> Pool:
    """A pool that the folder has, or that is made and put there.

    Args:
        folder: made if need be.
        what: all that decides what is in it, besides the generator's version; JSON knows its types.
        make: renders it.
        device: of its tensors.

    Raises:
        InputError: a file of the folder is damaged, or cannot be written.
    """
    text = json.dumps({"generator": VERSION, **what}, sort_keys=True)
    path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:24]}.safetensors"
    if not path.exists():
        pool = make()
        tensors = {name: t.cpu().contiguous() for name, t in asdict(pool).items()}
        with atomic_path(path) as temporary:
            temporary.write_bytes(save(tensors))
        return pool
    try:
        return Pool(**load_file(path, device=device))
    except (SafetensorError, OSError, TypeError) as error:
        raise InputError(
            f"{path}: not scenes that a run can go on with ({error}); remove the file"
        ) from error
