"""The text that a file holds, with lines that end in a line feed."""

import codecs
from collections.abc import Callable, Iterator, Sequence
from io import IncrementalNewlineDecoder
from typing import BinaryIO, NamedTuple

COMMENTS = ("#", "%")

_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16, so it is looked for first
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_PIECE = 1 << 18  # bytes that are read at once: their lines take some megabytes


class Lines(NamedTuple):
    """Some lines of a text, with their numbers from 1."""

    numbers: Sequence[int]
    texts: list[str]


class Text(NamedTuple):
    """The text in a file or a string of this name, which is read piece by piece, and anew whenever it is asked for.

    A ValueError is raised where it is read if it is not text in its encoding. The first `skip` lines are empty.
    `reading(n_bytes)` is called after each piece.
    """

    content: str | BinaryIO
    name: str = ""
    encoding: str | None = None
    skip: int = 0
    reading: Callable[[int], None] = lambda n_bytes: None

    def samples(self) -> Iterator[Lines]:
        """The lines that are neither blank nor comments, some at a time."""
        for first, piece in self._whole_lines():
            texts = piece.split("\n")
            begins = {line[:1] for line in texts}
            if first > self.skip and not any(sign in ("", *COMMENTS) or sign.isspace() for sign in begins):
                yield Lines(range(first, first + len(texts)), texts)
                continue
            kept = [
                k
                for k, line in enumerate(texts)
                if first + k > self.skip and line.strip() and not line.lstrip().startswith(COMMENTS)
            ]
            yield Lines([first + k for k in kept], [texts[k] for k in kept])

    def top(self) -> Iterator[str]:
        """The lines from the first one on."""
        for first, piece in self._whole_lines():
            yield from ("" if k <= self.skip else line for k, line in enumerate(piece.split("\n"), first))

    def whole(self) -> str:
        """All of the text."""
        return "".join(self._pieces())

    def _whole_lines(self) -> Iterator[tuple[int, str]]:
        """Stretches of lines, without the last line feed, and the number of the first line of each."""
        number, begun = 1, list[str]()
        for piece in self._pieces():
            lines, end, rest = piece.rpartition("\n")
            if end:
                stretch = "".join([*begun, lines])
                yield number, stretch
                number, begun = number + stretch.count("\n") + 1, []
            begun.append(rest)
        yield number, "".join(begun)

    def _pieces(self) -> Iterator[str]:
        is_first = True
        for piece in self._decoded():
            if "\0" in piece:
                raise ValueError(_no_text(self.name, "text"))
            yield piece.removeprefix("\ufeff") if is_first else piece
            is_first = is_first and not piece

    def _decoded(self) -> Iterator[str]:
        if isinstance(self.content, str):
            lines = IncrementalNewlineDecoder(None, translate=True)
            for start in range(0, len(self.content), _PIECE):
                yield lines.decode(self.content[start : start + _PIECE])
            yield lines.decode("", final=True)
            return
        self.content.seek(0)
        piece = self.content.read(_PIECE)
        marked = next((known for mark, known in _MARKS.items() if piece.startswith(mark)), "utf-8")
        try:
            " ".encode(self.encoding or marked)  # an error also for what is no encoding of text
            decoder = IncrementalNewlineDecoder(codecs.getincrementaldecoder(self.encoding or marked)(), translate=True)
        except LookupError:
            raise ValueError(f"{self.name}: encoding must be one that Python knows, got {self.encoding!r}") from None
        try:
            while piece:
                yield decoder.decode(piece)
                self.reading(len(piece))
                piece = self.content.read(_PIECE)
            yield decoder.decode(b"", final=True)
        except UnicodeError as error:
            raise ValueError(_undecoded(self.content, self.name, self.encoding, marked, error)) from None


def _undecoded(content: BinaryIO, name: str, encoding: str | None, marked: str, error: UnicodeError) -> str:
    """The message about a file that is not text in its encoding, or in that of its mark."""
    content.seek(0)
    data = content.read()
    if encoding is None and marked == "utf-8" and b"\0" in data:
        return _no_text(name, "UTF-8 text")
    try:
        data.decode(encoding or marked)
    except UnicodeError as of_all:  # with its place in the file, and not in a piece of it
        error = of_all
    reason = f"{error.reason} at byte {error.start}" if isinstance(error, UnicodeDecodeError) else str(error)
    return (
        f"{name} is not a {(encoding or marked).upper()} text file: {reason}; pass its encoding, for instance "
        'encoding="latin-1"'
    )


def _no_text(name: str, kind: str) -> str:
    return (
        f"{name} is not a {kind} file: it holds zero bytes; and it does not begin as NPZ, NPY, MAT (-v7, -v7.3) or "
        "HDF5 files do (pass its encoding if it is text)"
    )
