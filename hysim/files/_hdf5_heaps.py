"""The heaps in which HDF5 keeps texts of variable length.

A heap is ``GCOL``, a version, its length, and objects one behind the other: a number, which is 0 for free space, a
count, and a length. The library walks through them to its end and does not see that an object without a length leads
nowhere: on such a heap it walks for ever, and nothing stops it. So every heap is walked through here before.

Source: The HDF Group, HDF5 File Format Specification, Version 3.0, III.E.
"""

import mmap
from io import BytesIO
from typing import BinaryIO

from hysim.files._table import UnreadableError

MOST_SEARCHED = 500_000_000
"""Most bytes of a file whose heaps are looked for; in longer ones texts of variable length are left unread."""

_BEGINNING = b"GCOL\x01"
_HEAD_BYTES = 16  # of a heap and of an object
_LEAST_BYTES = 4096  # of a heap


def has_sound_heaps(file: BinaryIO) -> bool:
    """Whether the heaps of an open file can be walked through; False if it is too long to look for them.

    Raises
    ------
    ValueError
        If one of them leads nowhere.
    """
    if file.seek(0, 2) > MOST_SEARCHED:
        return False
    if isinstance(file, BytesIO):
        _check(file.getvalue())
    else:
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            _check(content)
    return True


def _check(content: bytes | mmap.mmap) -> None:
    start = content.find(_BEGINNING)
    while start >= 0:
        length = _number(content, start + 8)
        if _LEAST_BYTES <= length <= len(content) - start:
            _walk(content, start, start + length)
        start = content.find(_BEGINNING, start + 1)


def _walk(content: bytes | mmap.mmap, start: int, end: int) -> None:
    at = start + _HEAD_BYTES
    while at + _HEAD_BYTES <= end:
        is_used = content[at : at + 2] != b"\0\0"
        length = _number(content, at + 8)
        step = length + -length % 8 + (_HEAD_BYTES if is_used else 0)
        if not 0 < step <= end - at:
            raise UnreadableError("the HDF5 file is damaged: a text in it has no length, or too great a one")
        at += step


def _number(content: bytes | mmap.mmap, at: int) -> int:
    return int.from_bytes(content[at : at + 8], "little")
