"""Sources to load from, and their formats, which are read from the first bytes and not from the name."""

import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol, TextIO, runtime_checkable

from hysim.files._frames import Frame
from hysim.interop import table_in

Source = str | os.PathLike[str] | TextIO | BinaryIO | Any  # Any stands for tables of other libraries

MOST_TEXT = 500_000_000
"""Most bytes of a text file, and of any stream."""

_HEAD = 640  # bytes: HDF5 may begin behind a block of 512
_MODEL = re.compile(rb'\s*\{(.*[{,])?\s*"family"\s*:', re.DOTALL)
_HDF5 = b"\x89HDF\r\n\x1a\n"
_PIECE = 1 << 20  # bytes that are read of a stream at once


class Opened(NamedTuple):
    """Name, format and content of a source, and its path if it is a file with one.

    The content of a DataFrame or the like is its table, that of a stream of letters is text.
    """

    name: str
    format: str
    content: Any
    path: Path | None = None


@runtime_checkable
class _Readable(Protocol):
    def read(self, size: int, /) -> Any: ...


@runtime_checkable
class _Named(Protocol):
    name: Any


@contextmanager
def opened(source: Source) -> Iterator[Opened]:
    """Open a source to read from; OSError, TypeError or ValueError if it cannot be read or is too large."""
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        with path.open("rb") as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                yield _regular(path, file)
            else:  # a pipe, a device
                yield _stream(path.name, file)
    elif isinstance(source, _Readable):
        yield _stream(Path(str(source.name)).name if isinstance(source, _Named) else "stream", source)
    elif (table := table_in(source)) is not None:
        yield Opened(f"the {table.kind}", "frame", Frame(table))
    else:
        raise TypeError(f"load takes a path, an open file or a DataFrame, got {type(source).__name__}")


def format_of(head: bytes) -> str:
    """The format of a file that begins so: "npz", "npy", "mat", "mat7.3", "hdf5", "model" or "text"."""
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "npz"
    if head.startswith(b"\x93NUMPY"):
        return "npy"
    if head.startswith(_HDF5) or head[512:520] == _HDF5:
        return "mat7.3" if head.startswith(b"MATLAB") else "hdf5"
    if head.startswith(b"MATLAB 5.0") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"):
        return "mat"
    return "model" if _MODEL.match(head) else "text"


def _regular(path: Path, file: BinaryIO) -> Opened:
    form = format_of(file.read(_HEAD))
    file.seek(0)
    size = os.fstat(file.fileno()).st_size
    if form == "text" and size > MOST_TEXT:
        raise ValueError(_too_large(path.name, str(size)))
    return Opened(path.name, form, file, path)


def _stream(name: str, source: Any) -> Opened:
    pieces: list[Any] = []
    size = 0
    while piece := source.read(_PIECE):
        size += len(piece)
        if size > MOST_TEXT:
            raise ValueError(_too_large(name, "more"))
        pieces.append(piece)
    if pieces and isinstance(pieces[0], str):
        text = "".join(pieces)
        return Opened(name, "model" if _MODEL.match(text[:_HEAD].encode(errors="replace")) else "text", text)
    content = b"".join(pieces)
    return Opened(name, format_of(content[:_HEAD]), BytesIO(content))


def _too_large(name: str, size: str) -> str:
    return (
        f"{name} is too large: a text or a stream may have {MOST_TEXT:,} bytes, got {size}; cut it, or save its "
        "columns as NPZ, MAT or HDF5 and pass the path"
    )
