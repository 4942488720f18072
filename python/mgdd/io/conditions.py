"""Operating conditions of a set of traces: one CSV row per trace."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.io.angles import CONVENTION
from mgdd.io.table import parse_number, read_table

if TYPE_CHECKING:
    import os

__all__ = ["CONDITIONS", "read_conditions"]

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
    r"""Read the operating conditions of several traces.

    Parameters
    ----------
    path : path-like
        CSV with a header. Column ``file`` names the trace; ``load_percent`` [%], ``speed_rpm`` [rpm],
        ``trapped_mass_g`` [g per cycle], ``soi_cad`` and ``spark_cad`` (start of injection, spark timing [°CA aTDC]),
        ``intake_pressure_kpa`` [kPa], ``intake_temperature_k`` and ``ivc_temperature_k`` [K], ``fuel_mg`` [mg per
        cycle, 0 = motored], ``bmep_bar`` [bar], ``brake_torque_nm`` [N m] of all ``n_cylinders`` are optional, and so
        is every cell in them.

    Returns
    -------
    dict
        ``{file: {column: value}}`` in the order of the rows; an empty cell has no entry.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        No column ``file``, an unknown column, a trace named twice, a value that is not a number or out of
        bounds.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io import read_conditions
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "conditions.csv"
    ...     _ = file.write_text("file,speed_rpm,soi_cad\nmean.csv,1200,-5.06\n")
    ...     read_conditions(file)
    {'mean.csv': {'speed_rpm': 1200.0, 'soi_cad': -5.06}}
    """
    table = read_table(path, units_row=False)
    header = table.header
    if header is None or "file" not in header:
        raise DataError(f"{table.source}: the header needs a column 'file' that names each trace")
    unknown = [name for name in header if name != "file" and name not in _BOUNDS]
    if unknown or len(set(header)) != len(header):
        known = ", ".join(map(repr, ("file", *_BOUNDS)))
        raise DataError(f"{table.source}: unknown or repeated column in {header}: known are {known}, once each")
    conditions: dict[str, dict[str, float]] = {}
    for line, row in zip(table.lines, table.rows, strict=True):
        cells = dict(zip(header, row, strict=True))
        name = cells.pop("file")
        if not name or name in conditions:
            raise DataError(f"{table.source}, line {line}: file = {name!r}: name every trace, each once")
        conditions[name] = {
            column: _value(cell, column, f"{table.source}, line {line}") for column, cell in cells.items() if cell
        }
    return conditions


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
