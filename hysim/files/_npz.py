"""NumPy's files: an array (NPY), or a zip archive of arrays (NPZ).

An array begins with ``\\x93NUMPY``, a version, the length of its header and the header, a Python dictionary of its
number type, order and shape. Only plain types are read: an array of objects is a pickle, which could run any code.
A header is believed only if the archive says the same size; nothing is written to the disk, so that an entry's name
is a name and no path.
"""

import math
import re
import zipfile
from typing import IO, BinaryIO, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import MOST_BYTES, NUMBERS, TEXT, Array, Arrays, with_notes
from hysim.files._table import Notes, UnreadableError, damaged, shown

_ENDING = ".npy"
_LONGEST_HEADER = 10_000  # bytes, as in NumPy
_TYPE = re.compile(r"'descr'\s*:\s*'([<>|=]?([biufcmMOSUV])(\d{0,9})(?:\[[^\]]*\])?)'")
_ORDER = re.compile(r"'fortran_order'\s*:\s*(True|False)")
_SHAPE = re.compile(r"'shape'\s*:\s*\(((?:\s*\d{1,19}L?\s*,?){0,32})\s*\)")
_KINDS = {
    "b": NUMBERS, "i": NUMBERS, "u": NUMBERS, "f": NUMBERS, "U": TEXT, "S": "bytes", "c": "complex numbers",
    "m": "time spans", "M": "dates", "O": "pickled objects", "V": "records",
}  # fmt: skip


class _Header(NamedTuple):
    kind: str
    dtype: np.dtype
    shape: tuple[int, ...]
    order: Literal["C", "F"]
    stop: int

    @property
    def data_bytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def npz(file: BinaryIO) -> Arrays:
    """The arrays of an archive.

    Raises
    ------
    ValueError
        If it is damaged, or not an archive of arrays.
    """
    with damaged("NPZ"):
        archive = zipfile.ZipFile(file)
        entries = [entry for entry in archive.infolist() if entry.filename.endswith(_ENDING)]
        if not entries:
            names = [entry.filename for entry in archive.infolist()]
            raise UnreadableError(
                f"the zip archive holds no array of NumPy but {shown(', '.join(names[:3]))}; save a workbook as CSV, "
                "and take the files out of an archive"
            )
        return with_notes([_entry(archive, entry) for entry in entries], "NPZ")


def npy(file: BinaryIO) -> Arrays:
    """The one array of a file.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    with damaged("NPY"):
        header = _header(file, "array")
        size = file.seek(0, 2) - header.stop

        def read() -> npt.NDArray[np.generic]:
            file.seek(header.stop)
            return _values(file, header)

        if header.kind == NUMBERS and size < header.data_bytes:
            raise UnreadableError(f"the file is cut: its array has {header.data_bytes:,} bytes, there are {size:,}")
        return Arrays([Array("array", header.shape, header.kind, header.dtype.itemsize, read)], Notes(), "NPY")


def _entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Array:
    label = entry.filename.removesuffix(_ENDING)
    if entry.flag_bits & 1:
        raise UnreadableError(f"array {shown(label)} is encrypted: save it without a password")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise UnreadableError(f"array {shown(label)} is compressed in another way than NumPy does: save it anew")
    with archive.open(entry) as file:
        header = _header(file, label)
    if header.kind == NUMBERS and header.stop + header.data_bytes != entry.file_size:
        raise UnreadableError(
            f"array {shown(label)} is damaged: its header says {header.data_bytes:,} bytes of numbers, the archive "
            f"{entry.file_size - header.stop:,}"
        )

    def read() -> npt.NDArray[np.generic] | str:
        with archive.open(entry) as file:
            file.read(header.stop)
            values = _values(file, header)
            if file.read(1):
                raise UnreadableError(f"array {shown(label)} is damaged: it is longer than it says")
        return str(values.flat[0]) if header.kind == TEXT else values

    kind = "several texts" if header.kind == TEXT and math.prod(header.shape) != 1 else header.kind
    return Array(label, header.shape, kind, header.dtype.itemsize, read)


def _header(file: IO[bytes], label: str) -> _Header:
    start = file.read(10)
    major = start[6] if len(start) == 10 and start.startswith(b"\x93NUMPY") else 0
    if major not in (1, 2, 3):
        raise UnreadableError(f"array {shown(label)} does not begin as an array of NumPy does")
    more = file.read(2) if major > 1 else b""
    length = int.from_bytes(start[8:] + more, "little")
    if length > _LONGEST_HEADER:
        raise UnreadableError(
            f"array {shown(label)} has a header of {length:,} bytes, at most {_LONGEST_HEADER:,} are read"
        )
    text = file.read(length).decode("utf-8" if major == 3 else "latin-1")
    of_type, order, shape = _TYPE.search(text), _ORDER.search(text), _SHAPE.search(text)
    if "'descr': [" in text:
        raise UnreadableError(f"array {shown(label)} has fields: save each as an array of its own")
    if of_type is None or order is None or shape is None:
        raise UnreadableError(f"array {shown(label)} has a header that cannot be read: {shown(text)}")
    return _Header(
        kind=_KINDS[of_type[2]],
        dtype=np.dtype(of_type[1]),
        shape=tuple(int(length) for length in re.findall(r"\d+", shape[1])),
        order="F" if order[1] == "True" else "C",
        stop=10 + len(more) + length,
    )


def _values(file: IO[bytes], header: _Header) -> npt.NDArray[np.generic]:
    if header.data_bytes > MOST_BYTES:
        raise UnreadableError(f"an array of {header.data_bytes:,} bytes is too large: at most {MOST_BYTES:,} are read")
    content = file.read(header.data_bytes)
    if len(content) != header.data_bytes:
        raise UnreadableError(f"the file is cut: an array has {header.data_bytes:,} bytes, there are {len(content):,}")
    if not content:
        return np.zeros(header.shape, header.dtype)
    return np.frombuffer(content, header.dtype).reshape(header.shape, order=header.order)
