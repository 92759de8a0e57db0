"""The command line: `hysim COMMAND ...`.

Exit codes: 0 done, 1 a search did not converge, 2 bad input, 130 interrupted. Results go to the standard
output, progress and errors to the standard error, an error in one line.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from hysim import __version__
from hysim.cli import compare, discover, identify, measure, metrics, plot, reproduce, simulate, sweep
from hysim.errors import SimulationError

COMMANDS = (identify, discover, compare, metrics, simulate, plot, sweep, measure, reproduce)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {' '.join(message.split())} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    parser = _Parser(prog="hysim", description="Simulate, identify, discover and compare hysteretic actuators.")
    parser.add_argument("--version", action="version", version=f"hysim {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_to(commands)
    options = parser.parse_args(arguments)
    try:
        return int(options.command(options))
    except KeyboardInterrupt:
        print("hysim: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # who reads the output has had enough of it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ValueError, OSError, SimulationError) as error:
        print(f"hysim: error: {_line(error)}", file=sys.stderr)
        return 2


def _line(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())
