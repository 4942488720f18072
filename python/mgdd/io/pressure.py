"""Cylinder pressure traces: from text files and arrays to labelled Datasets, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.angles import pair, turned
from mgdd.io.checks import ANGLE_UNITS, PRESSURE_UNITS, check_choice, check_trace
from mgdd.io.table import read_table
from mgdd.results.labels import ANGLE, check_labels, labelled_dataset

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import ArrayLike

__all__ = ["pressure_trace", "read_pressure", "write_pressure"]


def pressure_trace(
    crank_angle_cad: ArrayLike,
    pressure_bar: ArrayLike,
    *,
    firing_tdc_deg: float | None = None,
    before_tdc: bool = False,
    name: str = "trace",
) -> xr.Dataset:
    """Check two arrays and make the Dataset of a measured trace from copies of them.

    Parameters
    ----------
    crank_angle_cad : array_like
        Crank angle [°CA aTDC], firing TDC = 0, compression negative, strictly rising.
    pressure_bar : array_like
        Cylinder pressure [bar].
    firing_tdc_deg, before_tdc
        For angles in another convention, as in `read_pressure`.
    name : str
        What tables and figures call the trace; stored as ``attrs["file"]``.

    Returns
    -------
    xarray.Dataset
        ``pressure_bar(crank_angle_cad)``.

    Raises
    ------
    DataError, ShapeError
        As in `check_trace`.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.io import pressure_trace
    >>> angle = np.arange(-30.0, 31.0)
    >>> trace = pressure_trace(angle, 60.0 - 0.01 * angle**2, name="bench 7")
    >>> trace.attrs["file"], trace["pressure_bar"].attrs["units"]
    ('bench 7', 'bar')
    >>> pressure_trace(-angle, 60.0 - 0.01 * angle**2, before_tdc=True, name="bench 7").equals(trace)
    True
    """
    given, values = pair(crank_angle_cad, pressure_bar)
    order, cad = turned(given, firing_tdc_deg, before_tdc)
    angle, pressure = check_trace(cad, values[order], unit="bar", source=name)
    return _dataset(angle, pressure, name)


def read_pressure(
    path: str | os.PathLike[str],
    *,
    angle_column: int | str = 0,
    pressure_column: int | str = 1,
    angle_unit: str = "deg",
    pressure_unit: str = "bar",
    firing_tdc_deg: float | None = None,
    before_tdc: bool = False,
    delimiter: str | None = None,
    decimal: str = ".",
) -> xr.Dataset:
    r"""Read one measured pressure trace from a text file.

    The file holds columns separated by comma, semicolon, tab or blanks; a header line and a line of units
    may come first; empty lines and lines that start with ``#`` are skipped.

    Parameters
    ----------
    path : path-like
        The file.
    angle_column, pressure_column : int or str
        Position from 0, or the name in the header.
    angle_unit : {"deg", "rad"}
        Unit of the angle column.
    pressure_unit : {"bar", "kPa", "Pa"}
        Unit of the pressure column; a unit that the magnitude excludes is refused.
    firing_tdc_deg : float, optional
        For 0..720 records: the angle [deg] at which firing TDC stands: 360 when the record starts at gas-exchange TDC,
        0 when it starts at firing TDC. It is never guessed; None for other files.
    before_tdc : bool
        Angles count degrees *before* firing TDC, compression positive.
    delimiter : str, optional
        Column separator; None detects it.
    decimal : {".", ","}
        Decimal mark.

    Returns
    -------
    xarray.Dataset
        ``pressure_bar(crank_angle_cad)``; ``attrs["file"]`` is the file's name without its folder.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        An empty file, no such column, a cell that is not a finite number, and all of `check_trace`; the
        message gives file, line, column, value and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io import read_pressure
    >>> rows = "".join(f"{a},{6e6 - 1000 * a * a}\n" for a in range(-30, 31))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "mean.csv"
    ...     _ = file.write_text("angle,p\n" + rows)
    ...     trace = read_pressure(file, pressure_column="p", pressure_unit="Pa")
    >>> float(trace["pressure_bar"].max())
    60.0
    """
    check_choice("pressure_unit", pressure_unit, tuple(PRESSURE_UNITS))
    check_choice("angle_unit", angle_unit, ANGLE_UNITS)
    table = read_table(path, delimiter=delimiter, decimal=decimal)
    angle_index, pressure_index = table.index(angle_column), table.index(pressure_column)
    said = table.unit(pressure_index)
    if said and said != pressure_unit and said not in PRESSURE_UNITS:
        raise DataError(
            f"{table.source}: the units row says {said!r} for the pressure: convert it to one of "
            f"{', '.join(PRESSURE_UNITS)} first"
        )
    if said and said != pressure_unit:
        raise DataError(
            f"{table.source}: the units row says {said!r} for the pressure: pass "
            f"{argument('pressure_unit', repr(said))} instead of {pressure_unit!r}"
        )
    angle, pressure = table.numbers(angle_index), table.numbers(pressure_index)
    rows = list(table.lines)
    if firing_tdc_deg is not None or before_tdc:
        degrees = np.rad2deg(angle) if angle_unit == "rad" else angle
        try:
            order, angle = turned(degrees, firing_tdc_deg, before_tdc)
        except DataError as error:
            raise error.reworded(f"{table.source}: {error}") from None
        pressure, rows = pressure[order], [rows[i] for i in order]
        angle_unit = "deg"
    angle, pressure = check_trace(
        angle, pressure, unit=pressure_unit, angle_unit=angle_unit, source=table.source, rows=rows
    )
    return _dataset(angle, pressure, Path(path).name)


def write_pressure(dataset: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a trace as CSV that `read_pressure` reads back bit by bit.

    Parameters
    ----------
    dataset : xarray.Dataset
        With ``pressure_bar(crank_angle_cad)``; other variables are not written.
    path : path-like
        The file; an existing one is replaced once the Dataset has passed its checks.

    Raises
    ------
    DataError
        No ``pressure_bar`` over ``crank_angle_cad``, missing units, and all of `check_trace`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from mgdd.io import pressure_trace, read_pressure, write_pressure
    >>> angle = np.arange(-30.0, 31.0)
    >>> trace = pressure_trace(angle, 60.0 - 0.01 * angle**2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "mean.csv"
    ...     write_pressure(trace, file)
    ...     read_pressure(file).equals(trace)
    True
    """
    if "pressure_bar" not in dataset or dataset["pressure_bar"].dims != (ANGLE,):
        raise DataError(f"dataset has no pressure_bar({ANGLE}): make one with mgdd.io.pressure_trace")
    check_labels(dataset[["pressure_bar"]])
    measured = dataset["pressure_bar"]
    angle, pressure = check_trace(measured[ANGLE].to_numpy(), measured.to_numpy(), source="dataset")
    lines = [f"{ANGLE},pressure_bar"]
    lines += [f"{a!r},{p!r}" for a, p in zip(angle.tolist(), pressure.tolist(), strict=True)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _dataset(angle: ArrayLike, pressure: ArrayLike, name: str) -> xr.Dataset:
    variables = {ANGLE: (ANGLE, angle), "pressure_bar": (ANGLE, pressure)}
    return labelled_dataset(variables, attrs={"file": name})
