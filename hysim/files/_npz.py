"""NumPy's files: an array (NPY), or a zip archive of arrays (NPZ).

NumPy reads the headers and the numbers, and never a pickle, which could run any code. It reserves as much memory as a
header asks for, so a header is believed only if the archive or the file says the same size. Nothing is written to the
disk: the name of an entry is a name and no path.
"""

import math
import warnings
import zipfile
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from io import BytesIO
from typing import IO, BinaryIO

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
    """The arrays of an archive.

    Raises
    ------
    ValueError
        If it is damaged, or not an archive of arrays.
    """
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
    """The one array of a file.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    with damaged("NPY"):
        array, length, rest = _array("array", partial(nullcontext, file), file.seek(0, 2))
        require(
            array.kind != NUMBERS or length <= rest,
            f"the file is cut: its array has {length:,} bytes, there are {rest:,}",
        )
        return with_notes([array], "NPY")


def _entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Array:
    label = entry.filename.removesuffix(_ENDING)
    is_known = entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # which are unpacked bit by bit
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
        file.seek(0)
        header = BytesIO(file.read(_LONGEST_HEADER))
    shape, dtype = _shape_and_type(header, shown(label))
    kind = "several texts" if dtype.kind == "U" and math.prod(shape) != 1 else KINDS.get(dtype.kind, "no numbers")
    array = Array(label, shape, kind, dtype.itemsize, partial(_values, opener, kind))
    return array, math.prod(shape) * dtype.itemsize, size - header.tell()


def _shape_and_type(header: BytesIO, label: str) -> tuple[tuple[int, ...], np.dtype]:
    major, _ = np.lib.format.read_magic(header)
    length = int.from_bytes(header.getvalue()[8 : 10 if major == 1 else 12], "little")
    require(
        length <= _LONGEST_HEADER,
        f"array {label} has a header of {length:,} bytes, at most {_LONGEST_HEADER:,} are read",
    )
    try:
        with warnings.catch_warnings(action="ignore"):  # about headers that Python 2 wrote
            shape, _, dtype = _HEADER_READERS[major](header, max_header_size=_LONGEST_HEADER)
    except Exception as error:  # NumPy raises errors of many kinds
        reason = shown(f"{type(error).__name__} {error}", 80)
        raise UnreadableError(f"array {label} has a header that cannot be read: {reason}") from None
    require(dtype.names is None, f"array {label} has fields: save each as an array of its own")
    require(min(shape, default=0) >= 0, f"array {label} is damaged: it has a negative length")
    return shape, dtype


def _values(opener: _Opener, kind: str) -> npt.NDArray[np.generic] | str:
    with opener() as file, warnings.catch_warnings(action="ignore"):
        file.seek(0)
        values = np.lib.format.read_array(file, allow_pickle=False, max_header_size=_LONGEST_HEADER)
    return str(values.flat[0]) if kind == TEXT else values
