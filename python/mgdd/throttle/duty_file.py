"""A duty over time from a text file, checked row by row before it is simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, argument
from mgdd.io.table import Place, read_table
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

_SIGNALS = ("supply_v", "airflow_torque_nm")


def read_duty(path: str | os.PathLike[str], given: Mapping[str, float]) -> dict[str, Any]:
    """Read what `mgdd.throttle.simulate_throttle` takes: ``time_s``, ``duty``, and other signals that the file has.

    A column of a `given` constant contradicts it.
    """
    table = read_table(path)
    header = table.header
    if header is None:
        raise DataError(f"{path}: no header: name the columns, at least time_s,duty")
    table.require_units_of_names()
    for name in given:
        if name in header:
            raise ParameterError(f"{argument(name)} and the column {name} of {path} contradict each other: give one")
    names = ("time_s", "duty", *(name for name in _SIGNALS if name in header))
    out: dict[str, Any] = {name: table.numbers(table.index(name)) for name in names}
    place = Place(table.source, table.lines)
    even_step(out["time_s"], where=lambda at: place.cell(at, "time_s"), remedy="resample the duty first")
    duty, supply = out["duty"], out.get("supply_v", np.zeros(1))
    if np.abs(duty).max() > 1.0:
        at = int(np.argmax(np.abs(duty) > 1.0))
        raise DataError(
            f"{place.cell(at, 'duty')}: duty = {duty[at]:g}: must be in [-1, 1]; a duty in percent is divided by 100"
        )
    if supply.min() < 0.0:
        at = int(np.argmax(supply < 0.0))
        raise DataError(f"{place.cell(at, 'supply_v')}: supply_v = {supply[at]:g} V: must be >= 0")
    return out | dict(given)
