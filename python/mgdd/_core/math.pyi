"""
Look-up tables.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['LookupTable']
class LookupTable:
    """
    A look-up table over one or two axes; see mgdd.maps.CalibrationMap.
    """
    def __init__(self, *, names: collections.abc.Sequence[str], axes: collections.abc.Sequence[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]], values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def at(self, points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> tuple:
        """
        Values at points, one row per axis, and which of them lie outside of the axes and are held at the edge.
        """
