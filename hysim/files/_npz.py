"""NumPy's files: an array (NPY), or a zip archive of arrays (NPZ).

NumPy reads the headers. Their sizes are compared with that of the archive's entry or the file before the numbers are
read. An array of objects is never read: it is a pickle, which could run any code. Nothing is written to the disk: the
name of an entry is not used as a path.
"""

import math
import warnings
import zipfile
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from io import BytesIO
from typing import IO, BinaryIO, Literal

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import KINDS, NUMBERS, TEXT, Array, Arrays, with_notes
from hysim.files._table import UnreadableError, damaged, require, shown

_ENDING = ".npy"
_LONGEST_HEADER = 10_000  # bytes, as in NumPy
_HEADER_READERS = {
    1: np.lib.format.read_array_header_1_0,
    2: np.lib.format.read_array_header_2_0,
    3: np.lib.format.read_array_header_2_0,  # differs from 2 in the letters of field names only
}

_Opener = Callable[[], AbstractContextManager[IO[bytes]]]


def npz(file: BinaryIO) -> Arrays:
    """The arrays of an archive; ValueError if it is damaged, or not an archive of arrays."""
    with damaged("NPZ"):
        archive = zipfile.ZipFile(file)
        entries = [entry for entry in archive.infolist() if entry.filename.endswith(_ENDING)]
        names = shown(", ".join(archive.namelist()[:3]))
        require(
            entries,
            f"the zip archive holds no array of NumPy but {names}; save a workbook as CSV, and take the files out of "
            "an archive",
        )
        return with_notes([_entry(archive, entry) for entry in entries], "NPZ")


def npy(file: BinaryIO) -> Arrays:
    """The one array of a file; ValueError if it is damaged."""
    with damaged("NPY"):
        array, length, rest = _array("array", partial(_rewound, file), file.seek(0, 2))
        is_complete = array.kind != NUMBERS or length <= rest
        require(is_complete, f"the file is cut: its array has {length:,} bytes, there are {rest:,}")
        return with_notes([array], "NPY")


def _entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Array:
    label = entry.filename.removesuffix(_ENDING)
    require(not entry.flag_bits & 1, f"array {shown(label)} is encrypted: save it without a password")
    is_known = entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # unpacked piece by piece
    require(is_known, f"array {shown(label)} is compressed in another way than NumPy does: save it anew")
    array, length, rest = _array(label, partial(archive.open, entry), entry.file_size)
    require(
        array.kind != NUMBERS or length == rest,
        f"array {shown(label)} is damaged: its header says {length:,} bytes of numbers, the archive {rest:,}",
    )
    return array


def _array(label: str, opener: _Opener, size: int) -> tuple[Array, int, int]:
    """The array in a file of this size, the bytes that its header promises, and those behind the header."""
    with opener() as file:
        header = BytesIO(file.read(_LONGEST_HEADER))
    shape, order, dtype = _layout(header, shown(label))
    start, length = header.tell(), math.prod(shape) * dtype.itemsize
    kind = "several texts" if dtype.kind == "U" and math.prod(shape) != 1 else KINDS.get(dtype.kind, "no numbers")

    def read() -> npt.NDArray[np.generic] | str:
        with opener() as file:
            content = file.read(start + length)
        values: npt.NDArray[np.generic] = np.ndarray(shape, dtype, content, start, order=order)
        return str(values.flat[0]) if kind == TEXT else values

    return Array(label, shape, kind, dtype.itemsize, read), length, size - start


def _layout(header: BytesIO, label: str) -> tuple[tuple[int, ...], Literal["C", "F"], np.dtype]:
    """Shape, order and type of an array whose file begins so; the header is read to its end."""
    major, _ = np.lib.format.read_magic(header)
    length = int.from_bytes(header.getvalue()[8 : 10 if major == 1 else 12], "little")
    is_short = length <= _LONGEST_HEADER
    require(is_short, f"array {label} has a header of {length:,} bytes, at most {_LONGEST_HEADER:,} are read")
    try:
        with warnings.catch_warnings(action="ignore"):  # about headers that Python 2 wrote
            shape, is_fortran, dtype = _HEADER_READERS[major](header, max_header_size=_LONGEST_HEADER)
    except Exception as error:  # NumPy raises errors of many kinds
        reason = shown(f"{type(error).__name__} {error}", 80)
        raise UnreadableError(f"array {label} has a header that cannot be read: {reason}") from None
    require(dtype.names is None, f"array {label} has fields: save each as an array of its own")
    require(min(shape, default=0) >= 0, f"array {label} is damaged: it has a negative length")
    return shape, "F" if is_fortran else "C", dtype


def _rewound(file: BinaryIO) -> AbstractContextManager[IO[bytes]]:
    file.seek(0)
    return nullcontext(file)
