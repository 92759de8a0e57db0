"""Damaged files of every format that is loaded, as pure functions of a seed."""

import io
import random
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec

import numpy as np
from scipy.io import savemat

HAS_H5PY = find_spec("h5py") is not None
U, Y = np.array([0.0, 1.0, 2.0, 1.0, 0.0]), np.array([0.0, 0.5, 1.5, 1.0, 0.25])
WORDS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 10**12, 2**63 - 1, 2**64 - 1)


def corrupt(seed: int) -> tuple[str, bytes]:
    """A file's name and content: one that is whole, or two, with some of it changed, or nothing but random bytes."""
    rng = random.Random(seed)
    form = rng.choice(sorted(whole()))
    content = whole()[form]
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice(CHANGES)(content, rng)
    if form in REPACKED:  # what is inside was changed, and its envelope is right
        content = REPACKED[form](content)
    return f"damaged-{seed}.{form.split('-')[0]}", content


@cache
def whole() -> dict[str, bytes]:
    """A whole file of each form, or for some what is inside its envelope."""
    forms = {
        "csv": b"# name: \"a\"\n# resolution: 0.5\nt [s],u [V],y [um]\n0,0,0.0\n1,1,0.5\n2,2,1.5\n3,1,1.0\n",
        "tsv": b"u\ty\n0,0\t1,0\n0,5\t2,0\n10,0\t-0,25\n",
        "csv-utf16": "u;y\n0;1\n2;3\n4;5\n".encode("utf-16"),
        "csv-quoted": b'"u (V)","y (um)"\n"0","1"\n"2","nan"\n"3","4"\n',
        "npz": npz({"u": U, "y": Y, "u_units": np.array("V"), "resolution": np.array(0.25)}),
        "npz-deflated": npz({"u": U, "y": Y, "x": np.zeros((5, 3))}, zipfile.ZIP_DEFLATED),
        "npz-inside": npy(U),
        "npy": npy(np.column_stack([U, Y])),
        "mat": mat({"u": U, "y": Y, "rec": {"u": U, "name": "loop", "deep": {"y": Y}}}),
        "mat-compressed": mat({"u": U, "y": Y, "u_units": "V", "rec": {"u": U}}, do_compression=True),
        "mat-inside": mat({"u": {"v": U, "w": "text"}})[128:],
    }  # fmt: skip
    return forms | (_hdf5_forms() if HAS_H5PY else {})


def npy(values: np.ndarray, **options: bool) -> bytes:
    """An array as NumPy saves it."""
    buffer = io.BytesIO()
    np.save(buffer, values, **options)
    return buffer.getvalue()


def npz(arrays: dict[str, np.ndarray | bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    """An archive of arrays, or of what stands in their place."""
    contents = {
        name: each if isinstance(each, bytes) else npy(each, allow_pickle=True) for name, each in arrays.items()
    }
    return archive({f"{name}.npy": content for name, content in contents.items()}, compression)


def mat(variables: dict[str, object], **options: object) -> bytes:
    """Variables as SciPy saves them, always the same bytes."""
    buffer = io.BytesIO()
    savemat(buffer, variables, oned_as="column", **options)
    return MAT_TITLE + buffer.getvalue()[116:]


def hdf5(fill: Callable[[object], None], userblock: bytes = b"") -> bytes:
    """An HDF5 file that `fill` has filled, behind a block of 512 bytes if some are given."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512 if userblock else 0) as file:
        fill(file)
    content = buffer.getvalue()
    return userblock.ljust(512, b"\0") + content[512:] if userblock else content


MAT_TITLE = b"MATLAB 5.0 MAT-file".ljust(116)
MAT73_TITLE = b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM"


def _hdf5_forms() -> dict[str, bytes]:
    def plain(file: object) -> None:
        file["u"], file["group/y"] = U, Y
        file["u"].attrs["units"] = "V"
        file.attrs["name"] = "loop"

    def chunked(file: object) -> None:
        options = {"chunks": (3,), "compression": "gzip", "shuffle": True, "fletcher32": True}
        for name, values in (("u", U), ("y", Y)):
            file.create_dataset(name, data=values, **options)

    def matlab(file: object) -> None:
        for name, values in (("u", U), ("rec/y", Y)):
            file[name] = values[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["u_units"] = np.array([[86]], dtype="u2")
        file["u_units"].attrs["MATLAB_class"] = np.bytes_("char")

    return {"h5": hdf5(plain), "h5-chunked": hdf5(chunked), "mat-7.3": hdf5(matlab, MAT73_TITLE)}


def _flip(content: bytes, rng: random.Random) -> bytes:
    changed = bytearray(content or b"\0")
    for _ in range(rng.choice((1, 2, 8))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _number(content: bytes, rng: random.Random) -> bytes:
    word = struct.pack("<Q", rng.choice(WORDS))[: rng.choice((1, 2, 4, 8))]
    at = rng.randrange(len(content) + 1)
    return content[:at] + word + content[at + len(word) :]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _drop(content: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[:at] + content[at + rng.choice((1, 8, 64)) :]


def _double(content: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    return content[: at + rng.choice((1, 8, 64))] + content[at:]


def _insert(content: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    word = rng.choice((b"\0", b"\n", b",", b'"', b"nan", b"-inf", b"1e999", b"#", b"\xff"))
    return content[:at] + word + content[at:]


def _join(content: bytes, rng: random.Random) -> bytes:
    other = whole()[rng.choice(sorted(whole()))]
    at = rng.randrange(min(len(content), len(other)) + 1)
    return content[:at] + other[at:]


def _random(content: bytes, rng: random.Random) -> bytes:
    kept = rng.choice((0, 0, 8, 128, 520))
    return content[:kept] + rng.randbytes(rng.randrange(300))


CHANGES = (_flip, _flip, _number, _number, _cut, _drop, _double, _insert, _join, _random)


def _in_archive(content: bytes) -> bytes:
    return npz({"u": content, "y": Y})


def _in_element(content: bytes) -> bytes:
    return _element(zlib.compress(content))


REPACKED = {"npz-inside": _in_archive, "mat-inside": _in_element}


def corpus() -> dict[str, tuple[bytes, str]]:
    """Files that are no record, each with what its error says, by names whose endings are their formats."""
    long, most, y = bytes(50_000), 3 * 10**9, mat({"y": Y})[128:]
    files = {
        "empty.csv": (b"", "the file is empty"),
        "image.csv": (b"\x89PNG\r\n\x1a\n\xff", "is not a UTF-8 text file"),
        "old.mat": (struct.pack("<5I", 0, 9, 1, 0, 2) + b"u\0" + U.tobytes() + b"\xff", "does not begin as NPZ"),
        "zeros.csv": (b"u,y\n0,\0\n", "is not a text file: it holds zero bytes"),
        "mixed.csv": (b"u,y\n0,1\n2;3\n4\t5\n6 7\n", r"line \d: expected \d cells, got \d"),
        "nan.csv": (b"u,y\n0,1\nnan,3\n", "line 3, column 'u': the value is missing"),
        "infinite.csv": (b"u,y\n0,1\n2,Infinity\n", "line 3, column 'y': expected a finite number, got 'Infinity'"),
        "text.csv": (b"u,y\n0,1\n2,three\n", "line 3, column 'y': expected a finite number, got 'three'"),
        "twice.csv": (b"u,y,u\n0,1,2\n3,4,5\n", "2 columns are called 'u': choose one of the numbers 0, 2"),
        "one-row.csv": (b"u,y\n0,1\n", "at least 2 samples, there are 1"),
        "latin.csv": ("u [\u00b5m],y\n0,1\n2,3\n".encode("latin-1"), "pass its encoding"),
        "half.csv": ("u,y\n0,1\n2,3\n".encode("utf-16")[:-1], "is not a UTF-16 text file"),
        "long-cell.csv": (b'u,y\n"' + b"1" * 200_000 + b'",1\n2,3\n', "a quoted cell is not closed or too long"),
        "back.csv": (b"t,u,y\n0,0,0\n2,1,1\n1,2,2\n", "line 4: time must increase, got 1.0 after 2.0"),
        "empty.npz": (npz({}), "the zip archive holds no array of NumPy"),
        "workbook.npz": (archive({"xl/workbook.xml": b"<a/>"}), "holds no array of NumPy but 'xl/workbook.xml'"),
        "cut.npz": (npz({"u": U, "y": Y})[:300], "the NPZ file is damaged"),
        "pickled.npz": (npz({"u": np.array([None, 1]), "y": Y}), "array 'u' holds pickled objects"),
        "complex.npz": (npz({"u": 1j * U, "y": Y}), "array 'u' holds complex numbers"),
        "dates.npz": (npz({"u": U.astype("M8[s]"), "y": Y}), "array 'u' holds dates"),
        "texts.npz": (npz({"u": U.astype(str), "y": Y}), "array 'u' holds several texts"),
        "fields.npz": (npz({"u": np.zeros(3, "f8,f8"), "y": Y}), "array 'u' has fields"),
        "cube.npz": (npz({"u": np.zeros((5, 2, 2)), "y": Y}), r"name one of its columns, such as 'u\[0,0\]'"),
        "unequal.npz": (npz({"u": U[:3], "y": Y}), "unequal numbers of samples: 'u' 3, 'y' 5"),
        "gap.npz": (npz({"u": U, "y": np.where(U == 2, np.nan, Y)}), "sample 2, column 'y': the value is missing"),
        "infinite.npz": (npz({"u": U, "y": np.where(U == 2, np.inf, Y)}), "sample 2, column 'y': .* got inf"),
        "one-row.npz": (npz({"u": U[:1], "y": Y[:1]}), "at least 2 samples, there are 1"),
        "none.npz": (npz({"u": U[:0], "y": Y[:0]}), "at least 2 samples, there are 0"),
        "other.npz": (npz({"voltage": U, "y": Y}), r"no array 'u', the arrays are: 0: voltage \(5\), 1: y \(5\); pass"),
        "path.npz": (npz({"../../u": U, "/etc/y": Y}), r"the arrays are: 0: \.\./\.\./u \(5\), 1: /etc/y"),
        "lines.npz": (npz({"a\nb\x1b[31m": U}), r"0: 'a\\nb\\x1b\[31m' \(5\)"),
        "bomb.npz": (npz({"u": lying(most // 8, long), "y": Y}, zipfile.ZIP_DEFLATED), "its header says 3,000,000,000"),
        "huge.npz": (_claimed(10**12), r"array 'u' is too large: it says it has 1,000,000,000,000 numbers"),
        "long.npz": (_claimed(5, declared=168, actual=long), "the NPZ file is damaged"),
        "bzip.npz": (npz({"u": U, "y": Y}, zipfile.ZIP_BZIP2), "array 'u' is encrypted or packed in another way"),
        "header.npz": (
            npz({"u": b"\x93NUMPY\2\0\0\0\0\x10", "y": Y}),
            "the NPZ file is damaged: .*reading array header",
        ),
        "code.npz": (
            npz({"u": lying(0, b"", "__import__('os').abort()"), "y": Y}),
            "the NPZ file is damaged: .*malformed",
        ),
        "twice.npz": (archive({"u.npy": npy(U), "y.npy": npy(Y)}, twice=True), "2 arrays are called 'u'"),
        "array.npy": (npy(np.zeros((9, 2))), "one array, array .9 x 2.: choose its columns by the numbers 0 to 1"),
        "objects.npy": (npy(np.array([None, 1]), allow_pickle=True), "no array 'u', the arrays are: 0: array .pickled"),
        "cut.npy": (npy(U)[:-3], "the file is cut: its array has 40 bytes, there are 37"),
        "empty.mat": (MAT_TITLE, "the MAT file is cut: its header is incomplete"),
        "none.mat": (mat({}), "the file holds no array"),
        "cut.mat": (mat({"u": U, "y": Y})[:-9], "the MAT file is cut: a variable has"),
        "cells.mat": (mat({"u": np.array([U, 1], object), "y": Y}), "array 'u' holds cells"),
        "sparse.mat": (_sparse(), "array 'u' holds a sparse matrix"),
        "complex.mat": (mat({"u": 1j * U, "y": Y}), "array 'u' holds complex numbers"),
        "structs.mat": (mat({"u": np.zeros(3, [("a", "f8")]), "y": Y}), "array 'u' holds several structs"),
        "matrix.mat": (mat({"x": np.zeros((9, 3))}), "one array, x .9 x 3.: choose its columns by the numbers 0"),
        "bomb.mat": (_element(zlib.compress(_matrix((most // 8, 1)) + long)) + y, "array 'u' is too large"),
        "long.mat": (_element(zlib.compress(_matrix((5, 1)) + long)) + y, "the MAT file is damaged"),
        "short.mat": (_element(zlib.compress(_matrix((9, 1), 200_000))) + y, "has 200,000 bytes for 9 values"),
        "deep.mat": (_deep(100_000), "array 'u' holds cells"),
        "checksum.mat": (_element(zlib.compress(_matrix((5, 1)) + bytes(40))[:-4] + b"1234") + y, "is damaged"),
    }  # fmt: skip
    return files | (_hdf5_corpus() if HAS_H5PY else {})


def archive(entries: dict[str, bytes], compression: int = zipfile.ZIP_STORED, *, twice: bool = False) -> bytes:
    """A zip archive, with its first entry in it once more if asked."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as file:
        for name, content in entries.items():
            file.writestr(zipfile.ZipInfo(name), content, compression)
    if not twice:
        return buffer.getvalue()
    first, second = entries
    assert len(first) == len(second)
    return buffer.getvalue().replace(second.encode(), first.encode())


def lying(length: int, content: bytes, shape: str = "") -> bytes:
    """An array that says it has so many numbers."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape or length},), }}\n".encode()
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + content


def _claimed(length: int, declared: int | None = None, actual: bytes = b"") -> bytes:
    """An archive whose directory agrees with the header of an array of so many numbers, or says a size of its own."""
    entry = lying(length, actual)
    whole_size = len(lying(length, b"")) + 8 * length if declared is None else declared
    info = zipfile.ZipInfo("u.npy")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(info, entry, zipfile.ZIP_DEFLATED)
        file.writestr("y.npy", npy(Y))
        info.file_size = whole_size
    return buffer.getvalue()


def _matrix(shape: tuple[int, ...], length: int | None = None) -> bytes:
    """The beginning of a variable u of this shape, up to its numbers, of which there are none."""
    size = 8 * shape[0] * shape[1]
    head = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, *shape) + struct.pack("<HHI", 1, 1, ord("u"))
    numbers = struct.pack("<II", 9, size)
    return struct.pack("<II", 14, length or len(head + numbers) + size) + head + numbers


def _element(packed: bytes) -> bytes:
    return MAT_TITLE + bytes(8) + struct.pack("<HHII", 0x0100, 0x4D49, 15, len(packed)) + packed


def _deep(levels: int) -> bytes:
    """A cell in a cell in a cell."""
    cell = struct.pack("<IIIIIIIIiiHHI", 14, 2**20, 6, 8, 1, 0, 5, 8, 1, 1, 1, 1, ord("u"))
    content = levels * cell
    return MAT_TITLE + bytes(8) + struct.pack("<HHII", 0x0100, 0x4D49, 14, len(content) - 8) + content[8:]


def _sparse() -> bytes:
    from scipy.sparse import csc_array

    return mat({"u": csc_array(np.eye(3)), "y": Y})


def _hdf5_corpus() -> dict[str, tuple[bytes, str]]:
    import h5py

    def declares(file: object) -> None:
        file.create_dataset("u", shape=(10**12,), chunks=(100,), dtype="f8")
        file["y"] = Y

    def chunk(file: object) -> None:
        file.create_dataset("u", shape=(9,), maxshape=(None,), chunks=(5 * 10**8,), dtype="f8")
        file["y"] = np.zeros(9)

    def bomb(file: object) -> None:
        file.create_dataset("u", shape=(5,), chunks=(5,), dtype="f8", compression="gzip")
        file["u"].id.write_direct_chunk((0,), zlib.compress(bytes(10**6)))
        file["y"] = Y

    def stored(file: object) -> None:
        file.create_dataset("u", shape=(5,), chunks=(5,), dtype="f8", compression="lzf")
        file["u"].id.write_direct_chunk((0,), bytes(10**5))
        file["y"] = Y

    def elsewhere(file: object) -> None:
        file.create_dataset("u", shape=(5,), dtype="f8", external=[("/etc/hostname", 0, 40)])
        layout = h5py.VirtualLayout((5,), "f8")
        layout[:] = h5py.VirtualSource("/etc/hostname", "y", (5,))
        file.create_virtual_dataset("y", layout)
        file["t"] = h5py.ExternalLink("/etc/hostname", "t")

    def kinds(file: object) -> None:
        file["u"], file["y"] = 1j * U, ["a", "b"]

    def unequal(file: object) -> None:
        file["u"], file["y"] = U, Y[:3]

    plain = whole()["h5"]
    size = plain.index(b"GCOL") + 48  # of the free space behind the one text
    return {
        "heap.h5": (plain[:size] + bytes(8) + plain[size + 8 :], "a text in it has no length"),
        "cut.h5": (plain[:700], "the HDF5 file is damaged"),
        "none.h5": (hdf5(lambda file: None), "the file holds no array"),
        "group.h5": (plain, r"no array 'y', the arrays are: 0: group/y \(5\), 1: u \(5\)"),
        "huge.h5": (hdf5(declares), "array 'u' is too large: it says it has 1,000,000,000,000 numbers"),
        "chunk.h5": (hdf5(chunk), "a chunk of 4,000,000,000 bytes is too large"),
        "bomb.h5": (hdf5(bomb), "a chunk does not have the 40 bytes it says"),
        "stored.h5": (hdf5(stored), "a chunk does not have the 40 bytes it says"),
        "elsewhere.h5": (hdf5(elsewhere), "array 'u' holds values that lie in another file"),
        "kinds.h5": (hdf5(kinds), "array 'u' holds complex numbers"),
        "unequal.h5": (hdf5(unequal), "unequal numbers of samples: 'u' 5, 'y' 3"),
        "cut-7.3.mat": (whole()["mat-7.3"][:900], "the MAT file is damaged"),
    }
