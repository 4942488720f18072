"""A check of heaps and trees of an HDF5 file, its texts and lists of names: on damaged ones the library stays for ever.

The layout stands in "HDF5 File Format Specification" by The HDF Group, version 3.0, III.A.1 and III.E.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["check_heaps", "check_trees"]

_START = b"GCOL\x01\0\0\0"
_TREE, _SIBLING, _NODE = b"TREE", 16, 24  # where in a node the place of the next one stands, and where that ends
_BLOCK = 1 << 24
_HEAD = 16  # bytes of a heap's head, and of the head of an object in it


def check_heaps(file: Path, data_at: Iterable[tuple[int, int]] = ()) -> None:
    """Refuse heaps whose objects do not fill them; `data_at` are places and sizes of what holds none, not looked at.

    Raises
    ------
    ValueError
        Such a file.
    """
    with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = 0
        for begin, size in [*sorted(data_at), (len(data), 0)]:
            end = min(begin, len(data))
            at = data.find(_START, start, end)
            while at >= 0:
                _check_heap(data, at)
                at = data.find(_START, at + 1, end)
            start = min(max(start, begin + size), len(data))


def check_trees(file: Path) -> None:
    """Refuse trees whose nodes follow each other in a circle; the library walks them as soon as it lists a folder.

    Raises
    ------
    ValueError
        Such a file.
    """
    following = dict(_nodes(file))
    while following:
        seen, (at, after) = set(), following.popitem()
        while after in following:
            seen.add(at)
            at, after = after, following.pop(after)
        if after == at or after in seen:
            raise ValueError(f"the nodes of a tree follow each other in a circle, the one at byte {at} among them")


def _nodes(file: Path) -> Iterator[tuple[int, int]]:
    """Give the place of every node and of the next one, block by block."""
    begin, base, rest = 0, 0, b""
    with file.open("rb") as stream:
        while block := stream.read(_BLOCK):
            data = rest + block
            if begin == 0:
                base = max(data.find(b"\x89HDF"), 0)
            at = data.find(_TREE)
            while 0 <= at <= len(data) - _NODE:
                yield begin + at, base + struct.unpack_from("<Q", data, at + _SIBLING)[0]
                at = data.find(_TREE, at + 1)
            rest = data[-(_NODE - 1) :]
            begin += len(data) - len(rest)


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
