"""Throttle logs: from text files, MATLAB files and arrays to labelled Datasets, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd._arguments import as_floats
from mgdd.errors import DataError, ParameterError, ShapeError, argument, taken
from mgdd.io.any_table import open_table
from mgdd.io.column_names import check_choice, spelled_unit, unit_text
from mgdd.io.table import Place, Table
from mgdd.io.throttle_checks import check_even, check_samples, check_signals, in_arrays
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

# The first unit of each column is taken where none is given.
_UNITS = {
    "time_s": ("s", "ms"), "duty": ("-", "%"), "angle_deg": ("deg", "rad", "%"), "current_a": ("A",), "supply_v": ("V",)
}  # fmt: skip
_ASKED = {"time_s": "time_unit", "duty": "duty_unit", "angle_deg": "angle_unit"}
_OPTIONAL = ("current_a", "supply_v")


def throttle_log(
    time_s: ArrayLike,
    duty: ArrayLike,
    angle_deg: ArrayLike,
    *,
    current_a: ArrayLike | None = None,
    supply_v: ArrayLike | None = None,
    sample_s: float | None = None,
    name: str = "log",
) -> xr.Dataset:
    """Check arrays and make the Dataset of a throttle log from copies of them.

    Parameters
    ----------
    time_s : array_like
        Time [s], rising in even steps.
    duty : array_like
        Duty [-], -1 to 1, positive opens; ``duty[k]`` acts from ``time_s[k]`` to the next sample.
    angle_deg : array_like
        Plate angle from closed [deg], opening positive.
    current_a, supply_v : array_like, optional
        Motor current [A] and supply voltage [V].
    sample_s : float, optional
        Resample to this even step [s]: the duty holds, the others are interpolated.
    name : str
        What messages and figures call the log; stored as ``attrs["file"]``.

    Returns
    -------
    xarray.Dataset
        ``duty`` and ``angle_deg`` over ``time_s``.

    Raises
    ------
    DataError, ShapeError
        A log that no throttle can be identified from: the page "File formats" lists why; arrays that do not belong
        together.
    ParameterError
        A step that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.io import throttle_log
    >>> time = np.arange(1000) * 1e-3
    >>> log = throttle_log(time, 0.2 * np.sin(6.0 * time), 20.0 + 15.0 * np.sin(6.0 * time - 0.5))
    >>> log["angle_deg"].attrs["units"], log.sizes["time_s"]
    ('degree', 1000)
    """
    given = {"time_s": time_s, "duty": duty, "angle_deg": angle_deg, "current_a": current_a, "supply_v": supply_v}
    columns = {key: _column(key, values, name) for key, values in given.items() if values is not None}
    with taken(("sample_s",), in_arrays):
        return _checked(columns, Place(name), sample_s=sample_s, name=name)


def read_throttle_log(
    path: str | os.PathLike[str],
    *,
    time: int | str = "time_s",
    duty: int | str = "duty",
    angle: int | str = "angle_deg",
    current: int | str | None = None,
    supply: int | str | None = None,
    time_unit: str | None = None,
    duty_unit: str | None = None,
    angle_unit: str | None = None,
    travel_deg: float = 90.0,
    start_s: float | None = None,
    stop_s: float | None = None,
    sample_s: float | None = None,
    delimiter: str | None = None,
    decimal: str = ".",
    sheet: str | None = None,
) -> xr.Dataset:
    r"""Read one throttle log from a text file or a MATLAB file (version 5 to 7).

    Parameters
    ----------
    path : path-like
        The file; ``.mat`` is read as MATLAB, everything else as text with separated columns.
    time, duty, angle : int or str
        Column by position from 0 or by name in the header; in a MATLAB file the variable, ``struct.field``, or the
        column of the only matrix.
    current : int or str, optional
        Motor current [A]; None takes ``current_a`` where the file has it.
    supply : int or str, optional
        Supply voltage [V]; None takes ``supply_v`` where the file has it.
    time_unit : {"s", "ms"}, optional
        Unit of the time column; None takes what the units row or brackets in the header say, else s. A unit that
        contradicts the file, and one that is not known, is refused; so for the others.
    duty_unit : {"-", "%"}, optional
        Unit of the duty column: -1 to 1, or percent; else -.
    angle_unit : {"deg", "rad", "%"}, optional
        Unit of the angle column; percent of `travel_deg`; else deg.
    travel_deg : float
        Angle at 100 percent [deg].
    start_s, stop_s : float, optional
        Keep the rows from `start_s` to `stop_s` [s]; both ends count.
    sample_s : float, optional
        Resample to this even step [s]: the duty holds, the others are interpolated.
    delimiter : str, optional
        Column separator of a text file; None detects it.
    decimal : {".", ","}
        Decimal mark of a text file.
    sheet : str, optional
        Of a workbook the sheet; None takes the one with the most numbers.

    Returns
    -------
    xarray.Dataset
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s]; ``attrs["file"]`` is the file's name.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        No such column, a cell that is not a number, and all that `throttle_log` refuses; the message gives file, line,
        column and remedy.
    ParameterError
        An empty window, a step that is not positive.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io import read_throttle_log
    >>> rows = "".join(f"{k},{20 * (-1) ** (k // 50)},{0.2 + 1e-3 * (k % 100)}\n" for k in range(1000))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "bench.csv"
    ...     _ = file.write_text("t,u,theta\n" + rows)
    ...     log = read_throttle_log(
    ...         file, time="t", duty="u", angle="theta", time_unit="ms", duty_unit="%", angle_unit="rad"
    ...     )
    >>> float(log["duty"].max())
    0.2
    """
    given = {"time_s": time_unit, "duty": duty_unit, "angle_deg": angle_unit}
    for key, unit in given.items():
        if unit is not None:
            check_choice(_ASKED[key], unit, _UNITS[key])
    ParameterError.unless(0.0 < travel_deg <= 95.0, "travel_deg", travel_deg, "in (0, 95]")
    columns_asked = {"time_s": time, "duty": duty, "angle_deg": angle, "current_a": current, "supply_v": supply}
    columns, place, units = _read(path, columns_asked, given, delimiter=delimiter, decimal=decimal, sheet=sheet)
    scales = {"time_s": 0.001 if units["time_s"] == "ms" else 1.0, "duty": 0.01 if units["duty"] == "%" else 1.0}
    scales["angle_deg"] = {"rad": math.degrees(1.0), "%": travel_deg / 100.0}.get(units["angle_deg"], 1.0)
    columns = {key: values * scales.get(key, 1.0) for key, values in columns.items()}
    columns, place = _window(columns, place, start_s, stop_s)
    return _checked(
        columns,
        place,
        sample_s=sample_s,
        name=Path(path).name,
        duty_unit=units["duty"],
        angle_unit=units["angle_deg"],
        travel_deg=travel_deg,
    )


def _column(key: str, values: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        column: NDArray[np.float64] = as_floats(values)
    except (TypeError, ValueError) as error:
        raise DataError(f"{name}, column {key!r}: must be numbers") from error
    if column.ndim != 1:
        raise ShapeError(f"{key} has shape {column.shape}: must have 1 dimension")
    return column


def _read(
    path: str | os.PathLike[str],
    columns_asked: dict[str, int | str | None],
    given: Mapping[str, str | None],
    *,
    delimiter: str | None,
    decimal: str,
    sheet: str | None,
) -> tuple[dict[str, NDArray[np.float64]], Place, dict[str, str]]:
    called: dict[str, str] = {}
    units = {key: given.get(key) or usual for key, (usual, *_) in _UNITS.items()}
    columns: dict[str, NDArray[np.float64]] = {}
    with open_table(path, delimiter=delimiter, decimal=decimal, sheet=sheet) as table:
        for key, column in columns_asked.items():
            chosen = key if column is None and key in (table.header or ()) else column
            if chosen is not None:
                index = table.index(chosen)
                units[key] = _unit_of_column(key, given.get(key), table, index)
                columns[key], called[key] = table.numbers(index), repr(chosen)
    return columns, Place(table.source, table.lines, called), units


def _unit_of_column(key: str, asked: str | None, table: Table, index: int) -> str:
    """Return what the file says, else what is asked for, else the usual unit; the first two must agree."""
    text, sure = unit_text(table.header[index] if table.header else "", table.unit(index))
    units = _UNITS[key]
    if text is None or (text == "-" and "-" not in units):
        return asked or units[0]
    unit, where = spelled_unit(text), f"{table.source}: {table.called(index)} is in {text!r} as the file says"
    if unit not in units:
        if not sure and asked is not None:
            return asked  # a remark, as who reads the file knows
        other = "" if sure or key not in _ASKED else f", or pass {argument(_ASKED[key], '')} if that is a remark"
        raise DataError(f"{where}: convert it to {' or '.join(units)}, or correct the file{other}")
    if asked not in (None, unit):
        raise DataError(f"{where}: leave {argument(_ASKED[key])} out, or correct the file")
    return unit


def _window(
    columns: dict[str, NDArray[np.float64]], place: Place, start_s: float | None, stop_s: float | None
) -> tuple[dict[str, NDArray[np.float64]], Place]:
    if start_s is None and stop_s is None:
        return columns, place
    low, high = -math.inf if start_s is None else start_s, math.inf if stop_s is None else stop_s
    time = columns["time_s"]
    if time.size != min(values.size for values in columns.values()):
        return columns, place  # the shape check says so
    margin = 1e-9 * max(1.0, float(np.abs(time).max()))
    keep = np.flatnonzero((time >= low - margin) & (time <= high + margin))
    if not keep.size:
        raise ParameterError(
            f"start_s = {low:g}, stop_s = {high:g}: no row of {place.source} lies between; it runs from {time.min():g} "
            f"to {time.max():g} s"
        )
    return {key: values[keep] for key, values in columns.items()}, place.only(keep)


def _checked(
    columns: dict[str, NDArray[np.float64]],
    place: Place,
    *,
    sample_s: float | None,
    name: str,
    duty_unit: str = "-",
    angle_unit: str = "deg",
    travel_deg: float = 90.0,
) -> xr.Dataset:
    size = columns["time_s"].size
    for key, values in columns.items():
        if values.size != size:
            raise ShapeError(
                f"{place.source}: {key} has {values.size} samples, time {size}: columns must be equally long"
            )
    check_samples(columns, place)
    if sample_s is None:
        check_even(columns["time_s"], place)
    else:
        columns, place = _resampled(columns, sample_s, place)
    check_signals(
        columns["duty"],
        columns["angle_deg"],
        place=place,
        duty_unit=duty_unit,
        angle_unit=angle_unit,
        travel_deg=travel_deg,
    )
    variables = {key: ("time_s", values) for key, values in columns.items()}
    return labelled_dataset(variables, attrs={"file": name})


def _resampled(
    columns: dict[str, NDArray[np.float64]], sample_s: float, place: Place
) -> tuple[dict[str, NDArray[np.float64]], Place]:
    time = columns["time_s"]
    ParameterError.unless(0.0 < sample_s <= 0.1, "sample_s", sample_s, "in (0, 0.1] s")
    even = time[0] + sample_s * np.arange(math.floor((time[-1] - time[0]) / sample_s * (1.0 + 1e-12)) + 1)
    held = np.clip(np.searchsorted(time, even + 1e-9 * sample_s, side="right") - 1, 0, time.size - 1)
    out = {key: np.interp(even, time, values) for key, values in columns.items()}
    out["duty"] = columns["duty"][held]
    out["time_s"] = even
    return out, place.only(held)
