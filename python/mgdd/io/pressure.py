"""Cylinder pressure traces: from text files, arrays and what else holds one to labelled Datasets, and back."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, taken
from mgdd.io.angle_column import Reading
from mgdd.io.any_table import open_table
from mgdd.io.column_names import TIME_UNITS, Heading, heading
from mgdd.io.pressure_checks import PRESSURE_UNITS, pair, to_bar
from mgdd.io.pressure_file import checked, cycles_of, odd_shape
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd.io.encoder import Encoder
    from mgdd.io.pressure_file import Record

CYCLE = "cycle"


def pressure_trace(
    crank_angle_cad: ArrayLike,
    pressure_bar: ArrayLike,
    *,
    firing_tdc_deg: float | None = None,
    before_tdc: bool = False,
    tdc_offset_cad: float = 0.0,
    name: str = "trace",
) -> xr.Dataset:
    """Check arrays and make the Dataset of a measured trace from copies of them.

    Parameters
    ----------
    crank_angle_cad : array_like
        Crank angle [°CA aTDC], firing TDC = 0, compression negative, strictly rising; it may return to its start, or
        run on with `firing_tdc_deg`, where several cycles follow each other.
    pressure_bar : array_like
        Cylinder pressure [bar]: over the angle, (cycle, angle), a list of one column per cycle, or a DataFrame with one
        column per cycle.
    firing_tdc_deg, before_tdc
        For angles in another convention, and for angles that run on, as in `read_pressure`.
    tdc_offset_cad : float
        What the angles are too large by [°CA], as in `read_pressure`.
    name : str
        What tables and figures call the trace; stored as ``attrs["file"]``.

    Returns
    -------
    xarray.Dataset
        As of `read_pressure`.

    Raises
    ------
    DataError, ShapeError
        As in `check_trace`; cycles of different angles, no complete cycle.

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
    if hasattr(pressure_bar, "columns") and hasattr(pressure_bar, "to_numpy"):  # a DataFrame: a column per cycle
        pressure_bar = pressure_bar.to_numpy().T
    given, values = pair(crank_angle_cad, pressure_bar)
    with taken(("firing_tdc_deg", "before_tdc", "tdc_offset_cad"), _in_arrays):
        record = checked(
            given,
            np.atleast_2d(values),
            firing_tdc_deg=firing_tdc_deg,
            before_tdc=before_tdc,
            tdc_offset_cad=tdc_offset_cad,
            source=name,
        )
    return _dataset(record, name)


def _in_arrays(name: str, text: str | None) -> str:
    """Write what stands for an argument of `read_pressure` where arrays are given."""
    value = (text or "").strip("'")
    if name == "pressure_unit" and value in PRESSURE_UNITS:
        return f"pressure_bar * {to_bar(np.ones(1), value)[0]:.9g}"
    if name == "angle_unit" and value == "rad":
        return "numpy.rad2deg(crank_angle_cad)"
    if name == "angle_unit" and value in TIME_UNITS:
        return f"6 * rpm * time{f' / {TIME_UNITS[value]:g}' if value != 's' else ''}"
    if name == "speed_rpm":
        return "the speed"
    if name == "pressure_column":
        return "as one array of (cycle, angle)"
    return f"mgdd.io.pressure_trace(..., {name}={text or '...'})"


def _in_file(name: str, text: str | None) -> str:
    """Write an argument of `read_pressure` where only its path was given."""
    return f"mgdd.io.read_pressure(..., {name}={text or '...'})"


def read_pressure(
    path: str | os.PathLike[str],
    *,
    angle_column: int | str | None = None,
    pressure_column: int | str | Sequence[int | str] | None = None,
    angle_unit: str | None = None,
    pressure_unit: str | None = None,
    firing_tdc_deg: float | None = None,
    before_tdc: bool = False,
    tdc_offset_cad: float = 0.0,
    angle_step_deg: float | None = None,
    angle_start_deg: float | None = None,
    speed_rpm: float | None = None,
    gain_bar_per_v: float | None = None,
    offset_bar: float | None = None,
    encoder: Encoder | None = None,
    delimiter: str | None = None,
    decimal: str = ".",
    sheet: str | None = None,
    cycle_per_row: bool = False,
) -> xr.Dataset:
    r"""Read the measured pressure of one cylinder, one cycle or many, from a file.

    Text holds columns separated by comma, semicolon, tab or blanks; lines of names and units may come first, and a
    preamble above them; empty lines and lines that start with ``#`` are skipped. MATLAB, HDF5, TDMS, MDF, Parquet,
    NumPy and XLSX files are known by their content; a matrix stands for one column per cycle. Several cycles stand in
    columns, one below the other (the angle returns to its start), or with angles that run on. The page "Formats" has a
    table of forms.

    Parameters
    ----------
    path : path-like
        The file.
    angle_column : int or str, optional
        Position from 0, or the name in the header; None is the first column.
    pressure_column : int, str or sequence of them, optional
        One column, or one per cycle. None takes all numeric columns behind the angle, if header and shape say that they
        are cycles of one cylinder, and leaves out what the header calls another quantity.
    angle_unit : {"deg", "rad", "s", "ms", "us"}, optional
        Unit of the angle column; None takes the unit that the file says, else degrees. A time needs `speed_rpm`.
    pressure_unit : {"bar", "mbar", "kPa", "Pa", "MPa", "psi", "kgf/cm2", "atm", "torr"}, optional
        Unit of the pressure; None takes the unit that header or units row say, else bar. A unit that contradicts the
        file or that the magnitude excludes is refused.
    firing_tdc_deg : float, optional
        For 0..720 records and angles that run on: the angle [deg], 0 to 720, at which firing TDC stands: 360 when the
        record starts at gas-exchange TDC, 0 when it starts at firing TDC. It is never guessed; None for other files.
    before_tdc : bool
        Angles count degrees *before* firing TDC, compression positive.
    tdc_offset_cad : float
        What the angles are too large by [°CA], within ±20: taken off, once they are in °CA aTDC. It is what
        `mgdd.identify.estimate_tdc` and ``tdc_offset_cad`` of a motored `mgdd.engine.analyze` give.
    angle_step_deg : float, optional
        For files without an angle column: degrees between two samples; with `encoder`: the degrees wanted.
    angle_start_deg : float, optional
        With `angle_step_deg` or a time: angle of the first sample [deg], in °CA aTDC, or counted as `firing_tdc_deg`
        is, where that is given; 0 then if left out.
    speed_rpm : float, optional
        Engine speed [rpm], which turns a time into an angle: first angle + 6 n t; stored as ``attrs["speed_rpm"]``. Of
        a record of two cycles and more the period is compared with it: what differs by at most 1 % is corrected and
        reported, more is refused.
    gain_bar_per_v : float, optional
        For a pressure in volts: bar per volt of the charge amplifier.
    offset_bar : float, optional
        For a pressure in volts: bar at 0 V; without it the pressure is relative.
    encoder : mgdd.io.Encoder, optional
        For a record over time beside the signal of an encoder or a toothed wheel: its column, its teeth, its mark.
        `firing_tdc_deg` is the angle of TDC behind that mark then, in either turn: the firing one is the one with the
        higher pressure. The samples are taken at even angles by a cubic, every `angle_step_deg`, or at about as many
        as there are; cycles with miscounted or displaced edges are left out. ``attrs["speed_rpm"]`` is the mean speed.
    delimiter : str, optional
        Column separator; None detects it.
    decimal : {".", ","}
        Decimal mark.
    sheet : str, optional
        Of a workbook the sheet; None takes the one with the most numbers.
    cycle_per_row : bool
        Text or a sheet has a row per cycle: the first row are the angles, or all are cycles with `angle_step_deg`; what
        stands in front of the numbers are names.

    Returns
    -------
    xarray.Dataset
        ``pressure_bar(crank_angle_cad)`` of one cycle, ``pressure_bar(cycle, crank_angle_cad)`` of several, ``cycle``
        counted from 1. ``attrs["file"]`` is the file's name without its folder, ``attrs["warnings"]`` what is doubtful
        or was left out, one per line, and ``attrs["angle_from"]`` is ``time`` where the angle is a time at one speed.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        An empty file, no such column, a cell that is not a finite number, columns that may be of other cylinders or
        quantities, a unit that contradicts the file, and all of `check_trace`; the message gives file, line, column,
        value and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io import read_pressure
    >>> rows = "".join(f"{a},{6e6 - 1000 * a * a},{5.9e6 - 1000 * a * a}\n" for a in range(-30, 31))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "cycles.csv"
    ...     _ = file.write_text("angle,p_1 [Pa],p_2 [Pa]\n" + rows)
    ...     trace = read_pressure(file)
    >>> trace["pressure_bar"].max("crank_angle_cad").values.tolist()
    [60.0, 59.0]
    """
    how = Reading.of(locals())
    with open_table(path, delimiter=delimiter, decimal=decimal, sheet=sheet, cycle_per_row=cycle_per_row) as table:
        return _dataset(cycles_of(table, how), Path(path).name)


def _dataset(record: Record, name: str) -> xr.Dataset:
    if len(record.bar) > 1:
        return cycles_dataset(record, name)
    variables = {ANGLE: (ANGLE, record.angle), _PRESSURE: (ANGLE, record.bar[0])}
    return labelled_dataset(variables, attrs=record_attrs(record, name))


def cycles_dataset(record: Record, name: str, first: int = 1) -> xr.Dataset:
    """Label the cycles of a record, counted from `first`; also a single one has the dimension."""
    variables = {
        ANGLE: (ANGLE, record.angle),
        CYCLE: cycle_count(len(record.bar), first),
        _PRESSURE: ((CYCLE, ANGLE), record.bar),
    }
    return labelled_dataset(variables, attrs=record_attrs(record, name))


def cycle_count(count: int, first: int = 1) -> tuple[Any, ...]:
    """Return the coordinate of so many cycles."""
    return CYCLE, np.arange(first, first + count), "-", "cycle"


def record_attrs(record: Record, name: str) -> dict[str, str | float]:
    """Return the attributes of a record: file, warnings, and the speed where a time was turned into an angle."""
    speed: dict[str, str | float] = {} if record.speed_rpm is None else {"speed_rpm": float(record.speed_rpm)}
    if record.over_time:
        speed["angle_from"] = "time"
    return {"file": name, "warnings": "\n".join(dict.fromkeys(record.notes)), **speed}


_PRESSURE = "pressure_bar"
_FORMS = (
    f"give a Dataset, DataFrame or mapping with {ANGLE} and {_PRESSURE}, a DataArray or Series over {ANGLE}, a "
    f"DataFrame over {ANGLE} with one column per cycle, a pair (angle, pressure), or the path of a file"
)


def one_cycle(trace: Any) -> xr.Dataset:
    """Return a trace of one cycle as a Dataset, and refuse several."""
    made = as_trace(trace)
    if CYCLE in made[_PRESSURE].dims:
        raise DataError(
            f"{made.attrs.get('file', 'trace')}: {made.sizes[CYCLE]} cycles, and one is needed: give their mean, "
            "trace.mean('cycle', keep_attrs=True), --mean-cycle on the command line, or one, trace.isel(cycle=0)"
        )
    return made


def mean_cycle(trace: xr.Dataset) -> xr.Dataset:
    """Give the mean of a trace's cycles; one of one cycle stays as it is."""
    return trace.mean(CYCLE, keep_attrs=True) if CYCLE in trace.dims else trace


def as_trace(trace: Any) -> xr.Dataset:
    """Return any form of a trace as a Dataset; one that is a Dataset over crank angle already is returned as it is."""
    if isinstance(trace, str | os.PathLike):
        with taken((), _in_file):
            return read_pressure(trace)
    with taken((), _in_arrays):
        return _in_memory(trace)


def _in_memory(trace: Any) -> xr.Dataset:
    dims = getattr(trace, "dims", None)
    if dims is not None and hasattr(trace, "variables"):  # a Dataset
        over = trace[_PRESSURE].dims if _PRESSURE in trace.variables else ()
        if ANGLE in trace.variables and over in ((ANGLE,), (CYCLE, ANGLE)):
            checked: xr.Dataset = trace
            return checked
        if over == (ANGLE, CYCLE):
            turned: xr.Dataset = trace.transpose(CYCLE, ANGLE, ...)
            return turned
        return _of_columns(trace, {str(name): trace[name].to_numpy() for name in trace.variables})
    if dims is not None and hasattr(trace, "coords"):  # a DataArray
        columns = {str(name): trace[name].to_numpy() for name in trace.coords}
        if set(dims) == {CYCLE, ANGLE}:
            trace = trace.transpose(CYCLE, ANGLE)
        return _of_columns(trace, {**columns, _PRESSURE: trace.to_numpy()})
    if hasattr(trace, "columns") and hasattr(trace, "index"):  # a DataFrame
        flat = trace if ANGLE in trace.columns else trace.reset_index()
        if _PRESSURE not in trace.columns and ANGLE in flat.columns:
            return _of_frame(trace, flat)
        return _of_columns(trace, {str(name): flat[name].to_numpy() for name in flat.columns})
    if hasattr(trace, "index") and hasattr(trace, "to_numpy"):  # a Series
        return _of_columns(trace, {_index_name(trace.index): np.asarray(trace.index), _PRESSURE: trace.to_numpy()})
    if isinstance(trace, Mapping):
        return _of_columns(trace, {str(name): values for name, values in trace.items()})
    if isinstance(trace, tuple | list) and len(trace) == 2:
        return pressure_trace(*trace)
    raise DataError(f"trace is of type {type(trace).__name__}: {_FORMS}")


def _of_columns(trace: Any, columns: Mapping[str, Any]) -> xr.Dataset:
    for name in (ANGLE, _PRESSURE):
        if name not in columns:
            have = ", ".join(columns) or "nothing"
            raise DataError(f"the trace has no {name}, it has {have}: {_FORMS}")
    attrs = dict(getattr(trace, "attrs", {}))
    made = pressure_trace(columns[ANGLE], columns[_PRESSURE], name=str(attrs.get("file", "trace")))
    attrs.pop("warnings", None)  # those of the check just made stand
    return made.assign_attrs({str(name): value for name, value in attrs.items()})


def _of_frame(trace: Any, flat: Any) -> xr.Dataset:
    """Take several columns beside the angle as cycles, where names and shapes are of one series."""
    names = [name for name in flat.columns if name != ANGLE]
    heads = [heading(str(name)) for name in names]
    bad = next((k for k, head in enumerate(heads) if _is_no_cycle(head, heads[0])), None)
    angle = flat[ANGLE].to_numpy()
    if bad is None and len(names) > 1:
        bad = odd_shape(angle, flat[names].to_numpy().T)
    if len(names) < 2 or bad is not None:
        have = ", ".join(map(str, flat.columns))
        which = "" if bad is None else f", and {names[bad]} is not a cycle in bar of the cylinder of {names[0]}"
        raise DataError(f"the trace has no {_PRESSURE}, it has {have}{which}: {_FORMS}")
    return _of_columns(trace, {ANGLE: angle, _PRESSURE: flat[names].to_numpy().T})


def _is_no_cycle(head: Heading, first: Heading) -> bool:
    alike = (head.series, head.cylinder) == (first.series, first.cylinder)
    return not alike or head.unit not in (None, "bar") or head.quantity not in (None, "pressure")


def _index_name(index: Any) -> str:
    counts = getattr(index, "start", None) == 0 and getattr(index, "step", None) == 1
    return str(index.name) if index.name is not None else "an index that counts samples" if counts else ANGLE
