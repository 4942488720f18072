"""Points with their results as a table, CSV with units or netCDF, and the operating conditions of traces."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.binary_files import read_netcdf
from mgdd.io.pressure_checks import CONVENTION
from mgdd.io.row_text import parse_number
from mgdd.io.table import TextTable, read_table
from mgdd.results.labels import VARIABLES, Label, labelled_dataset, named_label
from mgdd.results.units import attribute_units

if TYPE_CHECKING:
    import os

    import xarray as xr

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
    """Read points, one per row of a CSV file; of a netCDF file its list of points, or every cell of its grid.

    Only columns in `names` need a number in every row, or those in `always` where all are wanted. The unit is that of
    the units row, of the brackets behind a name, or of the ending of the name.

    Parameters
    ----------
    path, names, always
        The file; columns that are wanted, all if left out; columns that must hold numbers in any case.
    delimiter : str, optional
        Column separator of a CSV file; found in it if left out.
    decimal : {".", ","}
        Decimal mark of a CSV file.
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
        raise DataError(f"{table.source}: column {twice!r} occurs twice: rename or remove one")
    if names is None:
        numeric = table.numeric([*range(table.width)])
        places = [k for k, name in enumerate(own) if name not in ("", POINT) and (k in numeric or name in always)]
    else:
        places = [_place(name, own, table.source) for name in names]
    columns = {own[place]: table.numbers(place) for place in places}
    if not columns:
        raise DataError(f"{table.source}: no column of numbers")
    rows = table.height
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
    chosen = have if names is None else [have[_place(name, have, origin)] for name in names]
    for name in chosen:
        if not {"units", "long_name"} <= set(data[name].attrs):
            raise DataError(f"{origin}: {name} has no units or no long_name: say both in its attributes")
    if not inputs:
        return data[chosen]
    flat = data.drop_vars([name for name in data.data_vars if name not in chosen])
    flat = flat.stack({POINT: inputs}).reset_index(POINT).reset_coords(inputs)
    numbers = (POINT, np.arange(flat.sizes[POINT]), {"units": "1", "long_name": "number of the point"})
    for name in inputs:
        flat[name].attrs = dict(data[name].attrs)
    return flat.assign_coords({POINT: numbers})[chosen]


def _named(head: str) -> tuple[str, str | None]:
    match = _BRACKETS.fullmatch(head)
    return (match[1], match[2].strip()) if match else (head, None)


def _place(name: str, own: Sequence[str], origin: str) -> int:
    if name in own:
        return own.index(name)
    near = did_you_mean(name, own) or f"it has {', '.join(map(repr, filter(None, own)))}"
    raise DataError(f"{origin}: no column {name!r}: {near}")


def _label(name: str, text: str | None, where: str) -> Label:
    """Return the given unit, which must be that of the name where the name has one."""
    label = named_label(name) if "_" in name or name in VARIABLES else Label("-", name)  # n is a speed, not a newton
    if text in (None, "", "-", "1"):
        return label
    unit = _AS_WRITTEN.get(str(text).lower(), str(text))
    try:
        written = attribute_units(unit)
    except ValueError as error:
        raise DataError(f"{where}: unit {error}") from None
    if label.units == "-" and name not in VARIABLES:
        return Label(unit, label.long_name)
    if attribute_units(label.units) != written:
        raise DataError(
            f"{where}: unit {text!r}: must be {label.units!r}, as the name says; convert the numbers or change the name"
        )
    return label


# Open bounds of what a bench can mean, closed where zero means something; an injection or spark far outside is another
# angle convention.
_BOUNDS = {
    "load_percent": (-math.inf, math.inf),
    "speed_rpm": (0.0, 30000.0),
    "trapped_mass_g": (0.0, 1000.0),
    "soi_cad": (-60.0, 20.0),
    "spark_cad": (-90.0, 40.0),
    "intake_pressure_kpa": (0.0, 2000.0),
    "intake_temperature_k": (200.0, 1000.0),
    "ivc_temperature_k": (200.0, 1000.0),
    "fuel_mg": (0.0, 100000.0),
    "bmep_bar": (-20.0, 100.0),
    "brake_torque_nm": (-1e6, 1e6),
    "n_cylinders": (0.0, 100.0),
}
CONDITIONS = tuple(_BOUNDS)
_ANGLES = ("soi_cad", "spark_cad")
_CLOSED = (*_ANGLES, "fuel_mg")


def read_conditions(path: str | os.PathLike[str]) -> dict[str, dict[str, float]]:
    """Read the operating conditions of several traces: by the column ``file``, what each row has of `CONDITIONS`."""
    table = read_table(path, units_row=False)
    header = table.header
    if header is None or "file" not in header:
        raise DataError(f"{table.source}: the header needs a column 'file' that names each trace")
    unknown = [name for name in header if name != "file" and name not in _BOUNDS]
    if unknown or len(set(header)) != len(header):
        columns = ", ".join(map(repr, ("file", *_BOUNDS)))
        raise DataError(f"{table.source}: unknown or repeated column in {header}: known are {columns}, once each")
    conditions: dict[str, dict[str, float]] = {}
    for line, row in zip(table.lines.tolist(), table.cells, strict=True):
        cells = dict(zip(header, row, strict=True))
        name = cells.pop("file")
        if not name or name in conditions:
            raise DataError(f"{table.source}, line {line}: file = {name!r}: name every trace, each once")
        conditions[name] = {
            column: _value(cell, column, f"{table.source}, line {line}") for column, cell in cells.items() if cell
        }
    return conditions


def conditions_of(files: Sequence[str], table: str | None) -> dict[str, dict[str, float]]:
    """Give each file its row of `read_conditions`, by path, name or stem; an empty row without a table."""
    conditions, used = {} if table is None else read_conditions(table), dict[str, str]()
    if not conditions:
        return {file: {} for file in files}
    rows: dict[str, dict[str, float]] = {}
    for file in files:
        key = next((k for k in (file, Path(file).name, Path(file).stem) if k in conditions), None)
        if key is None:
            raise DataError(f"{table}: no row for {file}: its column 'file' holds {', '.join(map(repr, conditions))}")
        if key in used:
            raise DataError(f"{table}: row {key!r} fits both {used[key]} and {file}: write their paths as given here")
        used[key], rows[file] = file, conditions[key]
    return rows


def _value(cell: str, column: str, where: str) -> float:
    value = parse_number(cell)
    if value is None or not math.isfinite(value):
        raise DataError(f"{where}: {column} = {cell!r}: must be a finite number; leave it empty if unknown")
    low, high = _BOUNDS[column]
    inside = low <= value <= high if column in _CLOSED else low < value < high
    if not inside:
        hint = f"; {CONVENTION}" if column in _ANGLES else ""
        raise DataError(f"{where}: {column} = {value:g}: must be between {low:g} and {high:g}{hint}")
    return value
