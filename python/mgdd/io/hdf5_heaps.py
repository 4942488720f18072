"""A check of heaps and trees of an HDF5 file, its texts and lists of names: on damaged ones the library stays for ever.

The layout stands in "HDF5 File Format Specification" by The HDF Group, version 3.0, III.A.1 and III.E.
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

__all__ = ["check_heaps"]

_START = b"GCOL\x01\0\0\0"
_TREE, _SIBLING = b"TREE", 16  # where in a node the place of the next one stands
_HEAD = 16  # bytes of a heap's head, and of the head of an object in it


def check_heaps(file: Path) -> None:
    """Refuse heaps whose objects do not fill them, and trees whose nodes follow each other in a circle.

    Raises
    ------
    ValueError
        Such a file.
    """
    with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(_START)
        while at >= 0:
            _check_heap(data, at)
            at = data.find(_START, at + 1)
        _check_trees(data)


def _check_trees(data: mmap.mmap) -> None:
    base, following = data.find(b"\x89HDF"), {}
    at = data.find(_TREE)
    while 0 <= at <= len(data) - _SIBLING - 8:
        following[at] = base + struct.unpack_from("<Q", data, at + _SIBLING)[0]
        at = data.find(_TREE, at + 1)
    while following:
        seen, (at, after) = set(), following.popitem()
        while after in following:
            seen.add(at)
            at, after = after, following.pop(after)
        if after == at or after in seen:
            raise ValueError(f"the nodes of a tree follow each other in a circle, the one at byte {at} among them")


def _check_heap(data: mmap.mmap, start: int) -> None:
    if start + _HEAD > len(data):
        return
    end = start + struct.unpack_from("<Q", data, start + 8)[0]
    at = start + _HEAD
    while at + _HEAD <= min(end, len(data)):
        index, size = struct.unpack_from("<H6xQ", data, at)
        # Object 0 is what is free, with its head; the others have bytes of their own behind it, filled up to eight.
        needed = size if index == 0 else _HEAD + (size + 7) // 8 * 8
        if not _HEAD <= needed <= end - at:
            raise ValueError(f"the heap at byte {start} has an object of {size} bytes where {end - at} are left")
        at += needed
