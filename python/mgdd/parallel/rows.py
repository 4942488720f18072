"""Chunks of a table: a range of its cells as pieces of single rows."""

from __future__ import annotations

from collections.abc import Iterator


def pieces(start: int, stop: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Cut a range of cells, counted row by row, where a row ends."""
    while start < stop:
        row, first = divmod(start, width)
        last = min(width, first + stop - start)
        yield row, first, last
        start += last - first
