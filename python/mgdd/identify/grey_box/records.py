"""Records that a model is fitted to: what drives each, what was measured, and which residuals count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd._arguments import as_floats
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.identify.grey_box.model import Drive, GreyBoxModel
from mgdd.signals.even_grid import is_same_step
from mgdd.signals.model import check_horizon, columns_of, table_of


@dataclass(frozen=True)
class Measured:
    """One output of a record: its samples, and the residuals that count, of one sample or between two of them.

    A residual ahead compares the change from sample `since` to sample `kept`; of a free run `since` is None.
    """

    values: NDArray[np.float64]
    kept: NDArray[np.int_]
    since: NDArray[np.int_] | None
    sigma: NDArray[np.float64]

    def of(self, samples: NDArray[Any]) -> NDArray[Any]:
        """Take what the residuals compare of samples, over noise level; more axes may follow."""
        each = samples[self.kept] if self.since is None else samples[self.kept] - samples[self.since]
        weighted: NDArray[Any] = each / self.sigma.reshape(-1, *([1] * (each.ndim - 1)))
        return weighted


@dataclass(frozen=True)
class Record:
    """One record: its table, what drives it, and its outputs."""

    table: Any
    drive: Drive
    outputs: tuple[Measured, ...]


def records_of(given: Any, model: GreyBoxModel, *, skip: int, horizon: int | None, sigma: Any) -> list[Record]:
    """Read one record or a list of them, with one noise level, or that of each."""
    tables = list(given) if _several(given) else [given]
    if len(tables) == 1 or isinstance(sigma, Real | Mapping):
        sigma = [sigma] * len(tables)
    elif len(sigma) != len(tables):
        raise ShapeError.of("sigma", sigma, f"one number, or one entry per record, {len(tables)}")
    records = [_read(table, model, skip, horizon, own) for table, own in zip(tables, sigma, strict=True)]
    steps = [record.drive.step_s for record in records]
    for k, step in enumerate(steps):
        if model.kind != "ode" and not is_same_step(step, steps[0]):
            raise DataError(
                f"record {k} is sampled every {step:g} s, record 0 every {steps[0]:g} s: the parameters of a model in "
                "discrete time belong to one sampling; resample the records, or write an OdeModel"
            )
    return records


def states_of(given: ArrayLike, n_states: int, records: int) -> NDArray[np.float64]:
    """Return the state at the begin of every record, a row each."""
    states = np.array(given, dtype=np.float64)
    if states.ndim == 1:
        states = np.repeat(states[None], records, axis=0)
    if states.shape != (records, n_states) or not np.isfinite(states).all():
        rows = "a vector" if records == 1 else f"a vector, or {records} of them,"
        raise ShapeError(f"initial_state: must be {rows} of finite numbers, one per state")
    return states


def _several(given: Any) -> bool:
    """Whether these are records, and not the columns of one."""
    tables = isinstance(given, list | tuple) and len(given) > 0
    return tables and all(isinstance(each, Mapping) or hasattr(each, "columns") for each in given)


def _read(given: Any, model: GreyBoxModel, skip: int, horizon: int | None, sigma: Any) -> Record:
    names = ("time_s", *model.input_names)
    table = table_of(given, (*names, *model.output_names), what="records")
    time, *inputs = columns_of(table, names, what="records")
    drive = model.drive(time, inputs)
    ParameterError.unless(0 <= skip < time.size, "skip", skip, f"within [0, {time.size - 1}]")
    if horizon is not None:
        check_horizon(horizon, time.size)
    levels = sigma if isinstance(sigma, Mapping) else dict.fromkeys(model.output_names, sigma)
    if set(levels) != set(model.output_names):
        raise ParameterError.of("sigma", list(levels), f"a level for each of {', '.join(model.output_names)}")
    own = [_output(table, name, (*names, name), drive, skip, horizon, levels[name]) for name in model.output_names]
    _ = drive.step_s  # refuses uneven times
    return Record(table, drive, tuple(own))


def _output(
    table: Any, name: str, columns: Sequence[str], drive: Drive, skip: int, horizon: int | None, sigma: Any
) -> Measured:
    n = drive.time_s.size
    if name not in table:
        columns_of(table, columns, what="records")  # says what is there
    measured = as_floats(table[name])
    if measured.shape != (n,):
        raise ShapeError(f"{', '.join(columns)} have shapes {[(n,), measured.shape]}: must be columns of one length")
    if np.isinf(measured).any():
        raise DataError(f"{name}: sample {int(np.argmax(np.isinf(measured)))} is not a finite number")
    levels = np.asarray(sigma, dtype=np.float64)
    if levels.ndim > 0 and levels.shape != (n,):
        raise ShapeError.of("sigma", levels.shape, f"one number, or one per sample, {n}")
    levels = np.broadcast_to(levels, (n,))
    counts = np.isfinite(measured) & (np.arange(n) >= skip)
    kept, since = np.flatnonzero(counts), None
    if horizon is not None:
        kept = kept[(kept >= horizon) & counts[kept - horizon]]
        since = kept - horizon
    if kept.size == 0:
        raise DataError(f"{name}: every sample is missing (NaN) or skipped")
    wrong = ~(np.isfinite(levels[kept]) & (levels[kept] > 0.0))
    ParameterError.unless(not wrong.any(), "sigma", float(levels[kept][int(np.argmax(wrong))]), "> 0")
    return Measured(measured, kept, since, levels[kept])
