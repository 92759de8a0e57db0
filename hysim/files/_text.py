"""The text that a file holds, with lines that end in a line feed."""

import codecs

_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16, so it is looked for first
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def text_of(content: str | bytes, name: str, encoding: str | None) -> str:
    """The text in a file of this name; ValueError if it is not text in that encoding."""
    text = content if isinstance(content, str) else _decoded(content, name, encoding)
    if "\0" in text:
        raise ValueError(_no_text(name, "text"))
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


def _decoded(content: bytes, name: str, encoding: str | None) -> str:
    marked = next((known for mark, known in _MARKS.items() if content.startswith(mark)), "utf-8")
    try:
        return content.decode(encoding or marked)
    except LookupError:
        raise ValueError(f"{name}: encoding must be one that Python knows, got {encoding!r}") from None
    except UnicodeError as error:
        if encoding is None and marked == "utf-8" and b"\0" in content:
            raise ValueError(_no_text(name, "UTF-8 text")) from None
        reason = f"{error.reason} at byte {error.start}" if isinstance(error, UnicodeDecodeError) else str(error)
        raise ValueError(
            f"{name} is not a {(encoding or marked).upper()} text file: {reason}; pass its encoding, for instance "
            'encoding="latin-1"'
        ) from None


def _no_text(name: str, kind: str) -> str:
    return (
        f"{name} is not a {kind} file: it holds zero bytes; and it does not begin as NPZ, NPY, MAT (-v7, -v7.3) or "
        "HDF5 files do (pass its encoding if it is text)"
    )
