"""Points with their results as a table: CSV with units, as a bench writes it, or netCDF."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.netcdf_file import read_netcdf
from mgdd.io.table import TextTable, read_table
from mgdd.results.labels import VARIABLES, Label, labelled_dataset, named_label
from mgdd.results.units import attribute_units

if TYPE_CHECKING:
    import os
    from collections.abc import Collection, Sequence

    import xarray as xr

__all__ = ["POINT", "flat_points", "input_names", "read_points"]

POINT = "point"
_BRACKETS = re.compile(r"(.*\S)\s*[\[(]([^\[\]()]*)[\])]")
# Units as test benches write them; everything else stands as it is.
_AS_WRITTEN = {
    "1/min": "rpm", "min-1": "rpm", "u/min": "rpm", "nm": "N m", "n·m": "N m", "°c": "degC", "°": "deg",
    "°kw": "°CA", "°crk": "°CA", "deg ca": "°CA", "degca": "°CA", "cad": "°CA",
    "°caatdc": "°CA aTDC", "deg atdc": "°CA aTDC", "degatdc": "°CA aTDC", "°atdc": "°CA aTDC",
}  # fmt: skip


def read_points(
    path: str | os.PathLike[str],
    names: Sequence[str] | None = None,
    *,
    always: Collection[str] = (),
    delimiter: str | None = None,
    decimal: str = ".",
) -> xr.Dataset:
    r"""Read points, one per row of a CSV file; of a netCDF file its list of points, or every cell of its grid.

    Parameters
    ----------
    path : path-like
        ``.csv``, with a header and perhaps a row of units below it, or ``.nc``.
    names : sequence of str, optional
        Columns that are wanted, as the header has them, without a unit in brackets; all, if left out. Only these need a
        number in every row.
    always : collection of str
        Columns that must hold numbers where a CSV file has them, even if all columns are wanted; others without a
        number, remarks for example, are left out then.
    delimiter, decimal : str
        Of a CSV file; the separator is found in the file if left out.

    Returns
    -------
    xarray.Dataset
        The columns over ``point``: numbered by the column ``point`` of the file, else from 0. The unit is that of the
        units row, of the brackets behind a name, or of the ending of the name. Inputs of a grid are columns too.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        Another ending.
    mgdd.errors.DataError
        A missing column or cell, a unit that contradicts a name; the message has line, column and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io.point_table import read_points
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "bench.csv"
    ...     _ = file.write_text("speed;fuel_mg;remark\n1/min;mg;\n900;6.5;cold\n1500;20;\n")
    ...     table = read_points(file, ["speed", "fuel_mg"])
    >>> table["fuel_mg"].values.tolist(), table["speed"].attrs["units"]
    ([6.5, 20.0], 'rpm')
    """
    ending = Path(path).suffix.lower()
    if ending == ".csv":
        return _of_csv(read_table(path, delimiter=delimiter, decimal=decimal), names, always)
    if ending == ".nc":
        return flat_points(read_netcdf(path), names, str(path))
    raise ParameterError(f"{path}: points are read from .csv and .nc; give such an ending")


def _of_csv(table: TextTable, names: Sequence[str] | None, always: Collection[str]) -> xr.Dataset:
    if table.header is None:
        raise DataError(f"{table.source}: no header: name the columns, for example speed_rpm,fuel_mg,p_max_bar")
    split = [_named(head) for head in table.header]
    own = [name for name, _ in split]
    twice = next((name for name in own if name and own.count(name) > 1), None)
    if twice is not None:
        raise DataError(f"{table.source}: column {twice!r} stands twice: rename or remove one")
    if names is None:
        numeric = table.numeric([*range(table.width)])
        places = [k for k, name in enumerate(own) if name not in ("", POINT) and (k in numeric or name in always)]
    else:
        places = [_place(name, own, table.source) for name in names]
    columns = {own[place]: table.numbers(place) for place in places}
    if not columns:
        raise DataError(f"{table.source}: no column of numbers")
    rows = len(table.lines)
    numbers = table.numbers(own.index(POINT)) if POINT in own else np.arange(float(rows))
    variables: dict[str, tuple[object, ...]] = {POINT: (POINT, numbers, "-", "number of the point")}
    for place in places:
        name, bracketed = split[place]
        where = f"{table.source}, column {name!r}"
        variables[name] = (POINT, columns[name], *_label(name, table.unit(place) or bracketed, where))
    return labelled_dataset(variables, attrs={"file": Path(table.source).name})


def input_names(data: xr.Dataset, output: str) -> tuple[str, ...]:
    """Name what an output was computed or measured at: the axes of its grid, or the coordinates of its points."""
    dims = data[output].dims if output in data else tuple(data.dims)
    others = (name for name in data.coords if name not in data.dims and set(data[name].dims) <= set(dims))
    return tuple(str(name) for name in (*dims, *others) if name != POINT)


def flat_points(data: xr.Dataset, names: Sequence[str] | None, origin: str) -> xr.Dataset:
    """Give columns of a Dataset over its points; the inputs of a grid become columns too."""
    data = data.reset_coords([name for name in data.coords if name not in data.dims])
    inputs = [str(dim) for dim in data.dims if dim != POINT]
    if POINT in data.dims and inputs:
        raise DataError(f"{origin}: stands over {POINT} and {', '.join(inputs)}: select one entry of each")
    have = [*inputs, *(str(name) for name in data.data_vars)]
    wanted = have if names is None else [have[_place(name, have, origin)] for name in names]
    for name in wanted:
        if not {"units", "long_name"} <= set(data[name].attrs):
            raise DataError(f"{origin}: {name} has no units or no long_name: say both in its attributes")
    if not inputs:
        return data[wanted]
    flat = data.drop_vars([name for name in data.data_vars if name not in wanted])
    flat = flat.stack({POINT: inputs}).reset_index(POINT).reset_coords(inputs)
    numbers = (POINT, np.arange(flat.sizes[POINT]), {"units": "1", "long_name": "number of the point"})
    for name in inputs:
        flat[name].attrs = dict(data[name].attrs)
    return flat.assign_coords({POINT: numbers})[wanted]


def _named(head: str) -> tuple[str, str | None]:
    found = _BRACKETS.fullmatch(head)
    return (found[1], found[2].strip()) if found else (head, None)


def _place(name: str, own: Sequence[str], origin: str) -> int:
    if name in own:
        return own.index(name)
    near = did_you_mean(name, own) or f"it has {', '.join(map(repr, filter(None, own)))}"
    raise DataError(f"{origin}: no column {name!r}: {near}")


def _label(name: str, said: str | None, where: str) -> Label:
    """Give the unit that is said, which must be that of the name where the name says one."""
    known = named_label(name) if "_" in name or name in VARIABLES else Label("-", name)  # n is a speed, not a newton
    if said in (None, "", "-", "1"):
        return known
    unit = _AS_WRITTEN.get(str(said).lower(), str(said))
    try:
        written = attribute_units(unit)
    except ValueError as error:
        raise DataError(f"{where}: unit {error}") from None
    if known.units == "-" and name not in VARIABLES:
        return Label(unit, known.long_name)
    if attribute_units(known.units) != written:
        raise DataError(
            f"{where}: unit {said!r}: must be {known.units!r}, as the name says; convert the numbers or change the name"
        )
    return known
