"""The error of predictions that start anew at every sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.identify.throttle.free_run import LOG_COLUMNS, discarded
from mgdd.results.labels import labelled_dataset
from mgdd.results.model import Model
from mgdd.signals.even_grid import even_step
from mgdd.signals.metrics import rmse
from mgdd.signals.model import columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

HORIZONS_S = (0.005, 0.020, 0.050)
_WHOLE = 1e-6


def n_step_rms(
    model: Model,
    log: xr.Dataset,
    *,
    horizons_s: Sequence[float] | None = None,
    true_deg: ArrayLike | None = None,
) -> xr.Dataset:
    """Give the error of predictions that start anew from the measurement at every sample."""
    time, _, angle = columns_of(log, LOG_COLUMNS)
    truth = angle if true_deg is None else np.asarray(true_deg, dtype=np.float64)
    step = even_step(time)
    horizons_s = whole_horizons(step, time.size) if horizons_s is None else horizons_s
    skip = discarded(step, time.size)
    table = np.empty((2, len(horizons_s)))
    for at, horizon in enumerate(horizons_s):
        n = samples_of(horizon, step, time.size)
        ahead = model.predict(log, n)["angle_deg"].to_numpy()
        if ahead.shape != (time.size - n,):
            raise DataError(f"predict gave {ahead.shape} values {n} samples ahead: must be ({time.size - n},)")
        target = truth[n:][skip:]
        table[:, at] = rmse(target, ahead[skip:]), rmse(target, angle[: time.size - n][skip:])
    return labelled_dataset(
        {
            "predictor": ("predictor", [str(model.kind), "persistence"], "-", "predictor"),
            "horizon_s": ("horizon_s", np.asarray(horizons_s, dtype=np.float64), "s", "horizon"),
            "n_step_rms_deg": (("predictor", "horizon_s"), table, "deg", "RMS error ahead"),
        }
    )


def whole_horizons(step_s: float, size: int) -> tuple[float, ...]:
    """5, 20 and 50 ms in whole samples, at least one; what a log samples too coarsely or is too short for falls out."""
    samples = sorted({max(1, round(horizon / step_s)) for horizon in HORIZONS_S})
    return tuple(n * step_s for n in samples if n <= max(1, size // 2))


def samples_of(horizon_s: float, step_s: float, size: int) -> int:
    """Give how many whole samples a horizon is; ParameterError where it is none, or more than half of the log."""
    n = round(horizon_s / step_s)
    if n < 1 or abs(n * step_s - horizon_s) > _WHOLE * step_s * max(n, 1) + 1e-9:
        raise ParameterError(f"horizons_s: {horizon_s:g} s is not a whole number of samples of {step_s:g} s")
    if n > size // 2:
        raise ParameterError(f"horizons_s: {horizon_s:g} s is more than half of the log, {size * step_s:g} s")
    return n
