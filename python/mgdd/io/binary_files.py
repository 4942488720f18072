"""Binary files: classic netCDF, read whole and written whole, and the columns of a MATLAB file."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.io.files import existing_file, write_whole

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import NDArray

__all__ = [
    "MatColumns",
    "read_mat",
    "read_netcdf",
    "write_netcdf",
]

_CLASSIC, _HDF5 = b"CDF", b"\x89HDF"


def read_netcdf(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a netCDF file of the classic formats (version 3) into memory; another format or a cut file is a DataError.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.errors import DataError
    >>> from mgdd.io.binary_files import read_netcdf
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "table.nc"
    ...     _ = file.write_text("speed_rpm,fuel_mg")
    ...     try:
    ...         read_netcdf(file)
    ...     except DataError as error:
    ...         print(str(error).rpartition("/")[2])
    table.nc: not a netCDF file: it begins with b'speed_rp'; a text table ends in .csv
    """
    import xarray as xr

    file = existing_file(path)
    content = file.read_bytes()
    if content.startswith(_HDF5):
        raise DataError(
            f"{file}: netCDF 4 (HDF5), only the classic format is read: convert it, nccopy -k classic OLD.nc NEW.nc, "
            "or write it with to_netcdf(path, engine='scipy')"
        )
    if not content.startswith(_CLASSIC):
        raise DataError(f"{file}: not a netCDF file: it begins with {content[:8]!r}; a text table ends in .csv")
    try:
        return xr.load_dataset(io.BytesIO(content), engine="scipy")
    except (ValueError, TypeError, LookupError) as error:  # what scipy makes of missing bytes
        raise DataError(f"{file}: cannot be read ({error}): the file was cut off or damaged; write it again") from error


def write_netcdf(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a Dataset of numbers and texts as classic netCDF, as `write_whole` does."""
    write_whole(path, lambda half: dataset.to_netcdf(half, engine="scipy"))


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
