"""The command line: the table of commands, and how bad input ends."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from typing import Annotated, Any, NoReturn

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
from epinet.terminal import RemarkHandler, remark, say

DEBUG = "EPINET_DEBUG"
"""The environment variable that stands for `--debug`, also where no option can be read."""
NAMES_OF_HELP = {"help_option_names": ["-h", "--help"]}
LOGGER = logging.getLogger("epinet")
KEPT = {
    "predict": "complete results are kept, and the same command goes on with the others",
    "evaluate": "complete maps in OUT/maps are kept, and the same command goes on with the others",
    "submit": "nothing was written",
    "train": "the last checkpoint is kept, and the same command continues from it",
    "synth": "complete scenes are kept, and the same command with --resume makes the others",
    "validation": "complete scenes are kept, and the same command makes the others",
}
"""What Ctrl-C leaves of a command's work. All others write their output whole at their end."""


class _Commands(OnceGroup):
    """The commands, which say what they kept when Ctrl-C ends one."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interruption:
            LOGGER.debug("interrupted here:", exc_info=interruption)
            kept = KEPT.get(ctx.invoked_subcommand, "nothing was written")
            remark(f"interrupted: {kept}")
            raise typer.Exit(130) from interruption


app = typer.Typer(
    name="epinet",
    cls=_Commands,
    context_settings=NAMES_OF_HELP,
    help="Depth from light fields, from views on disk to a disparity map.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
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
    app.command(cls=OnceCommand, context_settings=NAMES_OF_HELP)(command)
app.add_typer(weights.app, name="weights", context_settings=NAMES_OF_HELP)


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
    debug: Annotated[
        bool,
        typer.Option(
            "--debug", envvar=DEBUG, help="Print the traceback behind an error message, too."
        ),
    ] = False,
) -> None:
    set_limit(read_limit)
    if debug:
        LOGGER.setLevel(logging.DEBUG)


def main() -> None:
    """Run the command line; bad input ends with one clear message and exit status 2."""
    os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # read when torch is loaded
    _silence_libraries()
    handler = RemarkHandler()
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    try:
        sys.exit(app(standalone_mode=False))
    except InputError as error:
        _end(error, error.problems)
    except OSError as error:
        _end(error, [f"{error.filename or 'input or output'}: {error.strerror}"])
    except typer.Abort:
        remark("Aborted!")
        sys.exit(1)
    except Exception as error:
        if not hasattr(error, "format_message"):  # of usage, as click and typer's copy of it have
            raise
        _show_usage(error)
        sys.exit(2)
    finally:
        LOGGER.removeHandler(handler)


def _end(error: Exception, problems: list[str]) -> NoReturn:
    """Print what is wrong, with the traceback where --debug asks for it, and exit with status 2."""
    LOGGER.debug("the traceback behind the message below:", exc_info=error)
    for problem in problems:
        remark(f"error: {problem}")
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
