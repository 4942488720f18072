"""Chunks of a table: a range of its cells as pieces of single rows."""

from __future__ import annotations

from collections.abc import Iterator

__all__ = ["pieces"]


def pieces(start: int, stop: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Cut a range of cells, counted row by row, where a row ends.

    Parameters
    ----------
    start, stop : int
        First cell, and the one behind the last.
    width : int
        Cells of a row.

    Yields
    ------
    tuple of int
        Row, first cell in it, and the one behind the last.

    Examples
    --------
    >>> from mgdd.parallel.rows import pieces
    >>> list(pieces(3, 9, 4))
    [(0, 3, 4), (1, 0, 4), (2, 0, 1)]
    """
    while start < stop:
        row, first = divmod(start, width)
        last = min(width, first + stop - start)
        yield row, first, last
        start += last - first
