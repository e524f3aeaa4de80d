"""The programs beside `epinet` drop no option in silence, either."""

from __future__ import annotations

from pathlib import Path

import pytest

from epinet.arguments import Parser


def parser() -> Parser:
    found = Parser()
    found.add_argument("names", nargs="*")
    found.add_argument("-o", "--out", type=Path)
    found.add_argument("--each", action="append")
    inner = found.add_subparsers().add_parser("inner")
    inner.add_argument("--steps", type=int, default=3)
    return found


@pytest.mark.parametrize(
    "line", ["--out a --out b", "-o a --out=b", "-o a -o a", "inner --steps 1 --steps 2"]
)
def test_an_option_given_twice_is_an_error(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        parser().parse_args(line.split())
    assert end.value.code == 2
    assert "given twice" in capsys.readouterr().err


def test_what_may_be_given_again_and_each_new_line_are_taken() -> None:
    one = parser()
    for _ in range(2):
        found = one.parse_args(["--each", "a", "-o", "b", "--each", "c"])
        assert (found.each, found.out) == (["a", "c"], Path("b"))


def test_arguments_are_not_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["inner", "--a\x1b[2J\nerror: forged"])
    said = capsys.readouterr().err
    assert "\x1b" not in said and "\nerror" not in said and r"\x1b[2J\nerror: forged" in said


def test_every_program_uses_it() -> None:
    root = Path(__file__).parents[1]
    using = [
        str(path.relative_to(root))
        for folder in ("src", "benchmarks", "tests")
        for path in (root / folder).rglob("*.py")
        if "argparse.ArgumentParser" in path.read_text(encoding="utf-8") and path != Path(__file__)
    ]
    assert using == ["src/epinet/arguments.py"]
