"""What is printed shows names of files as they are, and does nothing else to a terminal."""

import ast
import io
import os
import subprocess
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest

import epinet
from epinet import terminal
from epinet.io.images import write_png
from epinet.terminal import printable

HOSTILE = "a\x1b[2J\x1b]0;title\x07\nerror: forged\r\x9b2J\u2028\u202e\x7f[/]b"


def run(*arguments: object, encoding: str = "utf-8") -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "epinet", *map(os.fspath, arguments)],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": encoding},
        check=False,
    )


def scene(folder: Path) -> Path:
    folder.mkdir()
    texture = np.random.default_rng(0).integers(0, 256, (24, 30, 3), np.uint8)
    for row, col in np.ndindex(3, 3):
        write_png(folder / f"view_{row}_{col}.png", texture)
    return folder


def test_nothing_that_acts_is_left_and_all_else_is_kept() -> None:
    for code in range(0x110000):
        shown = printable(chr(code))
        if shown == chr(code):
            assert unicodedata.category(shown) not in ("Cc", "Cs", "Zl", "Zp")
            assert unicodedata.bidirectional(shown) not in ("LRO", "RLO", "LRE", "RLE", "PDF")
        else:
            assert shown.isascii() and shown.isprintable()
    assert printable("Küche 场景 \\ 🎥") == "Küche 场景 \\ 🎥"


@pytest.mark.parametrize(("command", "good"), [("info", False), ("predict", True)])
def test_a_name_cannot_forge_lines_or_rule_the_terminal(
    tmp_path: Path, command: str, good: bool
) -> None:
    path = tmp_path / HOSTILE.replace("/", "_")
    scene(path) if good else path.mkdir()
    more = ["-o", tmp_path / "out"] if command == "predict" else []
    done = run(command, path, *more)
    assert done.returncode == (0 if good else 2), done.stderr
    printed = (done.stdout + done.stderr).decode()
    assert r"a\x1b[2J\x1b]0;title\x07\nerror: forged\r\x9b2J\u2028\u202e\x7f" in printed
    assert "\nerror: forged" not in printed
    assert all(c == "\n" or printable(c) == c for c in printed)


@pytest.mark.parametrize(
    "arguments",
    [
        [f"--{HOSTILE}"],
        [HOSTILE],
        ["info", f"--{HOSTILE}"],
        ["info", "a", f"--{HOSTILE}=1"],
        ["demo", "-o", "a", HOSTILE],
        ["weights", HOSTILE],
    ],
)
def test_usage_errors_do_not_print_arguments_as_they_are(arguments: list[str]) -> None:
    done = run(*arguments)
    assert done.returncode == 2 and not done.stdout
    printed = done.stderr.decode()
    assert printed.startswith("Usage: ") and "\nError: " in printed
    assert r"\x1b[2J" in printed and "\nerror: forged" not in printed
    assert all(c == "\n" or printable(c) == c for c in printed)


def test_help_keeps_its_lines() -> None:
    for arguments in (["--help"], [], ["info", "--help"]):
        done = run(*arguments)
        lines = (done.stdout + done.stderr).decode().splitlines()
        assert len(lines) > 5 and "Usage: " in "\n".join(lines[:2])


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8:strict"])
def test_names_that_an_encoding_lacks_are_escaped(tmp_path: Path, encoding: str) -> None:
    paths = [scene(tmp_path / name) for name in ("场", os.fsdecode(b"K\xfcche"))]
    done = run("info", *paths, encoding=encoding)
    assert done.returncode == 0, done.stderr
    printed = done.stdout.decode(encoding.partition(":")[0])
    assert r"K\udcfcche" in printed
    assert ("场" if encoding.startswith("utf") else r"\u573a") in printed


def test_everything_is_printed_by_the_module_that_escapes() -> None:
    source = Path(epinet.__file__).parent
    calls = [
        f"{file.relative_to(source)}:{node.lineno}"
        for file in source.rglob("*.py")
        if file != Path(terminal.__file__)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name | ast.Attribute)
        and ast.unparse(node) in ("print", "typer.echo", "sys.stdout.write", "sys.stderr.write")
    ]
    assert not calls


def test_a_label_of_progress_is_no_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    from epinet.progress import progress

    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    with progress("[/]\x1b]0;title\x07[red]") as advance:
        advance(1.0)
    assert "\x1b]0;title" not in screen.getvalue()
    assert "[red]" in screen.getvalue()
