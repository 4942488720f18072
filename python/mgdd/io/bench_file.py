"""A whole file of a test cell as one Dataset: its channels cut into cycles together, and what was measured slower."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.angle_column import Reading
from mgdd.io.any_table import open_table
from mgdd.io.channels import Channel, Layout, columns_shown, kept_channels, layout_of
from mgdd.io.column_names import TIME_UNITS
from mgdd.io.pressure import CYCLE, cycle_count, record_attrs
from mgdd.io.pressure_checks import check_magnitude, to_bar
from mgdd.io.pressure_file import Pressure, Record, pressure_of, record_of
from mgdd.io.table import Table
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.io.encoder import Encoder


def read(
    path: str | os.PathLike[str],
    *,
    channels: Sequence[str] | None = None,
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
    r"""Read a whole file of a test cell: all its channels, cut into cycles together.

    The formats, forms and checks are those of `read_pressure`, which reads one cylinder of such a file. Pressures of
    several cylinders are several channels here, over one angle: that of the cylinder whose firing TDC it counts from.

    Parameters
    ----------
    path : path-like
        The file.
    channels : sequence of str, optional
        Names of the channels to keep, as they are called here or in the file; None keeps all. Angle and pressures are
        read in any case, because they say where a cycle begins.
    angle_column : int or str, optional
        Position from 0, or the name in the header; None is the first column that the header calls an angle, else the
        first.
    pressure_column : int, str or sequence of them, optional
        The columns of cylinder pressures; None takes those that the header calls so, or else what `read_pressure`
        takes.
    angle_unit, pressure_unit
        Units of the angle and of the cylinder pressures, where the file does not say them, as in `read_pressure`.
    firing_tdc_deg, before_tdc, tdc_offset_cad
        For angles in another convention, angles that run on, and angles that are a little off, as in `read_pressure`.
    angle_step_deg, angle_start_deg, speed_rpm
        For files without an angle, as in `read_pressure`.
    gain_bar_per_v, offset_bar
        For cylinder pressures in volts, as in `read_pressure`.
    encoder
        For records over time beside the signal of an encoder, as in `read_pressure`.
    delimiter, decimal, sheet, cycle_per_row
        Of text and of workbooks, as in `read_pressure`.

    Returns
    -------
    xarray.Dataset
        ``pressure_bar``, or ``pressure_1_bar``, ``pressure_2_bar`` and so on by the number of the cylinder, and every
        other channel of that raster, under its name in the file without what no identifier holds, over ``(cycle,
        crank_angle_cad)``; over ``crank_angle_cad`` alone where there is one cycle, as `read_pressure` gives it, or
        where a file with a column per cycle has one column of the channel. What has one value per cycle is over
        ``cycle``; columns of another raster are over their own time, ``time_1_s``, ``time_2_s`` and so on. Units are
        those of the file (``"1"`` where it says none), cylinder pressures are in bar; ``attrs["source"]`` of each
        variable names its column. ``attrs["file"]`` and ``attrs["warnings"]`` as of `read_pressure`.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        All that `read_pressure` refuses; no cylinder pressure; no such channel; a cell of a channel that is not a
        number. The message gives file, column, cause and remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io import read
    >>> rows = "".join(f"{a},{6e3 - a * a},{0.1 * a * a},{101 + 0.01 * a}\n" for a in range(-30, 31))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "bench.csv"
    ...     _ = file.write_text("CAD,pcyl [kPa],torque [Nm],p_intake [kPa]\n" + rows)
    ...     bench = read(file, channels=["pressure_bar", "torque"])
    >>> {name: bench[name].attrs["units"] for name in bench.data_vars}
    {'pressure_bar': 'bar', 'torque': 'N*m'}
    >>> float(bench["pressure_bar"].max()), bench["torque"].attrs["source"]
    (60.0, "column 'torque [Nm]'")
    """
    how = Reading.of(locals())
    with open_table(path, delimiter=delimiter, decimal=decimal, sheet=sheet, cycle_per_row=cycle_per_row) as table:
        return bench_record(table, layout_of(table, how), channels, name=Path(path).name)


def bench_record(table: Table, layout: Layout, channels: Sequence[str] | None, *, name: str) -> xr.Dataset:
    """Cut and label what a layout of a table says."""
    chosen = kept_channels(table, layout, channels)
    chosen_names = {channel.name for channel in chosen}
    cylinders = [channel for channel in layout.channels if channel.kind == "pressure"]
    fast = [channel for channel in chosen if channel.kind == "fast"]
    pressures = [pressure_of(table, layout.heads, [*each.columns], layout.how, layout.angle) for each in cylinders]
    for channel, pressure in zip(cylinders, pressures, strict=True):
        if len(cylinders) > 1:
            _check_finite(table, channel, pressure)
    values = [_values(table, channel) for channel in fast]
    record, cut, reference = _cut(table, layout, cylinders, pressures, values)
    variables: dict[str, tuple[Any, ...]] = {ANGLE: (ANGLE, record.angle)}
    of = f", 0 at firing TDC of {reference}" if len(cylinders) > 1 else ""
    sources = {ANGLE: f"{layout.angle_source}{of}", CYCLE: "counted from 1"}
    count = len(record.bar)
    if count > 1:
        variables[CYCLE] = cycle_count(count)
    for channel, array in zip([*cylinders, *fast], cut, strict=True):
        whole = count > 1 and len(array) > 1
        if channel.name in chosen_names:
            variables[channel.name] = _labelled(channel, ((CYCLE, ANGLE), array) if whole else ((ANGLE,), array[0]))
    notes = [note for pressure in pressures for note in pressure.notes if note not in record.notes]
    notes += _add_slow(table, layout, chosen, variables, sources)
    notes += _add_per_cycle(table, chosen, record, variables, asked=channels is not None)
    if bare := [channel.name for channel in chosen if channel.units is None and channel.name in variables]:
        notes.append(f"the file gives no unit of {columns_shown(bare)}: their numbers are unchanged")
    made = labelled_dataset(variables, attrs=record_attrs(record._replace(notes=record.notes + notes), name))
    sources |= {channel.name: channel.source for channel in chosen}
    for name_of, variable in made.variables.items():  # made[name] would look at every other variable each time
        variable.attrs["source"] = sources[str(name_of)]
    return made


def _cut(
    table: Table,
    layout: Layout,
    cylinders: Sequence[Channel],
    pressures: Sequence[Pressure],
    fast: Sequence[NDArray[np.float64]],
) -> tuple[Record, list[NDArray[np.float64]], str]:
    """Cut all channels at the cycles of the cylinder whose firing TDC the angle counts from, and name that one."""
    first: DataError | None = None
    columns = len(pressures[0].values)
    for k, (channel, master) in enumerate(zip(cylinders, pressures, strict=True)):
        others = [each.values for j, each in enumerate(pressures) if j != k] + list(fast)
        wide = [np.broadcast_to(each, (columns, each.shape[1])) for each in others]
        along = np.stack(wide) if wide else None
        called = f"{table.source}, {channel.source}" if len(cylinders) > 1 else table.source
        try:
            record = record_of(table, layout.angle, master, layout.how, along, source=called)
        except DataError as error:
            first = first or error
            continue
        cut = [part[:1] if len(each) < columns else part for each, part in zip(others, record.along, strict=True)]
        for j, pressure in enumerate(each for each in pressures if each is not master):
            called = f"{table.source}, {[each for each in cylinders if each is not channel][j].source}"
            try:
                check_magnitude(record.angle, cut[j], pressure.unit, called, pressure.unit_of_file)
            except DataError as error:
                named = argument("pressure_column", "")
                raise error.reworded(f"{error}; or name the cylinders' pressures, {named}") from error
            cut[j] = to_bar(cut[j], pressure.unit)
        cut.insert(k, record.bar)
        return record, cut, channel.name
    raise first or DataError(f"{table.source}: no cylinder pressure: name it, {argument('pressure_column', '')}")


def _check_finite(table: Table, channel: Channel, pressure: Pressure) -> None:
    bad = np.argwhere(~np.isfinite(pressure.values))
    if bad.size:
        column, row = bad[0]
        raise DataError(
            f"{table.source}, {table.called(channel.columns[column])}, row {row}: {pressure.values[column, row]}: must "
            "be finite; remove or repair it"
        )


def _values(table: Table, channel: Channel) -> NDArray[np.float64]:
    """Return the columns of a channel as rows; a bad cell may also be left out with its channel."""
    try:
        return table.matrix(channel.columns)
    except DataError as error:
        names = argument("channels", "")
        raise error.reworded(f"{error}; or leave {channel.name} out: {names} names those that are kept") from error


def _labelled(channel: Channel, entry: tuple[Any, Any]) -> tuple[Any, ...]:
    if channel.kind == "pressure":
        number = channel.name.split("_")[1]
        return (*entry, "bar", "cylinder pressure" if number == "bar" else f"pressure of cylinder {number}")
    return (*entry, channel.units or "-", channel.name.replace("_", " ").strip() or channel.name)


def _add_slow(
    table: Table, layout: Layout, chosen: Sequence[Channel], variables: dict[str, Any], sources: dict[str, str]
) -> list[str]:
    """Add the channels of other rasters over their own times."""
    names: dict[int, str] = {}
    notes = []
    for channel in chosen:
        if channel.kind != "slow" or channel.time is None:
            continue
        if channel.time not in names:
            dim = names[channel.time] = f"time_{len(names) + 1}_s"
            unit = layout.heads[channel.time].unit
            variables[dim] = (dim, table.numbers(channel.time) / TIME_UNITS[unit or "s"], "s", "time")
            sources[dim] = table.called(channel.time)
            if unit is None:
                notes.append(f"the file gives no unit of {sources[dim]}: taken as seconds")
        dim = names[channel.time]
        variables[channel.name] = _labelled(channel, (dim, _values(table, channel)[0]))
    return notes


def _add_per_cycle(
    table: Table, chosen: Sequence[Channel], record: Record, variables: dict[str, Any], *, asked: bool
) -> list[str]:
    """Add what has one value per cycle; what has neither a time nor that is left out, by name."""
    count, left = len(record.bar), []
    for channel in chosen:
        if channel.kind != "other":
            continue
        values = _values(table, channel)[0]
        if record.taken is not None and values.size == record.total:
            values = values[list(record.taken)]
        if values.size != count:
            left.append(channel)
        elif count > 1:
            variables[channel.name] = _labelled(channel, (CYCLE, values))
        else:
            variables[channel.name] = _labelled(channel, ((), values[0]))
    if left and asked:
        raise DataError(
            f"{table.source}: {left[0].source} has {table.lengths[left[0].columns[0]]} values: neither a time column "
            f"has as many, nor are there as many cycles, {count}: leave it out of {argument('channels')}"
        )
    if not left:
        return []
    shown = columns_shown([channel.name for channel in left])
    return [f"{shown} left out: neither over the crank angle, nor with a time, nor one value per cycle"]
