"""Columns of a binary file, read from the disk where they are asked for."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mgdd.errors import DataError
from mgdd.io.files import require_free
from mgdd.io.table import Table


class Named(NamedTuple):
    """An array of a file by name: whatever has a shape and a dtype, and gives numbers for slices."""

    name: str
    values: Any
    unit: str = ""


class Samples:
    """A vector that a function reads, where it is asked for."""

    def __init__(self, length: int, dtype: DTypeLike, read: Callable[[], Any]) -> None:
        self.shape, self.dtype, self._read = (length,), np.dtype(dtype), read

    def __getitem__(self, _: Any) -> Any:
        return self._read()


class Reversed:
    """An array whose axes stand in the other order in the file, as MATLAB 7.3 writes them."""

    def __init__(self, values: Any) -> None:
        self.shape, self.dtype, self._values = values.shape[::-1], values.dtype, values

    def __getitem__(self, index: tuple[Any, ...]) -> Any:
        return np.asarray(self._values[index[::-1]]).T


def marked(values: NDArray[Any], missing: NDArray[np.bool_] | None) -> NDArray[Any]:
    """Return samples with NaN in place of those that a file marks as missing or invalid, whatever it stores there."""
    if missing is None or not np.any(missing):
        return values
    if values.dtype.kind not in "fiub":
        return values  # no column of numbers
    made = values.astype(np.float64)
    made[np.asarray(missing, np.bool_)] = np.nan
    return made


class Column(NamedTuple):
    """One column of an array: the axis of its samples, and what stands for the other axes."""

    values: Any
    along: int
    across: int | None = None
    number: int = 0

    @property
    def size(self) -> int:
        """Return the number of samples."""
        return int(self.values.shape[self.along])

    def block(self, count: int) -> NDArray[Any]:
        """Read this column and those behind it, as rows."""
        index: list[Any] = [0] * len(self.values.shape)
        index[self.along] = slice(None)
        if self.across is None:
            return np.asarray(self.values[tuple(index)])[None]
        index[self.across] = slice(self.number, self.number + count)
        table = np.asarray(self.values[tuple(index)])
        return table.T if self.along < self.across else table


Columns = list[tuple[str, str, Column]]  # name, unit, column


def columns_of(arrays: Iterable[Named], along: int | None = None) -> Columns:
    """Give name, unit and column: a matrix column by column, along the samples of a vector, else its longer side."""
    named = []
    for name, values, unit in arrays:
        axes = [k for k, size in enumerate(values.shape) if size != 1]
        if values.dtype.kind in "fiub" and len(axes) in (1, 2) and 0 not in values.shape:
            named.append((name, unit, values, axes))
    lengths = {values.shape[axes[0]] for _, _, values, axes in named if len(axes) == 1} if along is None else {along}
    columns: Columns = []
    for name, unit, values, axes in named:
        if len(axes) == 1:
            columns.append((name, unit, Column(values, axes[0])))
            continue
        rows, width = (values.shape[k] for k in axes)
        turned = rows not in lengths and (width in lengths or width > rows)
        down, across = axes[::-1] if turned else axes
        for k in range(values.shape[across]):
            columns.append((f"{name} {k + 1}".strip(), unit, Column(values, down, across, k)))
    return columns


@dataclass(frozen=True)
class ArrayTable(Table):
    """Columns of a binary file; those of several rasters differ in length."""

    columns: tuple[Column, ...]
    file: Path | None = None  # that the columns are read from

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return len(self.columns)

    @property
    def height(self) -> int:
        """Return the number of rows of the first column."""
        return self.columns[0].size

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Return the number of rows of each column."""
        return tuple(column.size for column in self.columns)

    def matrix(self, indices: Sequence[int]) -> NDArray[np.float64]:
        """Return columns of one length as the rows of an array."""
        columns = [self.columns[index] for index in indices]
        if len({column.size for column in columns}) > 1:
            sizes = ", ".join(f"{self.called(index)} has {self.columns[index].size}" for index in indices)
            raise DataError(f"{self.source}: columns of different rasters, {sizes}: name columns of one")
        rows = columns[0].size if columns else 0
        self._require_room(8 * rows * len(columns))
        out = np.empty((len(columns), rows))
        # Columns that stand side by side are read in one go: a file is read by rows.
        runs = itertools.groupby(enumerate(columns), lambda each: (id(each[1].values), each[1].number - each[0]))
        for _, run in runs:
            (at, first), *others = run
            count = 1 + len(others)
            with self._reading():
                place = out[at : at + count]
                place[:] = _complete(first.block(count), place.shape)
        return out

    def loaded(self) -> ArrayTable:
        """Return the table with all of its arrays in memory."""
        arrays = {id(column.values): column.values for column in self.columns}
        self._require_room(sum(math.prod(each.shape) * each.dtype.itemsize for each in arrays.values()))
        with self._reading():
            held = {
                key: _complete(np.asarray(each[(slice(None),) * len(each.shape)]), each.shape)
                for key, each in arrays.items()
            }
        columns = tuple(each._replace(values=held[id(each.values)]) for each in self.columns)
        return replace(self, columns=columns, file=None)

    def _require_room(self, needed: int) -> None:
        if self.file is not None:
            require_free(self.file, needed)

    def _reading(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext() if self.file is None else naming_damage(self.file)


def _complete(values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Refuse fewer numbers than the head of a file states, which NumPy would repeat or leave out."""
    if values.shape != shape:
        raise ValueError(f"{values.shape} numbers where the head states {shape}")
    return values


@contextlib.contextmanager
def naming_damage(file: Path) -> Iterator[None]:
    """Turn what a library raises of a file into a DataError that names it."""
    try:
        yield
    except (ImportError, DataError, UserWarning):
        raise
    except Exception as error:  # of another library: any class
        text = f"{type(error).__name__} {error}".strip()
        raise DataError(f"{file}: cannot be read ({text}): the file was cut off or damaged; write it again") from error
