"""The command line: `hysim COMMAND ...`.

Exit codes: 0 done, 1 a search did not converge, 2 bad input, 130 interrupted, 143 or 129 ended by SIGTERM or
SIGHUP. Results go to the standard output, progress and errors to the standard error, an error in one line.

Python raises an exception for a signal between two steps of its own, never inside a call of a compiled library, so that
a long call would delay the end. A thread therefore waits for `PATIENCE` and ends the process if it still runs.
"""

import importlib
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from types import FrameType
from typing import Any, NoReturn

import click
from click.shell_completion import shell_complete

from hysim import __version__
from hysim._basics.atomic import ENDING
from hysim._basics.names import nearest
from hysim._basics.progress import silent
from hysim.cli import options, outputs
from hysim.cli.options import flag, suggestion
from hysim.cli.outputs import in_shell_words
from hysim.errors import SimulationError

GROUPS: Mapping[str, Mapping[str, str]] = {
    "look at a file": {"example": "learn", "columns": "look", "metrics": "look", "plot": "look"},
    "from a file to a model": dict.fromkeys(("identify", "posterior", "compare", "discover"), "fits"),
    "use a model": dict.fromkeys(("simulate", "control", "page"), "use"),
    "take a model elsewhere": dict.fromkeys(("c", "fmu"), "use"),
    "many simulations": {"sweep": "sweep"},
    "camera frames": {"measure": "look"},
    "learn and set up": dict.fromkeys(("explore", "reproduce", "completion", "warm-up"), "learn"),
}
"""Module of every command, in groups as the help shows them; it is loaded when the command runs, or for the help."""

COMMANDS = {name: module for commands in GROUPS.values() for name, module in commands.items()}
"""Module of every command by its name."""

DONE, NOT_REACHED, BAD_INPUT, NOT_FINISHED = 0, 1, 2, 3
_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 120}


class Command(click.Command):
    """A command from a function of the same name, whose help ends with the names of models and with examples."""

    def __init__(self, name: str) -> None:
        self.function = vars(importlib.import_module(f"hysim.cli.{COMMANDS[name]}"))[name.replace("-", "_")]
        self.declared = [*options.parameters(self.function)]
        self.sections = options.sections(self.function)
        summary = self.sections[""].partition(".\n")[0]
        params = [each.click for each in self.declared]
        super().__init__(name, params=params, context_settings=_SETTINGS, short_help=summary)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        formatter.write("\n")
        paragraphs = self.sections[""].split("\n\n")
        formatter.write_text("\n\n".join(f"\b\n{text}" if text.startswith("  ") else text for text in paragraphs))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        groups: dict[str, list[tuple[str, str]]] = {}
        for each in self.declared:
            own = (str(each.click.metavar), each.help)  # since click helps with options only
            row = own if isinstance(each.click, click.Argument) else each.click.get_help_record(ctx) or own
            groups.setdefault(each.title, []).append(row)
        groups.setdefault("Options", []).append(("-h, --help", "show this help and exit"))
        for title, rows in groups.items():
            with formatter.section(title):
                formatter.write_dl(rows)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for models in {each.value.models for each in self.declared if each.value.models is not None}:
            formatter.write("\n")
            formatter.write_text(f"Names of models: {', '.join(models())}.")
        with formatter.section("Examples"):
            for line in self.sections["Examples"].splitlines():
                formatter.write(f"  {line}\n")

    def invoke(self, ctx: click.Context) -> int:
        """Run the function; an error of the library is raised again as one that names options."""
        import numpy as np

        values = ctx.params
        roles = [(each.value.role, values[str(each.click.name)]) for each in self.declared if each.value.role]
        lists = [(role, value if isinstance(value, tuple) else (value,)) for role, value in roles]
        files = [(path, role) for role, paths in lists for path in paths if path is not None]
        reporting = silent() if values["quiet"] else nullcontext()
        try:
            with np.errstate(all="ignore"), reporting:  # an overflow is inf or nan: null in JSON
                outputs.check(files, prints=values.get("json", False))
                result = options.call(self.function, values)
                if isinstance(result, options.Result):
                    outputs.write(result.files, result.text, result.document)
                    if result.unfinished:
                        print(f"hysim: not finished: {result.unfinished}", file=sys.stderr)
                        return NOT_FINISHED
                    result = result.reached
                return NOT_REACHED if result is False else DONE
        except (ValueError, TypeError, SimulationError) as error:
            words = in_shell_words(str(error) or type(error).__name__, outputs.flags(self))
            raise ValueError(words) from error


class Hysim(click.Group):
    """All commands, each loaded when it is named."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> Command:
        """The command of this name; a UsageError with the nearest name if it is unknown."""
        if cmd_name not in COMMANDS:
            advice = suggestion(cmd_name, ["--help", *COMMANDS]) or f"there are {', '.join(COMMANDS)}"
            raise click.UsageError(f"there is no command {cmd_name!r}: {advice}", ctx)
        return Command(cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name, str(self.get_command(ctx, name).short_help)) for name in commands])


HYSIM = click.version_option(__version__, message="hysim %(version)s")(
    Hysim(
        "hysim",
        help="Simulate, identify, discover, compare and compensate hysteresis.",
        epilog="Each command has its own help: hysim COMMAND --help. To begin: hysim example.",
        context_settings=_SETTINGS,
        subcommand_metavar="COMMAND ...",
    )
)
"""The whole command line."""


def main(arguments: Sequence[str] | None = None) -> int:
    try:
        try:
            with _signals_handled():
                return _run(sys.argv[1:] if arguments is None else list(arguments))
        finally:
            print(end="", flush=True)
    except (KeyboardInterrupt, Ended) as request:
        return _ended(request)
    except click.exceptions.Exit as request:  # after --help and --version
        return request.exit_code
    except click.UsageError as error:
        path = error.ctx.command_path if error.ctx else "hysim"
        return _failed(BAD_INPUT, f"error: {one_line(_advice(error))} (see {path} --help)", path)
    except BrokenPipeError:  # the reader of the output has closed it
        return _discard(DONE)
    except MemoryError:
        return _failed(BAD_INPUT, "error: there is not enough memory for this")
    except (ValueError, TypeError, OSError, ImportError, SimulationError) as error:
        cause: BaseException | None = error  # an interrupted import of a compiled module is an ImportError
        while cause is not None:
            if isinstance(cause, (KeyboardInterrupt, Ended)):
                return _ended(cause)
            cause = cause.__cause__ or cause.__context__
        return _failed(BAD_INPUT, f"error: {_line(error)}")


def _run(arguments: list[str]) -> int:
    if instruction := os.environ.get("_HYSIM_COMPLETE"):
        return shell_complete(HYSIM, {}, "hysim", "_HYSIM_COMPLETE", instruction)
    if not arguments:
        print(HYSIM.get_help(click.Context(HYSIM, info_name="hysim")), file=sys.stderr)
        return BAD_INPUT
    with HYSIM.make_context("hysim", arguments) as context:
        code: int = HYSIM.invoke(context)
        return code


def _ended(request: "KeyboardInterrupt | Ended") -> int:
    number = request.number if isinstance(request, Ended) else signal.SIGINT
    return _failed(128 + number, _message(number))


def _failed(code: int, text: str, program: str = "hysim") -> int:
    start = "\r\x1b[K" if sys.stderr.isatty() else ""
    print(f"{start}{program}: {text}", file=sys.stderr)
    try:
        print(end="", flush=True)
    except OSError:
        return _discard(code)
    return code


def _discard(code: int) -> int:
    """Send the output that is still buffered to nowhere, since nobody reads it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _advice(error: click.UsageError) -> str:
    if not isinstance(error, click.NoSuchOption) or error.ctx is None:
        return error.format_message()
    word = error.option_name
    meant = flag(word.lstrip("-").partition("=")[0].replace("-", "_"))
    known = [each for option in error.ctx.command.get_params(error.ctx) for each in option.opts]
    near = f"did you mean {meant}?" if meant in known else suggestion(word, known)
    return f"there is no option {word}" + (near and f": {near}")


def _line(error: BaseException) -> str:
    if not isinstance(error, OSError) or not error.strerror:
        return one_line(str(error)) or type(error).__name__
    path = str(error.filename or "")
    near = _near_file(path) if path and isinstance(error, FileNotFoundError) else ""
    return one_line(": ".join(filter(None, (path, error.strerror, near))))


def _near_file(path: str) -> str:
    """``did you mean FILE?`` for the nearest file in the same folder, an empty text if no name is similar."""
    folder, name = os.path.split(path)
    near = None
    with suppress(OSError):
        near = nearest(name, os.listdir(folder or "."))
    return f"did you mean {os.path.join(folder, near)}?" if near else ""


def one_line(text: str) -> str:
    """The text in one line; characters that a terminal would obey are printed as their codes."""
    return "".join(sign if sign.isprintable() else repr(sign)[1:-1] for sign in " ".join(text.split()))


PATIENCE = 1.3
"""Seconds in which a command can end in order."""


class Ended(BaseException):
    """A signal asks the process to end: unfinished files are removed on the way out, as after Ctrl-C."""

    @property
    def number(self) -> int:
        return int(self.args[0])


def _message(number: int) -> str:
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


@contextmanager
def _signals_handled() -> Iterator[None]:
    """Turn signals that would end the process into an exception where they have no handler; only in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in ENDING}
    unhandled = [number for number, handler in handlers.items() if handler is signal.SIG_DFL]
    watched = [*unhandled, *(number for number, handler in handlers.items() if handler is signal.default_int_handler)]
    for number in unhandled:
        signal.signal(number, _raise)
    report, sys.unraisablehook = sys.unraisablehook, _report_errors
    try:
        with _watched(frozenset(watched)):
            yield
    finally:
        sys.unraisablehook = report
        for number in unhandled:
            signal.signal(number, signal.SIG_DFL)


def _report_errors(unraisable: Any) -> None:
    """Print errors that could not be raised, but no interrupts, which may come in a callback of a compiled library."""
    if issubclass(unraisable.exc_type, Exception):
        sys.__unraisablehook__(unraisable)


def _raise(number: int, _: FrameType | None) -> NoReturn:
    raise Ended(number)


@contextmanager
def _watched(numbers: frozenset[int]) -> Iterator[None]:
    """Let a thread read the signals that arrive, and end the process if the block does not end in time."""
    if sys.platform == "win32":  # where signals can be written to sockets only
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    is_over = threading.Event()
    thread = threading.Thread(target=_watch, args=(reader, numbers, is_over), daemon=True)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        signal.set_wakeup_fd(before)
        os.close(writer)
        thread.join()
        os.close(reader)


def _watch(reader: int, numbers: frozenset[int], is_over: threading.Event) -> None:
    """Wait for a signal, then for the end of the block, which closes the other side of the pipe."""
    while received := os.read(reader, 1):
        if received[0] in numbers and not is_over.wait(PATIENCE):
            start = b"\r\x1b[K" if sys.stderr is not None and sys.stderr.isatty() else b""
            os.write(2, start + f"hysim: {_message(received[0])}\n".encode())
            os._exit(128 + received[0])
