"""Seeded mutations: bytes of any file, and the structure of JSON documents."""

from __future__ import annotations

import io
import json
import os
import random
import re
from typing import Any

import torch

NUMBERS = ("0", "-1", "1e400", "NaN", "1" + "0" * 25, "9" * 400, "2147483648", "1e-300", "0.5")
VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1.5, 1e300, 10**20, 10**400, float("nan"), float("inf"), "", "x" * 5000,
    "2024-01-01", "../../etc/passwd", [], [[]], {}, {"": None}, [1, "a", None],
)  # fmt: skip


def mutated(data: bytes, dice: random.Random) -> bytes:
    """One to four mutations of a file's content."""
    if data[8:9] == b"{" and b"__metadata__" in data and dice.random() < 0.8:
        return _weights(data, dice)
    if data[:2] == b"PK" and b"data.pkl" in data[:200] and dice.random() < 0.8:
        return _checkpoint(data, dice)
    for _ in range(dice.randint(1, 4)):
        kinds = [_flip, _flip, _overwrite, _cut, _delete, _repeat, _insert, _number]
        if data[:1] in b"{[" and dice.random() < 0.8:
            return _document(data, dice)
        data = dice.choice(kinds)(data, dice)
    return data


def _at(data: bytes, dice: random.Random) -> int:
    """A place, more often near the beginning, where headers are."""
    last = min(len(data), 512) if dice.random() < 0.5 else len(data)
    return dice.randrange(last + 1)


def _flip(data: bytes, dice: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(dice.randint(1, 8)):
        if changed:
            changed[min(_at(data, dice), len(changed) - 1)] ^= 1 << dice.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, dice: random.Random) -> bytes:
    at, values = _at(data, dice), (b"\0", b"\xff", b"\x7f\xff", b"\x80", b"\xff\xff\xff\xff")
    new = dice.choice(values) * dice.randint(1, 4)
    return data[:at] + new + data[at + len(new) :]


def _cut(data: bytes, dice: random.Random) -> bytes:
    return data[: _at(data, dice)]


def _delete(data: bytes, dice: random.Random) -> bytes:
    at = _at(data, dice)
    return data[:at] + data[at + dice.randint(1, 64) :]


def _repeat(data: bytes, dice: random.Random) -> bytes:
    at = _at(data, dice)
    return data[:at] + data[at : at + dice.randint(1, 64)] * dice.randint(2, 50) + data[at:]


def _insert(data: bytes, dice: random.Random) -> bytes:
    at = _at(data, dice)
    texts = (
        b"[" * 3000,
        b"{",
        b"\xff\xfe",
        b"\0" * 16,
        b"\n",
        b"%s%n",
        b"nan",
        bytes(dice.randbytes(8)),
    )
    return data[:at] + dice.choice(texts) + data[at:]


def _number(data: bytes, dice: random.Random) -> bytes:
    places = list(re.finditer(rb"-?\d+(\.\d+)?", data[:20_000]))
    if not places:
        return data
    place = dice.choice(places)
    return data[: place.start()] + dice.choice(NUMBERS).encode() + data[place.end() :]


def _weights(data: bytes, dice: random.Random) -> bytes:
    """Safetensors whose header fits, but whose metadata or values are others."""
    size = int.from_bytes(data[:8], "little")
    header, values = json.loads(data[8 : 8 + size]), data[8 + size :]
    if dice.random() < 0.2:
        at = dice.randrange(len(values) - 8)
        values = values[:at] + b"\xff\xff\xff\x7f\xff\xff" + values[at + 6 :]
    else:
        key = dice.choice(["config", "config", "metadata", "metadata", "model", "format"])
        text = header["__metadata__"][key].encode()
        changed = _document(text, dice) if text[:1] == b"{" else _flip(text, dice)
        header["__metadata__"][key] = changed.decode(errors="replace")
    packed = json.dumps(header).encode()
    return len(packed).to_bytes(8, "little") + packed + values


class _Runs:
    """Code in a checkpoint: were it run, the process would end."""

    def __reduce__(self) -> Any:
        return os._exit, (3,)


def _checkpoint(data: bytes, dice: random.Random) -> bytes:
    """A checkpoint of torch with values or tensors of another kind, or with code in it."""
    state = torch.load(io.BytesIO(data), weights_only=True)
    places = [(state, key) for key in state] if dice.random() < 0.5 else _places(state)
    holder, key = dice.choice(places)
    kind = dice.random()
    if kind < 0.2:
        del holder[key]
    elif kind < 0.5 and isinstance(holder[key], torch.Tensor):
        tensor = holder[key]
        holder[key] = dice.choice(
            [tensor[None], tensor[:0], tensor * float("nan"), tensor.to(torch.complex64)]
            if tensor.ndim
            else [torch.tensor(float("nan")), torch.zeros(3), torch.tensor(-1)]
        )
    else:
        holder[key] = dice.choice((*VALUES, torch.ones(2, 3), _Runs(), {1: 2}, b"bytes"))
    packed = io.BytesIO()
    torch.save(state, packed)
    return packed.getvalue()


def _places(value: Any) -> list[tuple[Any, Any]]:
    """(holder, key) of every item in nested dictionaries and lists."""
    places: list[tuple[Any, Any]] = []
    keys: Any = ()
    if isinstance(value, dict):
        keys = list(value)
    elif isinstance(value, list):
        keys = range(len(value))
    for key in keys:
        places += [(value, key), *_places(value[key])]
    return places


def _document(data: bytes, dice: random.Random) -> bytes:
    """A JSON document with values of another type, or missing, or deep, or again."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):  # of many lines, or mutated to be deep
        lines = data.splitlines()
        if len(lines) < 2:
            return _flip(data, dice)
        at = dice.randrange(len(lines))
        lines[at] = _flip(lines[at], dice) if dice.random() < 0.3 else _document(lines[at], dice)
        return b"\n".join(lines) + b"\n"
    places = _places(value)
    if not places or dice.random() < 0.05:
        return json.dumps(dice.choice(VALUES)).encode()
    holder, key = dice.choice(places)
    kind = dice.random()
    if kind < 0.2:
        del holder[key]
    elif kind < 0.25:
        return json.dumps(value).replace("}", "[" * 3000 + "}", 1).encode()
    elif kind < 0.3 and isinstance(holder, dict):
        return json.dumps(value).replace("{", f'{{"{key}": 1, ', 1).encode()
    else:
        holder[key] = dice.choice(VALUES)
    return json.dumps(value).encode()
