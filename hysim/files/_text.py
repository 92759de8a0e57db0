"""What a file says, as text whose lines end in a line feed."""

import codecs

_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16, so it is asked first
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def text_of(content: str | bytes, name: str, encoding: str | None) -> str:
    """The text that a file of this name holds.

    Raises
    ------
    ValueError
        If it is not text in that encoding.
    """
    text = content if isinstance(content, str) else _decoded(content, name, encoding)
    if "\0" in text:
        raise ValueError(
            f"{name} is not a text file: it holds zero bytes; and it does not begin as NPZ, NPY, MAT (-v7, -v7.3) or "
            "HDF5 files do (or say in which encoding it is)"
        )
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


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
