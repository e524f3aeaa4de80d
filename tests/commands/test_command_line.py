"""What all commands have in common: their help, completion, tracebacks, and Ctrl-C."""

from __future__ import annotations

import ast
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer

import epinet
from epinet.cli import KEPT, app, main

SOURCE = Path(epinet.__file__).parent
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("line", ["", *COMMANDS, "weights import"])
def test_h_is_help(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    texts = []
    for option in ("-h", "--help"):
        app([*line.split(), option], standalone_mode=False)
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] and "Usage:" in texts[0]


def test_completion_of_a_shell_names_the_commands(tmp_path: Path) -> None:
    environment = {
        "_EPINET_COMPLETE": "complete_bash",
        "COMP_WORDS": "epinet pre",
        "COMP_CWORD": "1",
        "PYTHONPATH": str(SOURCE.parent),
        "PATH": "/usr/bin:/bin",
    }
    code = "import sys; sys.argv[0] = 'epinet'; from epinet.cli import main; main()"
    found = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert found.stdout.split() == ["predict"]


@pytest.mark.parametrize("by", ["nothing", "option", "environment"])
def test_a_traceback_stands_before_the_message_where_it_is_asked_for(
    by: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "bad.yaml").write_text("a: [")
    options = ["--debug"] if by == "option" else []
    if by == "environment":
        monkeypatch.setenv("EPINET_DEBUG", "1")
    line = ["train", "--recipe", str(tmp_path / "bad.yaml"), "-o", str(tmp_path / "run")]
    monkeypatch.setattr(sys, "argv", ["epinet", *options, *line])
    with pytest.raises(SystemExit, match="2"):
        main()
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("error: ") and "bad.yaml: cannot be read as YAML" in lines[-1]
    assert any(line.startswith("Traceback") for line in lines) == (by != "nothing")
    assert (len(lines) == 1) == (by == "nothing")
    assert any("parser.py" in line for line in lines) == (by != "nothing"), "the cause, too"


def test_ctrl_c_says_what_was_kept(tmp_path: Path) -> None:
    assert set(KEPT) <= set(COMMANDS)
    command = [sys.executable, "-m", "epinet", "synth", str(tmp_path / "set"), "--scenes", "999"]

    def heed_interrupts() -> None:
        """A shell's background processes, as tests may be, pass on that they ignore them."""
        signal.signal(signal.SIGINT, signal.default_int_handler)

    with subprocess.Popen(
        [*command, "--size", "64x64", "--star"],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    ) as process:
        end = time.monotonic() + 60
        while not list(tmp_path.glob("set/scene_*/gt_disp_lowres.pfm")):
            assert process.poll() is None and time.monotonic() < end
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.splitlines()[-1] == f"interrupted: {KEPT['synth']}"
    assert "Traceback" not in said


def test_the_library_logs_and_never_prints() -> None:
    """Only commands print, through `epinet.terminal`; progress bars are theirs, too."""
    shown = {"cli", "commands", "terminal", "progress", "__main__"}
    found = []
    for file in SOURCE.rglob("*.py"):
        parts = file.relative_to(SOURCE).with_suffix("").parts
        if shown & set(parts):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
                found.append(f"{file}:{node.lineno}: print")
            if isinstance(node, ast.ImportFrom) and node.module == "epinet.terminal":
                names = {alias.name for alias in node.names}
                found += [f"{file}:{node.lineno}: {name}" for name in names - {"printable"}]
    assert not found
