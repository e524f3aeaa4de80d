"""Command lines of the programs beside `epinet`: argparse, but nothing is dropped in silence."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from epinet.terminal import printable


class Parser(argparse.ArgumentParser):
    """A parser that refuses an option given twice, of which argparse keeps the last."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.given: set[str] = set()
        for kind in (None, "store"):
            self.register("action", kind, _Once)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.given = set()
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        super().error(printable(message))


class _Once(argparse._StoreAction):
    def __call__(self, parser: Any, namespace: Any, values: Any, option: str | None = None) -> None:
        if option is not None and self.dest in parser.given:
            parser.error(f"{option}: given twice, but only one can count; give it once")
        parser.given.add(self.dest)
        super().__call__(parser, namespace, values, option)
