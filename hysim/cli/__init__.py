"""The command line: `hysim COMMAND ...`.

Exit codes: 0 done, 1 a search did not converge, 2 bad input, 130 interrupted, 143 or 129 ended by SIGTERM or
SIGHUP. Results go to the standard output, progress and errors to the standard error, an error in one line.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import NoReturn

from hysim import __version__
from hysim.cli import (
    c,
    columns,
    compare,
    completion,
    control,
    discover,
    example,
    fmu,
    identify,
    measure,
    metrics,
    models,
    outputs,
    page,
    plot,
    reproduce,
    signals,
    simulate,
    sweep,
)
from hysim.cli.options import Command
from hysim.errors import SimulationError

_MODULES = (
    example,
    columns,
    metrics,
    identify,
    discover,
    compare,
    simulate,
    control,
    c,
    fmu,
    plot,
    sweep,
    measure,
    reproduce,
)
_COMMANDS = (
    *(module.COMMAND for module in _MODULES),
    page.COMMAND,
    page.EXPLORE,
    completion.command(lambda: parsers()[1]),
)
COMMANDS = {command.name: command for command in _COMMANDS}
"""Every command by its name."""

DONE, BAD_INPUT = 0, 2


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: error: {_one_line(message)} (see {self.prog} --help)\n")

    def format_help(self) -> str:
        command: Command | None = self.get_default("command")
        if command is not None and models.FORMS in command.options:  # here, since loading every family takes seconds
            self.epilog = f"Names of models: {', '.join(models.names())}."
        return super().format_help()


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
    parser = _Parser(prog="hysim", description="Simulate, identify, discover, compare and compensate hysteresis.")
    parser.add_argument("--version", action="version", version=f"hysim {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for name, command in COMMANDS.items():
        if only in (None, name):
            command.add_to(commands)
    return parser, dict(commands.choices)


def _run(arguments: list[str]) -> int:
    named = next((argument for argument in arguments if not argument.startswith("-")), None)
    parser, _ = parsers(named if named in COMMANDS and arguments[0] == named else None)
    if named is not None and named not in COMMANDS:
        near = get_close_matches(named, COMMANDS, n=1)
        advice = f"did you mean {near[0]}?" if near else f"there are {', '.join(COMMANDS)}"
        parser.error(f"there is no command {named!r}: {advice}")
    options = parser.parse_args(arguments)
    if named is None:
        parser.print_help(sys.stderr)
        return BAD_INPUT
    import numpy as np

    with np.errstate(all="ignore"):  # an overflow is inf or nan in the result, and null in JSON
        outputs.check(options)
        return int(options.command.run(options))


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
    if isinstance(error, OSError) and error.strerror:
        return _one_line(f"{error.filename}: {error.strerror}" if error.filename else error.strerror)
    return _one_line(str(error)) or type(error).__name__


def _one_line(text: str) -> str:
    """The text in one line; characters that a terminal would obey are printed as their codes."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in " ".join(text.split()))
