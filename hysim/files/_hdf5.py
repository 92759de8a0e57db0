"""HDF5 files, and MAT files of version 7.3, which are such files.

Datasets are named by their path, ``group/displacement``. MATLAB stores arrays with axes reversed, structs as groups,
text as numbers, marked by attributes. Links to other files, and datasets with values there, are not followed.

h5py reads the file. Three things that its library does not check are checked before: sizes; compressed chunks, which
may unpack into any amount of memory; and heaps, which hold texts of variable length. A heap is ``GCOL``, a version, its
length, and objects one behind the other, each with a number, which is 0 for free space, a count, and a length. At an
object of length zero the library loops for ever, and no signal stops it (HDF5 2.0).

Source of the heaps: The HDF Group, HDF5 File Format Specification, Version 3.0, III.E.
"""

import math
import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.libraries import optional
from hysim.files._arrays import KINDS, MOST_BYTES, NOTES, TEXT, UNITS, Array, Arrays, with_notes
from hysim.files._table import UnreadableError, damaged, notes_in, require

MOST_SEARCHED = 500_000_000
"""Most bytes of a file whose heaps are looked for; in longer ones texts of variable length are left unread."""

_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000
_CHECKSUM = 4  # bytes
_SLACK = 1024  # bytes by which a packed chunk may be longer than its content
_LONGEST_ATTRIBUTE = 10_000  # bytes
_WORDS = (8, 8)  # bytes of an address and a length
_HEAD_BYTES, _LEAST_HEAP = 16, 4096  # bytes: head of a heap or an object, smallest heap


@contextmanager
def hdf5(file: BinaryIO, path: Path | None, *, matlab: bool) -> Iterator[Arrays]:
    """The datasets of an open file, which may have a path; ValueError if it is damaged, or h5py is not installed."""
    h5py = optional("h5py", "a file of HDF5 (MATLAB's -v7.3)", "io", UnreadableError)
    form = "MAT" if matlab else "HDF5"
    with ExitStack() as stack:
        with damaged(form):
            texts = _has_sound_heaps(file)
            root = stack.enter_context(h5py.File(file, "r") if path is None else h5py.File(path, "r", locking=False))
            reader = _Reader(h5py, matlab, texts and root.id.get_create_plist().get_sizes() == _WORDS)
            arrays = [reader.array(label, dataset) for label, dataset in reader.datasets(root)]
            notes = {name: reader.attribute(root, name) for name in (*NOTES, f"t{UNITS}")}
            units = (f"{name}{UNITS}" for name in notes_in(notes, {}).channels)
            notes |= {name: reader.attribute(root, name) for name in units}
            table = with_notes(arrays, form, {name: value for name, value in notes.items() if value is not None})
        yield table


class _Reader(NamedTuple):
    """Reader of the datasets of a file; texts of variable length are read only if `texts` is true."""

    h5py: Any
    matlab: bool
    texts: bool

    def datasets(self, root: Any) -> Iterator[tuple[str, Any]]:
        """Paths and datasets, in the order of their names, each once; links and MATLAB's own groups are left out."""
        items: list[tuple[str, Any]] = []
        root.visititems(lambda path, item: items.append((path, item)))
        for path, item in items:
            if isinstance(item, self.h5py.Dataset) and item.shape is not None and "/#" not in f"/{path}":
                yield path.replace("/", ".") if self.matlab else path, item

    def array(self, label: str, dataset: Any) -> Array:
        shape = tuple(map(int, dataset.shape[::-1] if self.matlab else dataset.shape))
        shape = (0,) if "MATLAB_empty" in dataset.attrs else shape
        kind, unit = self.kind(dataset, shape), self.attribute(dataset, "units")
        read = partial(self.values, dataset, shape, kind)
        return Array(label, shape, kind, dataset.dtype.itemsize, read, unit if isinstance(unit, str) else None)

    def kind(self, dataset: Any, shape: tuple[int, ...]) -> str:
        matlab_class, size = self.attribute(dataset, "MATLAB_class"), math.prod(shape)
        if dataset.is_virtual or dataset.external:
            return "values that lie in another file"
        if matlab_class == "cell" or {"MATLAB_object_decode", "MATLAB_sparse"} & {*dataset.attrs}:
            return "cells or an object"
        if matlab_class == "char" or (size == 1 and self.is_text(dataset.dtype)):
            return TEXT if size in (*shape, 0, 1) else "several texts"
        return "references or texts" if dataset.dtype.kind == "O" else KINDS.get(dataset.dtype.kind, "no numbers")

    def is_text(self, dtype: np.dtype) -> bool:
        text = self.h5py.check_string_dtype(dtype)
        return text is not None and (self.texts or text.length is not None)

    def attribute(self, item: Any, name: str) -> str | float | None:
        if name not in item.attrs:
            return None
        shape, dtype = item.attrs.get_id(name).shape, item.attrs.get_id(name).dtype
        is_number = dtype.kind in "iuf"
        is_short = math.prod(shape) == 1 and dtype.itemsize <= _LONGEST_ATTRIBUTE
        if not is_short or not (is_number or self.is_text(dtype)):
            return None
        plain = np.asarray(item.attrs[name]).item()
        return float(plain) if is_number else _decoded(plain)

    def values(self, dataset: Any, shape: tuple[int, ...], kind: str) -> npt.NDArray[Any] | str:
        if not math.prod(shape):
            return "" if kind == TEXT else np.empty(shape)
        _check_chunks(dataset)
        values: npt.NDArray[Any] = np.asarray(dataset[()])
        if kind != TEXT:
            return values.T if self.matlab else values
        if values.dtype.kind in "iu":  # as MATLAB has it
            return values.astype("u2").tobytes().decode("utf-16", "replace")
        return _decoded(values.flat[0])


def _decoded(text: Any) -> str:
    return text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)


def _check_chunks(dataset: Any) -> None:
    """Refuse chunks that are not as long as the dataset says, or packed in a way that cannot be looked into."""
    if dataset.chunks is None:
        return
    plan, stored = dataset.id.get_create_plist(), list[Any]()
    filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
    is_known = {_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF}.issuperset(filters)
    require(is_known, f"its chunks are packed by the filters {filters}: rewrite the file with gzip compression")
    plain = math.prod(dataset.chunks) * dataset.dtype.itemsize
    require(plain <= MOST_BYTES, f"a chunk of {plain:,} bytes is too large: at most {MOST_BYTES:,} are read")
    dataset.id.chunk_iter(stored.append)
    for chunk in stored:
        applied = [number for k, number in enumerate(filters) if not chunk.filter_mask >> k & 1]
        length = chunk.size if chunk.size <= 2 * plain + _SLACK else 0
        if length and _DEFLATE in applied:
            packed = dataset.id.read_direct_chunk(chunk.chunk_offset)[1]
            length = len(zlib.decompressobj().decompress(packed, plain + _CHECKSUM + 1))
        elif length and _LZF in applied:  # which unpacks to less than 100 times its length
            length = plain
        is_sound = plain <= length <= plain + _CHECKSUM
        require(is_sound, f"the file is damaged: a chunk does not have the {plain:,} bytes it says")


def _has_sound_heaps(file: BinaryIO) -> bool:
    """Whether the heaps of an open file are sound; False if it is too long to search, ValueError if one is damaged."""
    if file.seek(0, 2) > MOST_SEARCHED:
        return False
    if isinstance(file, BytesIO):
        _check_heaps(file.getvalue())
    else:
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            _check_heaps(content)
    return True


def _check_heaps(content: bytes | mmap.mmap) -> None:
    start, total = -1, 0
    while (start := content.find(b"GCOL\x01", start + 1)) >= 0:
        (length,), at = struct.unpack_from("<Q", content, start + 8), start + _HEAD_BYTES
        end = start + length if _LEAST_HEAP <= length <= len(content) - start else at
        total += end - at
        require(total <= len(content), "the HDF5 file is damaged: its heaps overlap")
        while at + _HEAD_BYTES <= end:
            number, length = struct.unpack_from("<H6xQ", content, at)
            step = length + -length % 8 + (_HEAD_BYTES if number else 0)
            is_inside = 0 < step <= end - at
            require(is_inside, "the HDF5 file is damaged: a text in it has no length, or too great a one")
            at += step
