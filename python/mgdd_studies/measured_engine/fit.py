"""Fit a surrogate to records of an engine under random steps, measured ones or those of a known engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.results.labels import Label, label_of, labelled_dataset
from mgdd.signals.even_grid import check_count
from mgdd.surrogate.polynomial import PolynomialBasis, support_of
from mgdd_studies.measured_engine.signal_model import SensorLag, SignalModel, find_sensor_lag, lagged
from mgdd_studies.measured_engine.surrogate import STEERED, EngineSurrogate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_FOLDS = 5
_MAX_DELAY = 8  # cycles, of a slow signal
_SETTLE = 40  # cycles of excitation that a slow signal needs before its first row counts


@dataclass(frozen=True, kw_only=True, eq=False)
class _Log:
    """Terms of the command and the rows that count, by row of the log."""

    terms: NDArray[np.float64]
    commands: NDArray[np.float64]
    excited: NDArray[np.bool_]
    split: int  # rows from here on are held out


def fit_surrogate(
    records: xr.Dataset,
    *,
    inputs: Sequence[str] = (STEERED, "doi_main_ms", "doi_h2_ms", "p2m_us"),
    outputs: Sequence[str] = ("imep_bar", "mfb50_cad", "mprr", "nox_ppm"),
    slow: Sequence[str] = ("nox_ppm",),
    nonnegative: Sequence[str] = ("mprr", "nox_ppm"),
    max_lag: int = 5,
    held_out: float = 0.25,
    box: float = 0.99,
    seed: int = 0,
) -> EngineSurrogate:
    """Fit quadratic surfaces of engine signals over its commands, each with its lag from command to log.

    The lag of a fast signal is the one whose surface predicts best in five-fold cross-validation over contiguous
    stretches. A slow signal gets a delay and a first-order lag, found together with its surface by least squares;
    their uncertainty comes from resampling stretches of 250 cycles. Lags are chosen without the held-out last part
    of the records; the surfaces that are kept use all of them.

    Parameters
    ----------
    records : xarray.Dataset
        Inputs and outputs over ``cycle``, which counts up by one. Rows without ``excited`` (where the records have it)
        and NaN outputs are left out.
    inputs : sequence of str
        Commands, ``soi_cad`` first.
    outputs : sequence of str
        Signals.
    slow : sequence of str
        Those behind a slow sensor.
    nonnegative : sequence of str
        Those that cannot be negative; a name that is not an output is ignored.
    max_lag : int
        Highest lag tried for a fast signal [cycles]; 0 to this.
    held_out : float
        Share of the rows, at the end, on which ``r2_held_out`` is computed [-].
    box : float
        Central share of each input that its supported range holds, and of the leverages in it [-].
    seed : int
        Seed of the resampling.

    Returns
    -------
    EngineSurrogate
        Surfaces, support and residuals.

    Raises
    ------
    mgdd.errors.ParameterError
        Inputs that do not begin with ``soi_cad``, a slow signal that is not an output, a share outside (0, 1).
    mgdd.errors.DataError
        A missing column, cycles that do not count up by one, a command that is not finite or does not vary, too few
        usable rows.

    Examples
    --------
    >>> from mgdd_studies.measured_engine import fit_surrogate, random_step_records
    >>> surrogate = fit_surrogate(random_step_records(3000))
    >>> [signal.lag_cycles for signal in surrogate.signals.values()]
    [1, 1, 1, 3]
    """
    names, signals = tuple(inputs), tuple(outputs)
    _check_request(names, signals, tuple(slow), max_lag, held_out, box)
    commands, excited = _read(records, names, signals)
    used = commands[excited]
    centre, scale = used.mean(axis=0), used.std(axis=0)
    flat = [name for name, sd in zip(names, scale, strict=True) if not sd > 0.0]
    if flat:
        raise DataError(f"{flat[0]} does not vary in the records: leave it out of inputs")
    basis = PolynomialBasis.of("quadratic", centre=centre, scale=scale)
    split = round((1.0 - held_out) * len(commands))
    log = _Log(terms=basis(commands), commands=commands, excited=excited, split=split)
    models, left = {}, []
    for name in signals:
        values = records[name].to_numpy().astype(np.float64)
        label = label_of(records[name])
        models[name], residual = _fit_signal(log, values, name, label, slow=name in slow, max_lag=max_lag, seed=seed)
        left.append(residual)
    return EngineSurrogate(
        signals=models,
        support=support_of(used, basis, inputs=names, share=box),
        medians={name: float(m) for name, m in zip(names, np.median(used, axis=0), strict=True)},
        input_labels={n: label_of(records[n]) for n in names},
        nonnegative=tuple(name for name in nonnegative if name in signals),
        residuals=np.column_stack(left),
        source=dict(records.attrs),
    )


def _fit_signal(
    log: _Log, values: NDArray[np.float64], name: str, label: Label, *, slow: bool, max_lag: int, seed: int
) -> tuple[SignalModel, NDArray[np.float64]]:
    rows = np.arange(values.size)
    early = rows < log.split
    scores = {lag: _cross_validated(log, values, lag, early, name) for lag in range(max_lag + 1)}
    lag = max(scores, key=lambda trial: scores[trial])
    sensor: SensorLag | None = None
    if slow:
        last = np.maximum.accumulate(np.where(log.excited, -1, rows))  # row that was not excited
        use = log.excited & (rows - last > _SETTLE) & np.isfinite(values)
        sensor = find_sensor_lag(log.terms, values, use & early, max_delay=_MAX_DELAY, seed=seed)
        lag = sensor.delay_cycles
        terms = lagged(log.terms, delay_cycles=lag, tau_cycles=sensor.tau_cycles)
    else:
        use = _usable(log, values, lag)
        terms = log.terms[np.maximum(rows - lag, 0)]
    _enough(use & early, log, name)
    _enough(use & ~early, log, name)
    before = least_squares_of(terms[use & early], values[use & early])
    coefficients = least_squares_of(terms[use], values[use])
    residual = np.where(use, values - terms @ coefficients, np.nan)
    model = SignalModel(
        name=name,
        label=label,
        coefficients=coefficients,
        lag_cycles=lag,
        lag_scores=scores,
        lag_at_bound=sensor.at_bound if sensor is not None else lag == max_lag,
        sensor=sensor,
        r2=r_squared(values[use], (terms @ coefficients)[use]),
        r2_held_out=r_squared(values[use & ~early], (terms @ before)[use & ~early]),
        residual_sd=float(np.nanstd(residual)),
        cyclic_sd=_cyclic(residual, log, lag),
    )
    return model, residual


def _cross_validated(log: _Log, values: NDArray[np.float64], lag: int, early: NDArray[np.bool_], name: str) -> float:
    """Return the R² of predictions of each fifth of the rows from the other four."""
    use = np.flatnonzero(_usable(log, values, lag) & early)
    _enough(np.isin(np.arange(values.size), use), log, name)
    model = np.empty(use.size)
    for fold in np.array_split(np.arange(use.size), _FOLDS):
        others = np.delete(use, fold)
        model[fold] = log.terms[use[fold] - lag] @ least_squares_of(log.terms[others - lag], values[others])
    return r_squared(values[use], model)


def _usable(log: _Log, values: NDArray[np.float64], lag: int) -> NDArray[np.bool_]:
    """Return the rows with a value whose command, `lag` rows before, was excited as well."""
    source = np.arange(values.size) - lag
    return np.isfinite(values) & log.excited & (source >= 0) & log.excited[np.maximum(source, 0)]


def _cyclic(residual: NDArray[np.float64], log: _Log, lag: int) -> float:
    """Scatter from cycle to cycle under a held SOI: what the surface misses is the same in both and drops out."""
    held = np.abs(np.diff(log.commands[:, 0])) == 0.0
    source = np.maximum(np.arange(residual.size - 1) - lag, 0)
    step = np.diff(residual)[held[source]]
    step = step[np.isfinite(step)]
    return float(np.std(step) / np.sqrt(2.0)) if step.size > 1 else float("nan")


def _enough(use: NDArray[np.bool_], log: _Log, name: str) -> None:
    least = 10 * log.terms.shape[1]
    if np.count_nonzero(use) < least:
        raise DataError(
            f"{name}: {np.count_nonzero(use)} usable cycles in a part of the records: {least} are needed; "
            "give more cycles, fewer inputs or another held_out"
        )


def least_squares_of(terms: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least-squares coefficients, by normal equations: the terms are standardised, so few digits go."""
    return np.asarray(np.linalg.solve(terms.T @ terms, terms.T @ values), dtype=np.float64)


def r_squared(values: NDArray[np.float64], model: NDArray[np.float64]) -> float:
    """Return the coefficient of determination, NaN for values that do not vary."""
    spread = float(np.sum((values - values.mean()) ** 2))
    return 1.0 - float(np.sum((values - model) ** 2)) / spread if spread > 0.0 else float("nan")


def _check_request(
    inputs: tuple[str, ...], outputs: tuple[str, ...], slow: tuple[str, ...], max_lag: int, held_out: float, box: float
) -> None:
    if not inputs or inputs[0] != STEERED or len(set(inputs)) != len(inputs):
        raise ParameterError(f"inputs = {inputs}: must begin with {STEERED!r} and name each command once")
    if not outputs or len(set(outputs)) != len(outputs) or set(outputs) & set(inputs):
        raise ParameterError(f"outputs = {outputs}: must name signals, each once, and no input")
    unknown = [name for name in slow if name not in outputs]
    if unknown:
        raise ParameterError(f"slow: {unknown[0]!r} is not an output: must be one of {', '.join(outputs)}")
    ParameterError.unless(max_lag >= 0, "max_lag", max_lag, ">= 0")
    for what, share in (("held_out", held_out), ("box", box)):
        ParameterError.unless(0.0 < share < 1.0, what, share, "in (0, 1)")


def _read(
    records: xr.Dataset, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    for name in ("cycle", *inputs, *outputs):
        if name not in records.variables:
            raise DataError(f"records have no {name}: they have {', '.join(map(str, records.variables))}")
        if records[name].dims != ("cycle",):
            raise DataError(f"{name} has dims {records[name].dims}: must be ('cycle',)")
    cycle = records["cycle"].to_numpy()
    check_count(cycle)
    commands = np.column_stack([records[name].to_numpy().astype(np.float64) for name in inputs])
    excited = records["excited"].to_numpy().astype(np.bool_) if "excited" in records else np.ones(cycle.size, np.bool_)
    if not np.all(np.isfinite(commands)):
        column = int(np.argmin(np.all(np.isfinite(commands), axis=0)))
        raise DataError(f"{inputs[column]} is not finite in every cycle: repair or cut the records")
    if not excited.any():
        raise DataError("excited is False in every cycle: nothing to fit")
    return commands, excited


_BOX = {"soi_cad": (-8.0, 10.0), "doi_main_ms": (0.25, 0.5), "doi_h2_ms": (2.5, 4.0), "p2m_us": (700.0, 1400.0)}
_LABELS = {
    "soi_cad": ("°CA aTDC", "start of injection"),
    "doi_main_ms": ("ms", "duration of main injection"),
    "doi_h2_ms": ("ms", "duration of hydrogen injection"),
    "p2m_us": ("µs", "pilot-to-main gap"),
    "imep_bar": ("bar", "IMEP"),
    "mfb50_cad": ("°CA aTDC", "MFB50, angle of 50 % burned"),
    "mprr": ("bar/°CA", "maximum pressure rise rate"),
    "nox_ppm": ("ppm", "NOx at the sensor"),
}
_NOISE = {"imep_bar": 0.1, "mfb50_cad": 0.8, "mprr": 0.6, "nox_ppm": 8.0}
_SHARED = 0.6  # correlation of the noise of two signals
_LAG, _DELAY, _TAU = 1, 3, 6.0


def random_step_records(cycles: int = 4000, *, seed: int = 0, noise: float = 1.0) -> xr.Dataset:
    """Make records of a known quadratic engine whose injection is stepped at random."""
    ParameterError.unless(cycles >= 10, "cycles", cycles, ">= 10")
    ParameterError.unless(0.0 <= noise < np.inf, "noise", noise, "finite and >= 0")
    generator = np.random.default_rng(seed)
    holds = generator.integers(1, 31, size=cycles)
    which = np.repeat(np.arange(cycles), holds)[:cycles]
    inputs = {name: generator.uniform(low, high, size=cycles)[which] for name, (low, high) in _BOX.items()}
    independent, shared = generator.standard_normal((cycles, len(_NOISE))), generator.standard_normal((cycles, 1))
    scatter = noise * (np.sqrt(1.0 - _SHARED) * independent + np.sqrt(_SHARED) * shared)
    signals = _law(inputs, cycles)
    for column, (name, sd) in enumerate(_NOISE.items()):
        signals[name] = signals[name] + sd * scatter[:, column]
    variables: dict[str, tuple[object, ...]] = {"cycle": ("cycle", np.arange(cycles), "-", "engine cycle")}
    for name, values in {**inputs, **signals}.items():
        variables[name] = ("cycle", values, *_LABELS[name])
    return labelled_dataset(variables, attrs={"title": "records of a known quadratic engine", "seed": seed})


def _law(inputs: dict[str, np.ndarray], cycles: int) -> dict[str, np.ndarray]:
    rows = np.maximum(np.arange(cycles) - _LAG, 0)
    soi, doi, hydrogen, gap = (inputs[name] for name in _BOX)
    d, h, g = (doi - 0.37) / 0.1, (hydrogen - 3.2) / 0.4, (gap - 1000.0) / 200.0
    fast = {
        "imep_bar": 7.0 + 0.5 * d + 0.4 * h - 0.005 * (soi + 4.0) ** 2,
        "mfb50_cad": 10.0 + soi - 0.4 * h + 0.02 * soi**2,
        "mprr": 4.5 - 0.2 * soi + 0.3 * h * d + 0.2 * g,
    }
    static = 650.0 - 45.0 * soi + 1.5 * soi**2 + 60.0 * d + 40.0 * h
    nox, decay = np.empty(cycles), np.exp(-1.0 / _TAU)
    reading = static[0]
    for k in range(cycles):
        reading = decay * reading + (1.0 - decay) * static[max(k - _DELAY, 0)]
        nox[k] = reading
    return {**{name: values[rows] for name, values in fast.items()}, "nox_ppm": nox}
