"""A check of a MATLAB 5 file before SciPy reads it: on sizes that contradict each other its reader ends the process.

Tags and numbers of the types stand in "MAT-File Format" by MathWorks, level 5.
"""

from __future__ import annotations

import itertools
import math
import struct
import zlib
from typing import NamedTuple

from mgdd.errors import DataError

__all__ = ["check_tags"]

_HEADER, _TAG = 128, 8  # bytes
_INT32, _UINT32, _MATRIX, _COMPRESSED = 5, 6, 14, 15
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # bytes of a number, by its type
_LETTERS = (1, 2, 4, 16, 17, 18)
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_NUMERIC, _COMPLEX, _LOGICAL = range(6, 16), 0x0800, 0x0200
_DEEPEST = 32


class _Element(NamedTuple):
    kind: int
    body: memoryview
    end: int  # with padding


def check_tags(content: bytes, source: str) -> None:
    """Refuse a file whose elements do not fill it, or whose arrays have more or fewer numbers than their dimensions.

    Raises
    ------
    mgdd.errors.DataError
        Such a file; it was cut off or damaged.
    """
    if 0 in content[:4]:
        return  # of version 4, which has no tags
    order = {b"IM": "<", b"MI": ">"}.get(content[126:_HEADER])
    if order is None:
        raise DataError(f"{source}: not a MATLAB file, or damaged: save it with save(..., '-v7') or as CSV")
    try:
        _walk(memoryview(content)[_HEADER:], order, 0)
    except (struct.error, ValueError, IndexError, KeyError, zlib.error, MemoryError) as error:
        raise DataError(f"{source}: cannot be read ({error}): it was cut off or damaged; write it again") from error


def _element(data: memoryview, at: int, order: str, *, padded: bool = True) -> _Element:
    kind, size = struct.unpack_from(f"{order}II", data, at)
    if kind >> 16:  # a small one: size, type and up to four bytes in one tag
        size, kind = kind >> 16, kind & 0xFFFF
        if size > 4:
            raise ValueError(f"a small element of {size} bytes")
        return _Element(kind, data[at + 4 : at + 4 + size], at + _TAG)
    end = at + _TAG + size
    if end > len(data):
        raise ValueError(f"an element of {size} bytes where {len(data) - at - _TAG} are left")
    return _Element(kind, data[at + _TAG : end], end + (-size % 8 if padded else 0))


def _walk(data: memoryview, order: str, depth: int) -> None:
    at = 0
    while at < len(data):
        one = _element(data, at, order, padded=depth > 0)
        if one.kind == _COMPRESSED:
            inflated = zlib.decompressobj().decompress(one.body)
            _walk(memoryview(inflated), order, depth + 1)
        elif one.kind == _MATRIX:
            _check_matrix(one.body, order, depth + 1)
        elif depth == 0:
            raise ValueError(f"type {one.kind} of an element, where 14 or 15 stands")
        at = one.end


def _check_matrix(data: memoryview, order: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise ValueError(f"arrays in each other, deeper than {_DEEPEST}")
    if not len(data):
        return  # an empty one in a cell or a struct
    parts = _Parts(data, order)
    (word, _) = parts.numbers(2)
    kind = word & 0xFF
    if kind == _OPAQUE:
        for _ in range(3):  # name, system and class
            parts.take(*_LETTERS)
        _check_matrix(parts.take(_MATRIX), order, depth + 1)
        return
    shape = parts.numbers()
    if len(shape) < 2 or any(each < 0 for each in shape):
        raise ValueError(f"an array of shape {shape}")
    parts.take(*_LETTERS)  # its name
    count = math.prod(shape)
    if kind in _NUMERIC:
        for _ in range(1 + bool(word & _COMPLEX)):
            parts.require_numbers(count, shape)
    elif kind == _CHAR:
        text = parts.next()
        if text.kind not in _LETTERS or len(text.body) > 4 * count:
            raise ValueError(f"{len(text.body)} bytes of type {text.kind} in a text of shape {shape}")
    elif kind == _SPARSE:
        rows, ends = parts.numbers(), parts.numbers()
        sorted_ends = all(first <= last for first, last in itertools.pairwise(ends))
        if len(ends) != shape[1] + 1 or not sorted_ends or ends[0] != 0 or ends[-1] > len(rows):
            raise ValueError(f"columns of a sparse array of shape {shape} that end at {ends}")
        if any(not 0 <= row < shape[0] for row in rows[: ends[-1]]):
            raise ValueError(f"rows of a sparse array of shape {shape} outside of it")
        for _ in range(1 + bool(word & _COMPLEX)):
            # Logical ones are called doubles, and have a byte each.
            parts.require_numbers(len(rows), shape, at_least=ends[-1], size=1 if word & _LOGICAL else 0)
    elif kind == _FUNCTION:
        _check_matrix(parts.take(_MATRIX), order, depth + 1)
    elif kind in (_CELL, _STRUCT, _OBJECT):
        if kind == _OBJECT:
            parts.take(*_LETTERS)  # its class
        if kind != _CELL:
            (length,) = parts.numbers(1)
            names = parts.take(*_LETTERS)
            if length < 1 or len(names) % length:
                raise ValueError(f"field names of {length} letters in {len(names)} bytes")
            count *= len(names) // length
        for _ in range(count):
            _check_matrix(parts.take(_MATRIX), order, depth + 1)
    else:
        raise ValueError(f"class {kind} of an array, which no list has")


class _Parts:
    """The elements of an array, one after the other."""

    def __init__(self, data: memoryview, order: str) -> None:
        self._data, self._order, self._at = data, order, 0

    def next(self) -> _Element:
        one = _element(self._data, self._at, self._order)
        self._at = one.end
        return one

    def take(self, *kinds: int) -> memoryview:
        """Return the bytes of the next element, which must be of one of these types."""
        one = self.next()
        if one.kind not in kinds:
            raise ValueError(f"type {one.kind} of an element, where {kinds[0]} stands")
        return one.body

    def numbers(self, count: int | None = None) -> tuple[int, ...]:
        """Return the next element as whole numbers of four bytes."""
        body = self.take(_INT32, _UINT32)
        if len(body) % 4 or (count is not None and len(body) != 4 * count):
            raise ValueError(f"{len(body)} bytes of a list of numbers")
        return struct.unpack(f"{self._order}{len(body) // 4}i", body)

    def require_numbers(
        self, count: int, shape: tuple[int, ...], at_least: int | None = None, *, size: int = 0
    ) -> None:
        """Refuse a next element without as many numbers as an array has."""
        one = self.next()
        found = len(one.body) // (size or _SIZES[one.kind])
        if not (count if at_least is None else at_least) <= found <= count:
            raise ValueError(f"{found} numbers in an array of shape {shape}")
