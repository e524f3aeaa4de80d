"""Every option is given once, or may be given again and says so: none is dropped in silence."""

from __future__ import annotations

from typing import Any

import pytest
import typer

from epinet.cli import app
from epinet.errors import InputError


def options() -> list[tuple[str, Any]]:
    """(command line up to it, option) of every option of every command."""
    found: list[tuple[str, Any]] = []

    def walk(command: Any, line: str) -> None:
        found.extend((line, p) for p in command.params if p.param_type_name == "option")
        for name, inner in getattr(command, "commands", {}).items():
            walk(inner, f"{line} {name}")

    walk(typer.main.get_command(app), "")
    return found


@pytest.mark.parametrize(
    ("line", "option"), options(), ids=[f"{line} {o.name}" for line, o in options()]
)
def test_an_option_given_twice_is_refused_or_says_that_it_may_be(line: str, option: Any) -> None:
    name = option.opts[-1]
    if option.multiple:
        assert "again" in option.help.lower() or "Two or" in option.help or "two or" in option.help
        return
    given = [name] if option.is_flag else [name, "1"]
    again = option.secondary_opts[:1] or given
    with pytest.raises(InputError, match=f"{name}.*: given 2 times"):
        app([*line.split(), *given, *again], standalone_mode=False)


def test_one_of_each_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    app(["--read-limit", "7", "weights", "--json"], standalone_mode=False)
    assert '"name": "sweepnet"' in capsys.readouterr().out
