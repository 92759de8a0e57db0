"""Files that are written completely or not at all."""

import os
import secrets
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
ENDING = tuple(signal.Signals[name] for name in _NAMES if name in signal.Signals.__members__)
"""Signals that end a process, of those that the platform knows."""


def write_all(contents: Mapping[Any, str | bytes]) -> None:
    """Write new files, all before one is renamed to its path; a failure leaves the old ones, and signals wait."""
    with ExitStack() as last, ExitStack() as files:
        for path, content in contents.items():
            data = content.encode() if isinstance(content, str) else content
            file = files.enter_context(replacing(path, "xb"))
            file.write(data)
            file.flush()
        last.enter_context(_deferred_signals())  # ends after the files have been renamed


@contextmanager
def _deferred_signals() -> Iterator[None]:
    """Defer the handlers of signals, which Python runs in the main thread, to the end of the block."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: handler for number in ENDING if callable(handler := signal.getsignal(number))}
    received: list[int] = []
    for number in handlers:
        signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if received:
            signal.raise_signal(received[0])


@contextmanager
def replacing(path: str | Path, mode: str, **options: Any) -> Iterator[IO[Any]]:
    """A new file to write to, which replaces `path` at the end of the block; a failure leaves the old file.

    `mode` is ``"x"`` or ``"xb"``, and the `options` are those of `open`. The target of a link is replaced; a device or
    a pipe is written to directly.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        with open(target, mode.replace("x", "w"), **options) as file:
            yield file
        return
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    try:
        with open(beside, mode, **options) as file:
            yield file
        os.replace(beside, target)
    except BaseException as error:
        with suppress(OSError):
            beside.unlink()
        if isinstance(error, OSError) and error.filename == str(beside):  # a name that the user has not given
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
