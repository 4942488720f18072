"""The surface of one signal of a measured engine, and the lag of its sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError
from mgdd.results.describe import described
from mgdd.results.labels import Label

# Trial time constants [cycles]; the best is refined by a parabola through its neighbours.
_TAUS = np.r_[0.0, np.geomspace(0.5, 40.0, 36)]
_BLOCK = 250  # cycles; longer than the memory of the residual
_RESAMPLES = 200
_NEAR_DELAY, _NEAR_TAU = 2, 4  # cycles, and steps of the trial time constants


@described
@dataclass(frozen=True, kw_only=True)
class SensorLag:
    """Delay and first-order lag of a sensor, as the records show them.

    The reading y follows the static value x by y[k] = a y[k-1] + (1 - a) x[k-D] with a = exp(-1/tau).

    Parameters
    ----------
    delay_cycles : int
        D, from the command to the log [cycles].
    tau_cycles : float
        Time constant [cycles].
    tau_stderr_cycles : float
        Standard error of the time constant over resampled blocks, D free as well [cycles].
    delay_share : mapping of int to float
        Share of the resamples that chose each delay [-].
    total_cycles : float
        D + tau [cycles]: better known than its parts, which trade against each other.
    total_stderr_cycles : float
        Its standard error [cycles].
    at_bound : bool
        Whether delay or time constant lies on the edge of what was searched.
    """

    delay_cycles: int
    tau_cycles: float
    tau_stderr_cycles: float
    delay_share: Mapping[int, float]
    total_cycles: float
    total_stderr_cycles: float
    at_bound: bool


def decay_of(tau_cycles: float) -> float:
    """Return exp(-1/tau), 0 for no lag."""
    return math.exp(-1.0 / tau_cycles) if tau_cycles > 0.0 else 0.0


def lagged(terms: NDArray[np.float64], *, delay_cycles: int, tau_cycles: float) -> NDArray[np.float64]:
    """Return the terms as the sensor sees them, row by row of the log, from steady state before the first row."""
    return _delayed(_smooth(terms, tau_cycles), delay_cycles)


def _smooth(terms: NDArray[np.float64], tau_cycles: float) -> NDArray[np.float64]:
    from scipy.signal import lfilter

    decay = decay_of(tau_cycles)
    smooth, _ = lfilter([1.0 - decay], [1.0, -decay], terms, axis=0, zi=decay * terms[:1])
    return np.asarray(smooth, dtype=np.float64)


def _delayed(terms: NDArray[np.float64], delay_cycles: int) -> NDArray[np.float64]:
    return terms[np.maximum(np.arange(len(terms)) - delay_cycles, 0)]


def find_sensor_lag(
    terms: NDArray[np.float64], values: NDArray[np.float64], use: NDArray[np.bool_], *, max_delay: int, seed: int = 0
) -> SensorLag:
    """Find delay and time constant; `use` marks the rows of the log that count."""
    edges = range(0, use.size, _BLOCK)
    parts = [np.flatnonzero(use[start : start + _BLOCK]) + start for start in edges]
    blocks = [part for part in parts if part.size]
    if len(blocks) < 4:
        raise DataError(f"{int(use.sum())} usable cycles: a sensor lag needs more than {3 * _BLOCK}")
    delays = np.arange(max_delay + 1)
    grams = np.empty((delays.size, _TAUS.size, len(blocks), terms.shape[1] + 1, terms.shape[1] + 1))
    for at, tau in enumerate(_TAUS):
        smooth = _smooth(terms, float(tau))
        for trial in range(max_delay + 1):
            both = np.column_stack([_delayed(smooth, trial), values])
            grams[trial, at] = [both[rows].T @ both[rows] for rows in blocks]
    cost = _costs(grams.sum(axis=2))
    delay, tau, near = _minimum(cost, delays, _TAUS)
    # Resamples search near the best only: far away they would have to miss most of the records.
    some = (
        slice(max(delay - _NEAR_DELAY, 0), delay + _NEAR_DELAY + 1),
        slice(max(near - _NEAR_TAU, 0), near + _NEAR_TAU + 1),
    )
    flat = np.ascontiguousarray(np.moveaxis(grams[some], 2, 0)).reshape(len(blocks), -1)
    shape = (*cost[some].shape, *grams.shape[-2:])
    counts = np.random.default_rng(seed).multinomial(len(blocks), np.full(len(blocks), 1.0 / len(blocks)), _RESAMPLES)
    minima = [
        _minimum(_costs(summed.reshape(shape)), delays[some[0]], _TAUS[some[1]])[:2]
        for summed in counts.astype(np.float64) @ flat
    ]
    many, taus = np.array([d for d, _ in minima]), np.array([t for _, t in minima])
    return SensorLag(
        delay_cycles=delay,
        tau_cycles=tau,
        tau_stderr_cycles=float(np.std(taus, ddof=1)),
        delay_share={int(d): float(np.mean(many == d)) for d in np.unique(many)},
        total_cycles=delay + tau,
        total_stderr_cycles=float(np.std(many + taus, ddof=1)),
        at_bound=bool(delay == max_delay or tau >= _TAUS[-1]),
    )


def _costs(gram: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the residual sum of squares of each regression: what the last pivot of its Gram matrix leaves."""
    normal, right = gram[..., :-1, :-1], gram[..., :-1, -1:]
    explained = np.swapaxes(right, -1, -2) @ np.linalg.solve(normal, right)
    return np.asarray(gram[..., -1, -1] - explained[..., 0, 0], dtype=np.float64)


def _minimum(cost: NDArray[np.float64], delays: NDArray[np.intp], taus: NDArray[np.float64]) -> tuple[int, float, int]:
    """Return delay, time constant and the index of the latter's nearest trial."""
    row, at = (int(i) for i in np.unravel_index(int(np.argmin(cost)), cost.shape))
    delay = int(delays[row])
    if not 0 < at < taus.size - 1:
        return delay, float(taus[at]), at
    parabola = np.polyfit(taus[at - 1 : at + 2] - taus[at], cost[row, at - 1 : at + 2] / cost[row, at], 2)
    return delay, float(taus[at] - 0.5 * parabola[1] / parabola[0]), at


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class SignalModel:
    """The surface of one signal, and how well it does.

    Parameters
    ----------
    name : str
        The signal.
    label : Label
        Unit and long name.
    coefficients : ndarray, shape (p,)
        Of the terms of `Support.basis`, in the unit of the signal.
    lag_cycles : int
        From the command to the log; of a slow signal the delay before its lag [cycles].
    lag_scores : mapping of int to float
        Cross-validated R² of the static surface at each lag [-].
    lag_at_bound : bool
        Whether the lag lies on the upper edge of what was searched.
    sensor : SensorLag or None
        The dynamics of a slow signal.
    r2 : float
        R² over all records used [-].
    r2_held_out : float
        R² on the last part of the records, from a fit to the part before [-].
    residual_sd : float
        Standard deviation of record minus model, in the unit of the signal.
    cyclic_sd : float
        The part of it from one cycle to the next while the command is held; the rest is what the surface misses.
    """

    name: str
    label: Label
    coefficients: NDArray[np.float64]
    lag_cycles: int
    lag_scores: Mapping[int, float]
    lag_at_bound: bool
    sensor: SensorLag | None
    r2: float
    r2_held_out: float
    residual_sd: float
    cyclic_sd: float
