"""Documents: JSON and YAML within bounds, and messages with file and key."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, ConfigDict, Field

from epinet.documents import parse_json, parse_yaml, validated
from epinet.errors import InputError

Parse = Callable[[bytes | str, object], Any]


class Model(BaseModel):
    model_config = ConfigDict(extra="forbid")

    count: Annotated[int, Field(ge=1)]
    inner: dict[str, float] = {}


@pytest.mark.parametrize("parse", [parse_json, parse_yaml])
@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b'{"a": 1, "a": 2}', "'a' is given twice"),
        (b"[" * 3000, "nested"),
        (b"[" * 100 + b"]" * 100, "nested"),
        (b"9" * 5000, "cannot be read|too large"),
        (b"1" + b"0" * 30, "too large"),
        (b"{\xff\xfe", "cannot be read"),
        (b"{", "cannot be read as"),
        (b" " * 2**23 + b"1", "bytes of"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(parse: Parse, data: bytes, says: str) -> None:
    with pytest.raises(InputError, match=rf"^file: .*({says})") as refused:
        parse(data, "file")
    assert len(str(refused.value)) < 500
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "text",
    [
        "a: &x [1]\nb: *x",
        "!!python/object/apply:os.system [ls]",
        "!!timestamp 2024-01-01",
        "!!int ''",
    ],
)
def test_yaml_has_the_types_of_json(text: str) -> None:
    with pytest.raises(InputError, match="file: cannot be read as YAML"):
        parse_yaml(text, "file")


def test_dates_are_texts() -> None:
    assert parse_yaml("a: 2024-01-01\nb: 2024-13-45", "file") == {
        "a": "2024-01-01",
        "b": "2024-13-45",
    }


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ({}, "file: count is missing"),
        ({"count": 0}, "file: count: Input should be greater than or equal to 1, not 0"),
        ({"count": 1, "more": 2}, "file: more is not known"),
        ({"count": 1, "inner": {"a": "x"}}, "file: inner.a: .*number.*, not 'x'"),
        ([1], "file: .*Model"),
        ({"count": "x" * 10_000}, "file: count: .{0,300}$"),
    ],
)
def test_messages_name_file_and_key(value: object, says: str) -> None:
    with pytest.raises(InputError, match=f"^{says}"):
        validated(Model, value, "file")


def test_of_many_problems_ten_are_told() -> None:
    with pytest.raises(InputError) as refused:
        validated(Model, {"count": 1, "inner": dict.fromkeys(map(str, range(1000)), "x")}, "file")
    assert len(refused.value.problems) == 11
    assert refused.value.problems[-1] == "file: and 990 more problems"
