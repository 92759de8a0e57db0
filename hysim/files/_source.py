"""What is loaded from, and which format it has: that is read from its first bytes, not from its name."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TextIO

Source = str | os.PathLike[str] | TextIO | BinaryIO

MOST_TEXT = 500_000_000
"""Most bytes of a text file, and of any file that comes as a stream: a text takes ten times as much to read."""

_HEAD = 640  # bytes: HDF5 may begin behind a block of 512
_HDF5 = b"\x89HDF\r\n\x1a\n"
_PIECE = 1 << 20  # bytes that are read of a stream at once


class Opened(NamedTuple):
    """What to call a source, its format, its content, read if it is a text, and its path if it is a file with one."""

    name: str
    format: str
    content: str | bytes | BinaryIO
    path: Path | None = None


@contextmanager
def opened(source: Source) -> Iterator[Opened]:
    """Open a source to read from.

    Raises
    ------
    OSError
        If it cannot be read.
    TypeError
        If it is neither a path nor an open file.
    ValueError
        If it is too large.
    """
    if isinstance(source, (str, os.PathLike)):
        path = Path(source)
        with path.open("rb") as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                yield _regular(path, file)
            else:  # a pipe, a device
                yield _stream(path.name, file)
    elif callable(getattr(source, "read", None)):
        yield _stream(Path(str(getattr(source, "name", "stream"))).name, source)
    else:
        raise TypeError(f"load takes a path or an open file, got {type(source).__name__}")


def format_of(head: bytes) -> str:
    """The format of a file that begins so: "npz", "npy", "mat", "mat7.3", "hdf5" or "text"."""
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "npz"
    if head.startswith(b"\x93NUMPY"):
        return "npy"
    if head[512:520] == _HDF5 and head.startswith(b"MATLAB"):
        return "mat7.3"
    if head.startswith(_HDF5) or head[512:520] == _HDF5:
        return "hdf5"
    if head.startswith(b"MATLAB 5.0") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"):
        return "mat"
    return "text"


def _regular(path: Path, file: BinaryIO) -> Opened:
    found = format_of(file.read(_HEAD))
    file.seek(0)
    if found != "text":
        return Opened(path.name, found, file, path)
    size = os.fstat(file.fileno()).st_size
    if size > MOST_TEXT:
        raise ValueError(f"{path.name} is too large: {_too_large(size)}")
    return Opened(path.name, found, file.read(), path)


def _stream(name: str, source: Any) -> Opened:
    pieces: list[Any] = []
    size = 0
    while piece := source.read(_PIECE):
        size += len(piece)
        if size > MOST_TEXT:
            raise ValueError(f"{name} is too large: {_too_large(size)}")
        pieces.append(piece)
    if pieces and isinstance(pieces[0], str):
        return Opened(name, "text", "".join(pieces))
    content = b"".join(pieces)
    found = format_of(content[:_HEAD])
    return Opened(name, found, content if found == "text" else BytesIO(content))


def _too_large(size: int) -> str:
    return (
        f"a text or a stream may have {MOST_TEXT:,} bytes, got {'more' if size < MOST_TEXT + 2 * _PIECE else size}; "
        "cut it, or save its columns as NPZ, MAT or HDF5 and give the path"
    )
