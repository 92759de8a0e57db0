"""Files that appear whole or not at all."""

import os
import secrets
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


def write_text(path: str | Path, text: str) -> None:
    """Write `text` beside `path`, then rename it into place; a failure leaves what was there before.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    write_all({path: text})


def write_all(contents: Mapping[str | Path, str | bytes]) -> None:
    """Write texts and bytes to their paths as `write_text` does, and rename none before all are written.

    A signal that comes while they are renamed is heeded afterwards.

    Raises
    ------
    OSError
        If a folder cannot be written to.
    """
    with ExitStack() as last, ExitStack() as files:
        for path, content in contents.items():
            data = content.encode() if isinstance(content, str) else content
            file = files.enter_context(whole(path, "xb"))
            file.write(data)
            file.flush()
        last.enter_context(_signals_later())  # ends after the files have been renamed


@contextmanager
def _signals_later() -> Iterator[None]:
    """Hold back what Python does on a signal until the end of the block; it does it in the main thread alone."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    wanted = [signal.Signals[name] for name in _SIGNALS if name in signal.Signals.__members__]
    handlers = {number: signal.getsignal(number) for number in wanted}
    came: list[int] = []
    for number, handler in handlers.items():
        if callable(handler):
            signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if callable(handler):
                signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


@contextmanager
def whole(path: str | Path, mode: str, **options: Any) -> Iterator[IO[Any]]:
    """A file beside `path` to write to, which takes its place at the end of the block; a failure leaves what was there.

    `mode` is ``"x"`` or ``"xb"``, and the `options` are those of `open`. A link leads to what is renamed; a device or
    a pipe is written to as it is.
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
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
