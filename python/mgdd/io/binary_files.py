"""Classic netCDF files, read whole and written whole, and Parquet files, written whole."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError
from mgdd.io.extras import import_extra
from mgdd.io.files import bytes_of, existing_file, write_whole

if TYPE_CHECKING:
    import os

    import xarray as xr

_CLASSIC, _HDF5 = b"CDF", b"\x89HDF"


def read_netcdf(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a netCDF file of the classic formats (version 3) into memory; another or a cut file is a DataError."""
    import xarray as xr

    file = existing_file(path)
    content = bytes_of(file)
    if content.startswith(_HDF5):
        raise DataError(
            f"{file}: netCDF 4 (HDF5), only the classic format is read: convert it, nccopy -k classic OLD.nc NEW.nc, "
            "or write it with to_netcdf(path, engine='scipy')"
        )
    if not content.startswith(_CLASSIC):
        table = file.suffix == ".csv"
        hint = "mgdd.maps.read_map reads the grid of a spreadsheet" if table else "a text table ends in .csv"
        raise DataError(f"{file}: not a netCDF file: it begins with {content[:8]!r}; {hint}")
    try:
        return xr.load_dataset(io.BytesIO(content), engine="scipy")
    except (ValueError, TypeError, LookupError) as error:  # what scipy makes of missing bytes
        raise DataError(f"{file}: cannot be read ({error}): the file was cut off or damaged; write it again") from error


def write_netcdf(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a Dataset of numbers and texts as classic netCDF, as `write_whole` does."""
    write_whole(path, lambda half: dataset.to_netcdf(half, engine="scipy"))


def write_parquet(columns: Mapping[str, tuple[Any, str, str]], path: str | os.PathLike[str]) -> None:
    """Write name: (values, unit, long name) as the columns of a Parquet file, as `write_whole` does."""
    arrow = import_extra("pyarrow", "parquet", "a Parquet file")
    parquet = import_extra("pyarrow.parquet", "parquet", "a Parquet file")
    arrays = [arrow.array(values) for values, _, _ in columns.values()]
    fields = [
        arrow.field(name, array.type, metadata={"units": units, "long_name": long_name})
        for array, (name, (_, units, long_name)) in zip(arrays, columns.items(), strict=True)
    ]
    write_whole(path, lambda half: parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), half))
