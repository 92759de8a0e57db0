"""HDF5 files, and MAT files of version 7.3, which are such files.

Datasets are called by their path, ``group/displacement``. MATLAB's arrays lie there with their axes reversed, its
structs as groups and its text as numbers, as attributes say. Only what lies in the file itself is read: links to other
files, and datasets that are kept in them, are not followed. The library believes what a file says about its sizes, so
they are looked at before, and compressed chunks are opened here first: one that is longer than it should be would
otherwise take as much memory as it likes.
"""

import math
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim.files._arrays import MOST_BYTES, NOTES, NUMBERS, TEXT, Array, Arrays, with_notes
from hysim.files._hdf5_heaps import has_sound_heaps
from hysim.files._table import UnreadableError, damaged

_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000
_FILTERS = frozenset({_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF})
_CHECKSUM = 4  # bytes
_SLACK = 1024  # bytes by which a packed chunk may be longer than its content
_LONGEST_ATTRIBUTE = 10_000  # bytes
_WORDS = (8, 8)  # bytes of an address and a length
_KINDS = {"O": "references or texts", "V": "records", "S": "bytes", "c": "complex numbers"}


@contextmanager
def hdf5(file: BinaryIO, path: Path | None, *, matlab: bool) -> Iterator[Arrays]:
    """The datasets of an open file, which may have a path, as long as they are needed.

    Raises
    ------
    ValueError
        If it is damaged, or h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise UnreadableError("a file of HDF5 (MATLAB's -v7.3) needs h5py: pip install 'hysim[io]'") from None
    form = "MAT" if matlab else "HDF5"
    with ExitStack() as stack:
        with damaged(form):
            reader = _Reader(matlab, has_sound_heaps(file))
            root = stack.enter_context(h5py.File(file, "r") if path is None else h5py.File(path, "r", locking=False))
            reader = reader if root.id.get_create_plist().get_sizes() == _WORDS else _Reader(matlab, False)
            found = _datasets(h5py, root, "", set(), separator="." if matlab else "/")
            arrays = [reader.array(label, dataset) for label, dataset in found]
            said = {name: reader.attribute(root, name) for name in (*NOTES, "t_units")}
            table = with_notes(arrays, form, {name: value for name, value in said.items() if value is not None})
        yield table


def _datasets(h5py: Any, group: Any, path: str, seen: set[int], *, separator: str) -> Iterator[tuple[str, Any]]:
    """Paths and datasets below a group, in the order of their names, each group once."""
    address = h5py.h5o.get_info(group.id).addr
    if address in seen:
        return
    seen.add(address)
    for name in group:
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue  # MATLAB's own groups, and links
        below, item = path + name, group[name]
        if isinstance(item, h5py.Group):
            yield from _datasets(h5py, item, below + separator, seen, separator=separator)
        elif isinstance(item, h5py.Dataset) and item.shape is not None:
            yield below, item


class _Reader(NamedTuple):
    """Reads what is in a file, MATLAB's or another one; texts of variable length only where that is safe."""

    matlab: bool
    texts: bool

    def array(self, label: str, dataset: Any) -> Array:
        """What a dataset is."""
        shape = tuple(int(length) for length in (dataset.shape[::-1] if self.matlab else dataset.shape))
        if "MATLAB_empty" in dataset.attrs:
            shape = (0,)
        kind = self.kind(dataset, math.prod(shape))
        unit = self.attribute(dataset, "units")
        return Array(
            label=label,
            shape=shape,
            kind=kind if kind != TEXT or math.prod(shape) in (*shape, 0, 1) else "several texts",
            item_bytes=dataset.dtype.itemsize,
            read=partial(self.text if kind == TEXT else self.numbers, dataset, shape),
            unit=unit if isinstance(unit, str) else None,
        )

    def kind(self, dataset: Any, size: int) -> str:
        """What a dataset holds."""
        said = self.attribute(dataset, "MATLAB_class")
        if dataset.is_virtual or dataset.external:
            return "values that lie in another file"
        if "MATLAB_object_decode" in dataset.attrs or "MATLAB_sparse" in dataset.attrs:
            return "an object"
        if said == "cell":
            return "cells"
        if said == "char" or (size == 1 and self.is_text(dataset.dtype)):
            return TEXT
        return NUMBERS if dataset.dtype.kind in "biuf" else _KINDS.get(dataset.dtype.kind, "no numbers")

    def is_text(self, dtype: np.dtype) -> bool:
        """Whether it is that of texts which can be read."""
        import h5py

        found = h5py.check_string_dtype(dtype)
        return found is not None and (self.texts or found.length is not None)

    def attribute(self, item: Any, name: str) -> str | float | None:
        """A short text or a number that an attribute says."""
        if name not in item.attrs:
            return None
        found = item.attrs.get_id(name)
        is_number = found.dtype.kind in "iuf"
        if math.prod(found.shape) != 1 or found.dtype.itemsize > _LONGEST_ATTRIBUTE:
            return None
        if not is_number and not self.is_text(found.dtype):
            return None
        plain = np.asarray(item.attrs[name]).item()
        return float(plain) if is_number else plain.decode("utf-8", "replace") if isinstance(plain, bytes) else plain

    def numbers(self, dataset: Any, shape: tuple[int, ...]) -> npt.NDArray[np.generic]:
        """The numbers of a dataset."""
        if not math.prod(shape):
            return np.empty(shape)
        _check_chunks(dataset)
        values: npt.NDArray[np.generic] = np.asarray(dataset[()])
        return values.T if self.matlab else values

    def text(self, dataset: Any, shape: tuple[int, ...]) -> str:
        """The text of a dataset."""
        if not math.prod(shape):
            return ""
        _check_chunks(dataset)
        values = np.asarray(dataset[()]).reshape(-1)
        if values.dtype.kind in "iu":  # as MATLAB has it
            return values.astype("u2").tobytes().decode("utf-16", "replace")
        return values[0].decode("utf-8", "replace") if isinstance(values[0], bytes) else str(values[0])


def _check_chunks(dataset: Any) -> None:
    """Refuse chunks that are not as long as the dataset says, or packed in a way that cannot be looked into."""
    if dataset.chunks is None:
        return
    plan = dataset.id.get_create_plist()
    filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
    after = filters[filters.index(_DEFLATE) + 1 :] if _DEFLATE in filters else []
    if not _FILTERS.issuperset(filters) or not {_FLETCHER32}.issuperset(after):
        raise UnreadableError(f"its chunks are packed by the filters {filters}: rewrite the file with gzip compression")
    plain = math.prod(dataset.chunks) * dataset.dtype.itemsize
    if plain > MOST_BYTES:
        raise UnreadableError(f"a chunk of {plain:,} bytes is too large: at most {MOST_BYTES:,} are read")
    stored: list[Any] = []
    dataset.id.chunk_iter(stored.append)
    for chunk in stored:
        used = [number for k, number in enumerate(filters) if not chunk.filter_mask >> k & 1]
        if not _is_sound(dataset, chunk, plain, plain + _CHECKSUM * used.count(_FLETCHER32), used):
            raise UnreadableError(f"the file is damaged: a chunk does not have the {plain:,} bytes it says")


def _is_sound(dataset: Any, chunk: Any, least: int, most: int, filters: list[int]) -> bool:
    """Whether a chunk has a length in these bounds, unpacked."""
    if _LZF in filters or _DEFLATE in filters:
        if not 0 < chunk.size <= 2 * most + _SLACK:
            return False
        if _LZF in filters:
            return True
        stream = zlib.decompressobj()
        content = stream.decompress(dataset.id.read_direct_chunk(chunk.chunk_offset)[1], most + 1)
        return stream.eof and least <= len(content) <= most
    return bool(least <= chunk.size <= most)
