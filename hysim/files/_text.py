"""What a file says, as text whose lines end in a line feed."""

import codecs
import os
from pathlib import Path
from typing import BinaryIO, TextIO

Source = str | os.PathLike[str] | TextIO | BinaryIO

_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16, so it is asked first
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def read(source: Source, encoding: str | None) -> tuple[str, str]:
    """What to call the file, and its text.

    Raises
    ------
    ValueError
        If it is not text in that encoding.
    OSError
        If it cannot be read.
    """
    if isinstance(source, (str, os.PathLike)):
        name = Path(source).name
        content: str | bytes = Path(source).read_bytes()
    else:
        name = Path(str(getattr(source, "name", "stream"))).name
        content = source.read()
    text = content if isinstance(content, str) else _decoded(content, name, encoding)
    if "\0" in text:
        raise ValueError(f"{name} is not a text file: it holds zero bytes (or say in which encoding it is)")
    return name, text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


def _decoded(content: bytes, name: str, encoding: str | None) -> str:
    marked = next((found for mark, found in _MARKS.items() if content.startswith(mark)), "utf-8")
    try:
        return content.decode(encoding or marked)
    except LookupError:
        raise ValueError(f"{name}: encoding must be one that Python knows, got {encoding!r}") from None
    except UnicodeError as error:
        reason = f"{error.reason} at byte {error.start}" if isinstance(error, UnicodeDecodeError) else str(error)
        raise ValueError(
            f"{name} is not a {(encoding or marked).upper()} text file: {reason}; say in which encoding it is, "
            'for instance encoding="latin-1"'
        ) from None
