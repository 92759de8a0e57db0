"""Files that appear whole or not at all."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any


def write_text(path: str | Path, text: str) -> None:
    """Write `text` beside `path`, then rename it into place; a failure leaves what was there before.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    with whole(path, "x", encoding="utf-8", newline="\n") as file:
        file.write(text)


@contextmanager
def whole(path: str | Path, mode: str, **options: Any) -> Iterator[IO[Any]]:
    """A file beside `path` to write to, which takes its place at the end of the block; a failure leaves what was there.

    `mode` is ``"x"`` or ``"xb"``, and the `options` are those of `open`.
    """
    target = Path(path)
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    try:
        with open(beside, mode, **options) as file:
            yield file
        os.replace(beside, target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
