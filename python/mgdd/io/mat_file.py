"""Columns of a MATLAB file: vectors, fields of a struct, or the columns of one matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.existing_file import existing_file

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["MatColumns", "read_mat"]


@dataclass(frozen=True)
class MatColumns:
    """Named numeric columns; `matrix` when the file holds just one, whose columns are numbered from 0."""

    source: str
    columns: dict[str, NDArray[Any]]
    matrix: NDArray[Any] | None

    def has(self, column: str) -> bool:
        """Return whether a column of that name is there."""
        return column in self.columns

    def numbers(self, column: int | str) -> NDArray[np.float64]:
        """Return a column as float64; what is not finite is for the checks."""
        if isinstance(column, int):
            if self.matrix is None:
                raise DataError(f"{self.source}: no single matrix, so there is no column {column}: {self._have()}")
            if not 0 <= column < self.matrix.shape[1]:
                raise DataError(
                    f"{self.source}: no column {column}: the {self.matrix.shape[1]} column(s) are numbered from 0"
                )
            return np.array(self.matrix[:, column], dtype=np.float64)
        if column not in self.columns:
            raise DataError(f"{self.source}: no variable {column!r}: {self._have()}")
        return np.array(self.columns[column], dtype=np.float64)

    def _have(self) -> str:
        return f"the file has {', '.join(map(repr, self.columns)) or 'no numeric vector'}"


def read_mat(path: str | os.PathLike[str]) -> MatColumns:
    """Read a MATLAB file of version 5 to 7; the fields of a struct are called ``struct.field``."""
    from scipy.io import loadmat

    file = existing_file(path)
    try:
        content = loadmat(file, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise DataError(f"{file}: MATLAB 7.3 (HDF5) is not read: save it with save(..., '-v7')") from None
    except Exception as error:
        raise DataError(f"{file}: not a MATLAB file: {error}: save it with save(..., '-v7') or as CSV") from error
    columns: dict[str, NDArray[Any]] = {}
    matrices: list[NDArray[Any]] = []
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, columns, matrices)
    return MatColumns(str(file), columns, matrices[0] if len(matrices) == 1 else None)


def _collect(name: str, value: Any, columns: dict[str, NDArray[Any]], matrices: list[NDArray[Any]]) -> None:
    for field in getattr(value, "_fieldnames", ()):
        _collect(f"{name}.{field}", getattr(value, field), columns, matrices)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        return
    if value.ndim == 1:
        columns[name] = value
    elif value.ndim == 2:
        matrices.append(value)
