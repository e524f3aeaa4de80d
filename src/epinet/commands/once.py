"""Commands whose options are given once: of a second value, typer would keep only the last."""

from __future__ import annotations

from collections import Counter
from typing import Any

from typer.core import TyperCommand, TyperGroup

from epinet.errors import InputError


class Once:
    """What refuses a second value of an option that takes one, before the command's own parsing."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        command: Any = self
        _, _, given = command.make_parser(ctx).parse_args(list(args))
        times = Counter(parameter.name for parameter in given)
        problems = [
            f"{'/'.join((*parameter.opts, *parameter.secondary_opts))}: given "
            f"{times[parameter.name]} times, but only one can count; give it once"
            for parameter in {p.name: p for p in given}.values()
            if times[parameter.name] > 1 and not parameter.multiple
        ]
        if problems:
            raise InputError(problems)
        rest: list[str] = super().parse_args(ctx, args)  # type: ignore[misc]
        return rest


class OnceCommand(Once, TyperCommand):
    """A command of options given once."""


class OnceGroup(Once, TyperGroup):
    """A group of commands, with options of its own given once."""
