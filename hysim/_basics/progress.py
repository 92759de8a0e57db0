"""Progress of long calls, reported by the outermost verb only, by default in one line on the standard error."""

import contextlib
import functools
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from datetime import timedelta
from typing import Any, Literal, ParamSpec, Self, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

Progress = Callable[[int, int], None]
"""Called as ``progress(done, total)``; a total of 0 stands for an unknown one."""

Reports = Progress | Literal[False] | None
"""What a caller asks for: a function to call, False for no report, None for a line on the standard error."""

_SILENT = 2.0  # seconds of a call without a report
_ON_TERMINAL, _IN_FILE = 0.1, 10.0  # seconds between two reports

_is_inside: ContextVar[bool] = ContextVar("is inside a verb", default=False)
_along: ContextVar[Progress | None] = ContextVar("progress along samples", default=None)


def reports(verb: Callable[P, T]) -> Callable[P, T]:
    """Let a verb with an argument `progress` report by default, unless another verb or `silent` is around it."""

    @functools.wraps(verb)
    def reporting(*arguments: P.args, **named: P.kwargs) -> T:
        options: Any = named
        if named.get("progress") is not None or _is_inside.get():
            with silent():
                return verb(*arguments, **options)
        with Line(verb.__name__) as line, silent():
            return verb(*arguments, **{**options, "progress": line})

    return reporting


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """No report by default from the verbs in the block."""
    token = _is_inside.set(True)
    try:
        yield
    finally:
        _is_inside.reset(token)


def silence() -> None:
    """No report by default from this thread on, as in a process that works for another one."""
    _is_inside.set(True)


@contextlib.contextmanager
def along(progress: Reports) -> Iterator[None]:
    """Report how far `hysim._basics.parallel.in_pieces` has followed the input of a plant; None changes nothing."""
    token = _along.set(_along.get() if progress is None else progress or None)
    try:
        yield
    finally:
        _along.reset(token)


def followed(done: int, total: int) -> None:
    if (progress := _along.get()) is not None:
        with along(False):  # what the caller's function runs is not reported to it
            progress(done, total)


def announced_by(progress: Reports) -> Callable[[str], None] | None:
    """The function by which a line is told what is at work; None for a callable of the user."""
    return progress.announce if isinstance(progress, Line) else None


class Line:
    """A line on the standard error after `_SILENT` seconds: the verb, what is at work, and how long the rest may take.

    On a terminal it is overwritten, and erased at the end. Kernels that are compiled meanwhile are named.
    """

    def __init__(self, verb: str) -> None:
        self.verb, self.subject, self.counted, self.is_shown = verb, "", "", False
        self.warning = ""
        self.first: tuple[float, int] | None = None  # seconds and the number that was done
        self.done = 0
        self.due = time.monotonic() + _SILENT
        self.process = os.getpid()

    def __enter__(self) -> Self:
        self.compilations = sys.modules.get("numba.core.event")
        if self.compilations is not None:
            self.listener = _listener(self.compilations, self)
            self.compilations.register("numba:compile", self.listener)
        return self

    def __exit__(self, *_: object) -> None:
        if self.compilations is not None:
            self.compilations.unregister("numba:compile", self.listener)
        if self.is_shown and sys.stderr.isatty():
            self._write("\r\x1b[K")

    def __call__(self, done: int, total: int, subject: str = "") -> None:
        now, self.subject = time.monotonic(), subject or self.subject
        if done < self.done:  # of another search
            self.first = None
        begin, before = self.first = self.first or (now, done)
        self.done, rate = done, (done - before) / max(now - begin, 1e-9)
        self.counted = f"{done} of {total}" if total else f"{done}"
        if total and rate > 0 and done < total:
            self.counted += f", {timedelta(seconds=round((total - done) / rate))} left"
        self._show(self.counted)

    def warn(self, warning: str) -> None:
        self.warning = warning

    def announce(self, subject: str) -> None:
        self.subject = subject
        self._show(self.counted)

    def compiling(self) -> None:
        """Say that kernels are being compiled, which happens once: they are kept in a cache."""
        self._show("compiling, once")

    def _show(self, text: str) -> None:
        now = time.monotonic()
        if now < self.due or sys.stderr is None or os.getpid() != self.process:
            return
        line = ": ".join(filter(None, (self.verb, self.subject, text)))
        is_terminal = sys.stderr.isatty()
        if line == self.verb and not is_terminal:  # nothing is known but that it goes on
            return
        warning, self.warning = self.warning and f"{self.verb}: {self.warning}\n", ""
        self._write(f"{warning}\r\x1b[K{line}" if is_terminal else f"{warning}{line}\n")
        self.due, self.is_shown = now + (_ON_TERMINAL if is_terminal else _IN_FILE), True

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # nobody reads it any more
            print(text, end="", file=sys.stderr, flush=True)


def _listener(event: Any, line: Line) -> Any:
    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: Any) -> None:
            line.compiling()

        def on_end(self, _: Any) -> None:
            line.announce(line.subject)

    return Listener()
