"""`mgdd data info | convert | list | get`: what a file of a test cell holds, the file as another, and public data."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import datasets
from mgdd.cli.from_library import Options, default_of
from mgdd.cli.options import READING, add_encoder, encoder_of, option
from mgdd.cli.output import emit, warn, wrote
from mgdd.datasets.files import FILES, LICENCES, place
from mgdd.errors import DataError, ParameterError
from mgdd.io import read, read_pressure
from mgdd.io.angle_column import Reading
from mgdd.io.any_table import TEXT, format_of, read_any_table
from mgdd.io.bench_file import bench_record
from mgdd.io.binary_files import write_netcdf, write_parquet
from mgdd.io.channels import layout_of
from mgdd.io.column_names import stated_unit, stem
from mgdd.io.plain_csv import long_columns, write_long
from mgdd.io.table import Table as FileTable
from mgdd.report import Table
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr

_SERIES = 12  # columns of one name that are shown one by one
_OWN = Options(read, "channels", "pressure_column", "angle_column")
_SPEED = Options(read_pressure, "speed_rpm")
_WRITERS: Mapping[str, Callable[[xr.Dataset, str], None]] = {
    ".nc": write_netcdf,
    ".csv": write_long,
    ".parquet": lambda data, file: write_parquet(long_columns(data), file),
}


def _add_file(parser: Any) -> None:
    option(parser, "file FILE", "text, MATLAB, HDF5, netCDF, TDMS, MDF, Parquet, NumPy or XLSX")
    group = parser.add_argument_group("what the file holds, where it does not say it or says it otherwise")
    for options in (_OWN, _SPEED, READING):
        options.add(group)
    add_encoder(parser)


def _given(args: argparse.Namespace) -> dict[str, Any]:
    return _OWN.given(args) | _SPEED.given(args) | READING.given(args) | encoder_of(args)


def _info(args: argparse.Namespace) -> None:
    options = {name: default_of(read, name) for name in (*_OWN.options, *_SPEED.options, *READING.options)} | _given(
        args
    )
    channels, text = options.pop("channels"), {name: options.pop(name) for name in TEXT}
    table = read_any_table(args.file, **text)
    bench, doubts = None, list[str]()
    taken: dict[tuple[int, ...], str] = {}
    try:
        layout = layout_of(table, Reading(**options))
        bench = bench_record(table, layout, channels, name=Path(args.file).name)
        doubts += bench.attrs["warnings"].splitlines()
        taken = {channel.columns: channel.name for channel in layout.channels}
        slow = [channel for channel in layout.channels if channel.time is not None and channel.name in bench]
        taken |= {(channel.time,): str(bench[channel.name].dims[0]) for channel in slow if channel.time is not None}
        if layout.angle.column is not None:
            taken[(layout.angle.column,)] = ANGLE
    except DataError as error:
        doubts.append(f"not read as cycles: {error}")
    groups = sorted([*taken, *_alone(table, {i for columns in taken for i in columns})])
    columns = [_column(table, group, taken.get(group, ""), bench, doubts) for group in groups]
    shape = {} if bench is None else {str(dim): size for dim, size in bench.sizes.items()}
    payload = {
        "file": args.file, "format": format_of(args.file), "sizes": shape, "columns": columns, "doubts": doubts,
    }  # fmt: skip
    shown = Table(
        columns=("column", "unit", "rows", "lowest", "highest", "taken for", "over"),
        rows=tuple(tuple(map(_cell, column.values())) for column in columns),
    )
    head = f"{args.file}: {payload['format']}{''.join(f', {size} {dim}' for dim, size in shape.items())}\n"
    emit(args, payload, text=[head, shown, *(f"doubtful: {doubt}" for doubt in doubts)])


def _alone(table: FileTable, taken: set[int]) -> list[tuple[int, ...]]:
    """Return the columns that no channel has; those of a long series, as of a column per cycle, together."""
    series: dict[tuple[str, int], list[int]] = {}
    for index in set(range(table.width)) - taken:
        name = stem(table.header[index]) if table.header else ""
        series.setdefault((name, table.lengths[index]), []).append(index)
    long = [tuple(sorted(group)) for group in series.values() if len(group) > _SERIES]
    return [*long, *((index,) for group in series.values() if len(group) <= _SERIES for index in group)]


def _column(
    table: FileTable, group: tuple[int, ...], taken: str, bench: xr.Dataset | None, doubts: list[str]
) -> dict[str, Any]:
    """Describe one column, or the columns of one channel; a cell that is not a number is a doubt of its own."""
    index = group[0]
    header = table.header or tuple(map(str, range(table.width)))
    lowest, highest = None, None
    try:
        values = table.matrix(group)
        if not np.isnan(values).all():
            lowest, highest = float(np.nanmin(values)), float(np.nanmax(values))
    except DataError as error:
        if table.numeric([index]) and not any(str(error) in doubt for doubt in doubts):
            doubts.append(str(error))
    there = bench is not None and taken in bench.variables
    return {
        "name": header[index] if len(group) == 1 else f"{header[index]} ... {header[group[-1]]}",
        "unit": stated_unit(header[index] if table.header else "", table.unit(index)),
        "rows": table.lengths[index],
        "lowest": lowest,
        "highest": highest,
        "taken_for": taken if there else None,
        "raster": ", ".join(map(str, bench[taken].dims)) if there and bench is not None else None,
    }


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _convert(args: argparse.Namespace) -> None:
    _check_written(args)
    bench = read(args.file, **_given(args))
    warn(*bench.attrs["warnings"].splitlines(), of=bench.attrs["file"])
    files = _write(args, [bench])
    payload = {
        "file": files[0],
        "sizes": dict(bench.sizes),
        "channels": list(bench.data_vars),
        "warnings": bench.attrs["warnings"].splitlines(),
    }
    emit(args, payload, text=_written(bench))


def _list(args: argparse.Namespace) -> None:
    rows = [{"name": name, "licence": LICENCES[name], "place": place(name)} for name in FILES]
    table = Table(columns=("name", "place", "licence"), rows=tuple((r["name"], r["place"], r["licence"]) for r in rows))
    emit(args, {"datasets": rows}, text=[table])


def _get(args: argparse.Namespace) -> None:
    _check_written(args)
    found: Any = datasets.read(args.name)
    records = list(found) if isinstance(found, list | tuple) else [found]
    files = _write(args, records)
    payload = {"name": args.name, "licence": LICENCES[args.name], "files": files}
    emit(args, payload, text="\n".join(f"{file}: {_written(each)}" for file, each in zip(files, records, strict=True)))


def _check_written(args: argparse.Namespace) -> None:
    if args.output is None:
        raise ParameterError(f"-o FILE is needed: a name that ends in {', '.join(_WRITERS)}")


def _write(args: argparse.Namespace, records: list[xr.Dataset]) -> list[str]:
    """Write each Dataset into a file of its own, several with a number behind the name."""
    target, args.output = Path(args.output), None  # the object goes to stdout, the data into the files
    files = [str(target.with_stem(f"{target.stem}_{k}")) for k in range(1, len(records) + 1)]
    files = [str(target)] if len(records) == 1 else files
    for file, record in zip(files, records, strict=True):
        _WRITERS[target.suffix](record, file)
        wrote(file)
    return files


def _written(data: xr.Dataset) -> str:
    sizes = ", ".join(f"{size} {dim}" for dim, size in data.sizes.items())
    return f"{', '.join(map(str, data.data_vars))} over {sizes}"


COMMANDS = {
    "info": (_add_file, _info),
    "convert": (_add_file, _convert),
    "list": (None, _list),
    "get": (lambda parser: option(parser, "name", "data set", choices=tuple(FILES)), _get),
}
