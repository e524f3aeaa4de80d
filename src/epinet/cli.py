"""The command line: the table of commands, and how bad input ends."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from typing import Annotated, Any

import typer

from epinet import __version__
from epinet.commands import weights
from epinet.commands.calibrate import calibrate
from epinet.commands.convert import convert
from epinet.commands.demo import demo
from epinet.commands.depth import depth
from epinet.commands.evaluate import evaluate
from epinet.commands.fade import fade
from epinet.commands.info import info
from epinet.commands.mesh import mesh
from epinet.commands.once import OnceCommand, OnceGroup
from epinet.commands.predict import predict
from epinet.commands.refocus import refocus
from epinet.commands.submit import submit
from epinet.commands.synth import synth, validation
from epinet.commands.train import train
from epinet.commands.wiggle import wiggle
from epinet.errors import InputError
from epinet.reading import LIMIT_BYTES, set_limit
from epinet.terminal import remark, say

app = typer.Typer(
    name="epinet",
    cls=OnceGroup,
    help="Depth from light fields, from views on disk to a disparity map.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
SPINS = "1000"
"""How often a thread of torch looks whether the others are done before it sleeps. GNU's OpenMP
looks some 300,000 times: where another program keeps a core busy, the waiting take the time that
the awaited need, and every run is several times slower."""
COMMANDS = (
    info,
    convert,
    predict,
    depth,
    calibrate,
    mesh,
    refocus,
    fade,
    wiggle,
    demo,
    evaluate,
    submit,
    train,
    synth,
    validation,
)
for command in COMMANDS:
    app.command(cls=OnceCommand)(command)
app.add_typer(weights.app, name="weights")


def _version(wanted: bool) -> None:
    if wanted:
        say(f"epinet {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it and exit.")
    ] = False,
    read_limit: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="MB",
            help="What a file may decode to in memory, if it is not large itself.",
        ),
    ] = LIMIT_BYTES // 10**6,
) -> None:
    set_limit(read_limit)


def main() -> None:
    """Run the command line; bad input ends with one clear message and exit status 2."""
    os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # read when torch is loaded
    _silence_libraries()
    try:
        sys.exit(app(standalone_mode=False))
    except InputError as error:
        for problem in error.problems:
            remark(f"error: {problem}")
        sys.exit(2)
    except OSError as error:
        remark(f"error: {error.filename or 'input or output'}: {error.strerror}")
        sys.exit(2)
    except typer.Abort:
        remark("Aborted!")
        sys.exit(1)
    except Exception as error:
        if not hasattr(error, "format_message"):  # of usage, as click and typer's copy of it have
            raise
        _show_usage(error)
        sys.exit(2)


def _silence_libraries() -> None:
    """What Pillow or numpy think of a damaged file, with lines of their source, says no user more
    than our message; `python -W default` shows it."""
    logging.getLogger("PIL").addHandler(logging.NullHandler())
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def _show_usage(error: Any) -> None:
    """Say what is wrong with the arguments, which are not printed as they are."""
    if type(error).__name__ == "NoArgsIsHelpError":
        lines = error.format_message().splitlines()
    else:
        usage = error.ctx.get_usage().splitlines() if error.ctx else []
        hint = f"Try '{error.ctx.command_path} --help' for help." if error.ctx else ""
        lines = [*usage, hint, "", f"Error: {error.format_message()}"]
    for line in lines:
        remark(line)
