"""The end of a command on Ctrl-C, SIGTERM or SIGHUP: in order if possible, and in any case soon.

Python raises an exception between two steps of its own, never inside a call of a compiled library, so that a long call
would delay the end. A thread therefore waits for `PATIENCE` and then ends the process, unless the command has ended.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, NoReturn

PATIENCE = 1.3
"""Seconds in which a command can end in order."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Ended(BaseException):
    """A signal asks the process to end: unfinished files are removed on the way out, as after Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def message(number: int) -> str:
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


@contextlib.contextmanager
def handled() -> Iterator[None]:
    """Turn signals that would end the process into an exception where they have no handler; only in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [signal.Signals[name] for name in _NAMES if name in signal.Signals.__members__]
    unhandled = [number for number in numbers if signal.getsignal(number) is signal.SIG_DFL]
    watched = [*unhandled, *(number for number in numbers if signal.getsignal(number) is signal.default_int_handler)]
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


@contextlib.contextmanager
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
            os.write(2, start + f"hysim: {message(received[0])}\n".encode())
            os._exit(128 + received[0])
