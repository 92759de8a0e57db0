"""Files that appear whole or not at all."""

import os
import secrets
from pathlib import Path


def write_text(path: str | Path, text: str) -> None:
    """Write `text` beside `path`, then rename it into place; a failure leaves what was there before.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    target = Path(path)
    beside = target.with_name(f".{target.name}.{secrets.token_hex(8)}")
    try:
        with open(beside, "x", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.replace(beside, target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
