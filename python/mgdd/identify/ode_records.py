"""Records that an equation is fitted to: what drives each, what was measured, and which samples count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd._arguments import as_floats
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify.ode_model import Drive, Interpolation
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import columns_of, table_of


@dataclass(frozen=True)
class OdeRecord:
    """One record: its inputs, its output, and the samples that count, with their noise level."""

    table: Any
    drive: Drive
    measured: NDArray[np.float64]
    kept: NDArray[np.int_]
    sigma: NDArray[np.float64]


def records_of(
    given: Any, names: Sequence[str], *, interpolation: Interpolation, substeps: int, skip: int, sigma: Any
) -> list[OdeRecord]:
    """Read one record or a list of them, with one noise level, or that of each."""
    tables = list(given) if _several(given) else [given]
    if len(tables) == 1 or isinstance(sigma, Real):
        sigma = [sigma] * len(tables)
    elif len(sigma) != len(tables):
        raise ShapeError.of("sigma", sigma, f"one number, or one entry per record, {len(tables)}")
    return [_read(table, names, interpolation, substeps, skip, own) for table, own in zip(tables, sigma, strict=True)]


def states_of(given: ArrayLike, records: int) -> NDArray[np.float64]:
    """Return the state at the begin of every record, a row each."""
    states = np.array(given, dtype=np.float64)
    if states.ndim == 1:
        states = np.repeat(states[None], records, axis=0)
    if states.ndim != 2 or states.shape[0] != records or not np.isfinite(states).all():
        rows = "a vector" if records == 1 else f"a vector, or {records} of them,"
        raise ShapeError(f"initial_state: must be {rows} of finite numbers, one per state")
    return states


def _several(given: Any) -> bool:
    """Whether these are records, and not the columns of one."""
    tables = isinstance(given, list | tuple) and len(given) > 0
    return tables and all(isinstance(each, Mapping) or hasattr(each, "columns") for each in given)


def _read(
    given: Any, names: Sequence[str], interpolation: Interpolation, substeps: int, skip: int, sigma: Any
) -> OdeRecord:
    table, name = table_of(given, names, what="records"), names[-1]
    time, *inputs = columns_of(table, names[:-1], what="records")
    even_step(time)
    if name not in table:
        columns_of(table, [name], what="records")  # says what is there
    measured, n = as_floats(table[name]), time.size
    if measured.shape != (n,):
        raise ShapeError(f"{', '.join(names)} have shapes {[(n,), measured.shape]}: must be columns of one length")
    if np.isinf(measured).any():
        raise DataError(f"{name}: sample {int(np.argmax(np.isinf(measured)))} is not a finite number")
    ParameterError.unless(0 <= skip < n, "skip", skip, f"within [0, {n - 1}]")
    levels = np.asarray(sigma, dtype=np.float64)
    if levels.ndim > 0 and levels.shape != (n,):
        raise ShapeError.of("sigma", levels.shape, f"one number, or one per sample, {n}")
    levels = np.broadcast_to(levels, (n,))
    kept = np.flatnonzero(np.isfinite(measured) & (np.arange(n) >= skip))
    if kept.size == 0:
        raise DataError(f"{name}: every sample is missing (NaN) or skipped")
    wrong = ~(np.isfinite(levels[kept]) & (levels[kept] > 0.0))
    ParameterError.unless(not wrong.any(), "sigma", float(levels[kept][int(np.argmax(wrong))]), "> 0")
    drive = Drive(time, np.column_stack(inputs), substeps, interpolation)
    return OdeRecord(table, drive, measured, kept, levels[kept])
