"""
Places in look-up tables, and rows of numbers in a text.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['TableAxes', 'cell_counts', 'row_numbers', 'text_rows']
class TableAxes:
    """
    The axes of a table, one or two; see mgdd.maps.CalibrationMap.
    """
    def __init__(self, *, names: collections.abc.Sequence[str], entries: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def places(self, points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> tuple:
        """
        Cells around points, one row per axis, their weights, and which points lie outside of the axes.
        """
def cell_counts(text: bytes, begin: typing.Annotated[numpy.typing.ArrayLike, numpy.int64], end: typing.Annotated[numpy.typing.ArrayLike, numpy.int64], mark: str) -> numpy.typing.NDArray[numpy.int64]:
    """
    Number of cells of each row; an empty mark is blanks.
    """
def row_numbers(text: bytes, begin: typing.Annotated[numpy.typing.ArrayLike, numpy.int64], end: typing.Annotated[numpy.typing.ArrayLike, numpy.int64], mark: str, decimal_comma: bool, columns: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]) -> tuple[numpy.typing.NDArray[numpy.float64], list[bool]]:
    """
    Columns of rows as the rows of an array, and which of them hold nothing but finite numbers.
    """
def text_rows(text: bytes, first_line: typing.SupportsInt | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], int]:
    """
    First byte, end and line of each row of a text, without empty ones and remarks, and the number of lines.
    """
