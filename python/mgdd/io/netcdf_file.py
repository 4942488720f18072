"""Classic netCDF files of users: read whole into memory, written whole to the disk."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.io.existing_file import existing_file
from mgdd.io.whole_file import write_whole

if TYPE_CHECKING:
    import os

    import xarray as xr

__all__ = ["read_netcdf", "write_netcdf"]

_CLASSIC, _HDF5 = b"CDF", b"\x89HDF"


def read_netcdf(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a netCDF file of the classic formats (version 3) into memory.

    Parameters
    ----------
    path : path-like
        The file; it is closed when this returns.

    Returns
    -------
    xarray.Dataset
        Everything in it.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Another format, or a file that was cut off.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.errors import DataError
    >>> from mgdd.io.netcdf_file import read_netcdf
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
    """Write a Dataset as classic netCDF, under another name first.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of numbers and texts.
    path : path-like
        The file; an existing one is replaced in one step.

    Raises
    ------
    OSError
        The file cannot be written; one that was there is as before.
    """
    write_whole(path, lambda half: dataset.to_netcdf(half, engine="scipy"))
