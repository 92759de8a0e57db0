"""The command line: `hysim COMMAND ...`.

Exit codes: 0 done, 1 a search did not converge, 2 bad input, 130 interrupted, 143 or 129 ended by SIGTERM or
SIGHUP. Results go to the standard output, progress and errors to the standard error, an error in one line.
"""

import argparse
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext

from hysim import __version__
from hysim._progress import silent
from hysim.cli import (
    c,
    columns,
    compare,
    control,
    discover,
    example,
    fmu,
    identify,
    measure,
    metrics,
    outputs,
    page,
    plot,
    posterior,
    reproduce,
    simulate,
    sweep,
)
from hysim.cli.options import Command
from hysim.cli.shell import completion, signals
from hysim.cli.shell.parser import BAD_INPUT, Parser, in_groups, one_line, unexpected, unknown_options
from hysim.cli.shell.words import in_shell_words, suggestion
from hysim.errors import SimulationError

GROUPS: Mapping[str, Sequence[Command]] = {
    "look at a file": (example.COMMAND, columns.COMMAND, metrics.COMMAND, plot.COMMAND),
    "from a file to a model": (identify.COMMAND, posterior.COMMAND, compare.COMMAND, discover.COMMAND),
    "use a model": (simulate.COMMAND, control.COMMAND, page.COMMAND),
    "take a model elsewhere": (c.COMMAND, fmu.COMMAND),
    "many simulations": (sweep.COMMAND,),
    "camera frames": (measure.COMMAND,),
    "learn and set up": (page.EXPLORE, reproduce.COMMAND, completion.command(lambda: parsers()[1])),
}
"""Every command, in groups as the help shows them."""

COMMANDS = {command.name: command for commands in GROUPS.values() for command in commands}
"""Every command by its name."""

DONE = 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    try:
        try:
            with signals.handled():
                return _run(sys.argv[1:] if arguments is None else list(arguments))
        finally:
            print(end="", flush=True)
    except (KeyboardInterrupt, signals.Ended) as request:
        return _ended(request)
    except BrokenPipeError:  # the reader of the output has closed it
        return _discard(DONE)
    except MemoryError:
        return _failed(BAD_INPUT, "error: there is not enough memory for this")
    except (ValueError, TypeError, OSError, ImportError, SimulationError) as error:
        cause: BaseException | None = error  # an interrupted import of a compiled module is an ImportError
        while cause is not None:
            if isinstance(cause, (KeyboardInterrupt, signals.Ended)):
                return _ended(cause)
            cause = cause.__cause__ or cause.__context__
        return _failed(BAD_INPUT, f"error: {_line(error)}")


def _ended(request: "KeyboardInterrupt | signals.Ended") -> int:
    number = request.number if isinstance(request, signals.Ended) else signal.SIGINT
    return _failed(128 + number, signals.message(number))


def parsers(only: str | None = None) -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """The parser of the whole command line, and the parsers of each command, or of one command only."""
    parser = Parser(
        prog="hysim",
        usage="hysim COMMAND ...",
        description="Simulate, identify, discover, compare and compensate hysteresis.",
        epilog=f"{in_groups(GROUPS)}\n\nEach command has its own help: hysim COMMAND --help. To begin: hysim example.",
    )
    parser.add_argument("--version", action="version", version=f"hysim {__version__}")
    commands = parser.add_subparsers(prog="hysim", metavar="COMMAND", help=argparse.SUPPRESS)
    for name, command in COMMANDS.items():
        if only in (None, name):
            command.add_to(commands)
    return parser, dict(commands.choices)


def _run(arguments: list[str]) -> int:
    named = next((argument for argument in arguments if not argument.startswith("-")), None)
    parser, of_commands = parsers(named if named in COMMANDS and arguments[0] == named else None)
    if named is not None and named not in COMMANDS:
        advice = suggestion(named, ["--help", *COMMANDS]) or f"there are {', '.join(COMMANDS)}"
        parser.error(f"there is no command {named!r}: {advice}")
    asked = parser if named is None else of_commands[named]
    own = arguments if named is None else arguments[arguments.index(named) + 1 :]
    if misspelt := unknown_options(own, asked):  # which argparse would take for a required option that is missing
        asked.error(unexpected(misspelt, asked))
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        asked.error(unexpected(unknown, asked))
    if named is None:
        parser.print_help(sys.stderr)
        return BAD_INPUT
    import numpy as np

    reporting = silent() if options.quiet else nullcontext()
    with np.errstate(all="ignore"), reporting, _told_in_shell_words(options):  # an overflow is inf or nan: null in JSON
        outputs.check(options)
        return int(options.command.run(options))


@contextmanager
def _told_in_shell_words(options: argparse.Namespace) -> Iterator[None]:
    """Raise an error of the library again as one that names options in place of arguments."""
    try:
        yield
    except (ValueError, TypeError, SimulationError) as error:
        raise ValueError(in_shell_words(str(error) or type(error).__name__, options.flags)) from error


def _failed(code: int, text: str) -> int:
    """Print in one line what happened, over a line of progress if there is one."""
    start = "\r\x1b[K" if sys.stderr.isatty() else ""
    print(f"{start}hysim: {text}", file=sys.stderr)
    try:
        print(end="", flush=True)
    except OSError:
        return _discard(code)
    return code


def _discard(code: int) -> int:
    """Send the output that is still buffered to nowhere, since nobody reads it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _line(error: BaseException) -> str:
    if isinstance(error, FileNotFoundError) and error.filename and (near := _near_file(str(error.filename))):
        return one_line(f"{error.filename}: {error.strerror}: {near}")
    if isinstance(error, OSError) and error.strerror:
        return one_line(f"{error.filename}: {error.strerror}" if error.filename else error.strerror)
    return one_line(str(error)) or type(error).__name__


def _near_file(path: str) -> str:
    """``did you mean FILE?`` for the nearest file in the same folder, an empty text if none is near."""
    folder, name = os.path.split(path)
    try:
        near = suggestion(name, os.listdir(folder or "."))
    except OSError:
        return ""
    return near and f"did you mean {os.path.join(folder, near.removeprefix('did you mean '))}"
