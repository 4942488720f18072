"""Seekers on the surrogate of a measured hydrogen-diesel engine: what they find, how fast, what a late sensor costs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import datasets
from mgdd.errors import DataError
from mgdd.identify import EngineSurrogate, SurrogateEngine, SurrogateOptimum, fit_surrogate
from mgdd.optimize import (
    BoundedSeeking,
    ComponentLag,
    ExtremumSeeking,
    GoldenSection,
    Limit,
    NewtonSeeking,
    Spsa,
    Tuning,
    tune,
)
from mgdd.results import labelled_dataset
from mgdd.studies.base import Progress, StudyResult, check_seeds, run_parts
from mgdd.studies.h2df_figures import draw
from mgdd.studies.statistics import mean_interval, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Seeker = ExtremumSeeking | NewtonSeeking | BoundedSeeking | Spsa | GoldenSection

__all__ = ["run_h2df_seek"]

_NAME = "h2df-seek"
_MPRR_LIMIT = 5.0
_NOX_WEIGHT = 0.001  # bar per ppm; its optimum lies well inside the records
_START_CAD, _LOWER_CAD, _UPPER_CAD = 8.0, -9.0, 11.0  # the bounds leave the records by one or two degrees
_CYCLES, _QUICK_CYCLES, _QUICK_SEEDS = 1500, 600, 3
_TAIL = 100
_ARRIVAL_CAD = 1.0
_AMPLITUDE_CAD = 2.0
_WISHED_CYCLES = 400.0
_HOLD_CYCLES, _HOLD_SEED = 4000, 10_000  # of the noise measurement, apart from all seeds of the runs
_HESSIAN_RATE, _RICCATI_RATE, _NEWTON_PERIODS = 0.03, 0.02, 10  # rates of a period of ten cycles
_SEEKERS = ("batch", "newton", "spsa", "golden", "bounded")
_DITHERED = ("batch", "newton")


@dataclass(frozen=True, kw_only=True)
class _Objective:
    """What is maximised: signals by weight, their limits, and whether the seekers know of the lag."""

    name: str
    weights: Mapping[str, float]
    limits: Mapping[str, float] = field(default_factory=dict)
    compensated: bool = False
    seekers: tuple[str, ...] = _SEEKERS


_BOTH = {"imep_bar": 1.0, "nox_ppm": -_NOX_WEIGHT}
_OBJECTIVES = (
    _Objective(name="IMEP, pressure rise ≤ 5", weights={"imep_bar": 1.0}, limits={"mprr": _MPRR_LIMIT}),
    _Objective(name="IMEP − 0.001 NOx, lag known", weights=_BOTH, compensated=True, seekers=_DITHERED),
    _Objective(name="IMEP − 0.001 NOx, lag ignored", weights=_BOTH),
)


@dataclass(frozen=True, kw_only=True)
class _Case:
    """One seeker on one objective, tuned."""

    objective: _Objective
    seeker: str
    best: SurrogateOptimum
    free: SurrogateOptimum
    curvature: float
    tuning: Tuning
    noise_sd: float
    lags: tuple[ComponentLag, ...]


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """Trajectories of one case, one row per seed."""

    estimate: NDArray[np.float64]
    outside: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]


def run_h2df_seek(
    *,
    seeds: int = 20,
    quick: bool = False,
    figures: bool = True,
    progress: Progress | None = None,
) -> StudyResult:
    """Let every seeker look for the best injection timing of the measured hydrogen-diesel engine.

    The surrogate of the records keeps their residuals, drawn in stretches, so that scatter has its measured size and
    memory. Each seeker is tuned by `mgdd.optimize.tune` from the curvature of the surface and from noise that is
    measured while the timing is held: at the period of the dither, or between neighbouring cycles for those that
    compare neighbours. Objectives: IMEP under a limit of the pressure rise; IMEP less weighted NOx, whose sensor is
    late, once with the lag of each component turned back and once with the lag ignored.

    Parameters
    ----------
    seeds : int
        Runs per seeker and objective.
    quick : bool
        At most three seeds and 600 instead of 1500 cycles.
    figures : bool
        Whether to draw.
    progress : callable, optional
        Called with a few words before each seeker.

    Returns
    -------
    StudyResult
        ``summary["rows"]``: per objective and seeker the mean final timing with its 95 % interval over the seeds, the
        optimum of the surrogate, the error, the median of the first cycle within 1 °CA (None if fewer than half of the
        runs get there; a run may pass and go on), the share of runs that end there, and the share of cycles outside
        the records.

    Raises
    ------
    mgdd.errors.DataError
        The records are not at hand.
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    A. Winkler, V. Sharma, D. Gordon, A. Norouzi, H2dfDnnTrainExpData, Zenodo doi 10.5281/zenodo.16902579.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.studies.h2df_seek import run_h2df_seek
    >>> if "h2df_502" in datasets.available():
    ...     result = run_h2df_seek(seeds=1, quick=True, figures=False)
    ...     assert len(result.summary["rows"]) == 12
    """
    seeds = min(check_seeds(seeds), _QUICK_SEEDS if quick else seeds)
    cycles = _QUICK_CYCLES if quick else _CYCLES
    if progress is not None:
        progress("fitting the surrogate")
    surrogate = _surrogate()
    cases = []
    for objective in _OBJECTIVES:
        held = _held_objective(surrogate, objective)
        cases += [_case(surrogate, objective, name, held) for name in objective.seekers]
    parts = [(f"{case.objective.name}: {case.seeker}", partial(_run, surrogate, case, seeds, cycles)) for case in cases]
    runs, interrupted = run_parts(parts, progress)
    cases = cases[: len(runs)]
    dataset = _dataset(cases, runs, surrogate)
    sensor = surrogate.signals["nox_ppm"].sensor
    lag = _lag_of(surrogate, "nox_ppm")
    summary: dict[str, Any] = {
        "study": _NAME,
        "seeds": seeds,
        "cycles": cycles,
        "start_soi_cad": _START_CAD,
        "bounds_soi_cad": [_LOWER_CAD, _UPPER_CAD],
        "nox_delay_cycles": lag.delay_cycles,
        "nox_lag_cycles": lag.lag_cycles,
        "nox_lag_stderr_cycles": sensor.tau_stderr_cycles if sensor is not None else math.nan,
        "records": dict(surrogate.source),
        "interrupted": interrupted,
        "rows": [_row(case, run) for case, run in zip(cases, runs, strict=True)],
    }
    return StudyResult(name=_NAME, dataset=dataset, figures=draw(dataset) if figures else {}, summary=summary)


def _surrogate() -> EngineSurrogate:
    try:
        records = datasets.load_h2df_cycles()
    except FileNotFoundError as error:
        raise DataError(
            f"the study {_NAME} needs the records of the hydrogen-diesel engine: {error.strerror}; the page "
            "'A measured engine' says where they come from"
        ) from error
    return fit_surrogate(records)


def _lag_of(surrogate: EngineSurrogate, name: str) -> ComponentLag:
    """Return what stands between the command and a signal beyond the lag of the fastest one."""
    signal = surrogate.signals[name]
    first = min(model.lag_cycles for model in surrogate.signals.values())
    tau = signal.sensor.tau_cycles if signal.sensor is not None else 0.0
    return ComponentLag(delay_cycles=float(signal.lag_cycles - first), lag_cycles=tau)


def _case(surrogate: EngineSurrogate, objective: _Objective, seeker: str, held: NDArray[np.float64]) -> _Case:
    best = surrogate.optimum(objective.weights, objective.limits)
    free = surrogate.optimum(objective.weights)
    around = surrogate.predict(free.soi_cad + np.array([-0.5, 0.0, 0.5]))
    j = np.sum([weight * around[name].to_numpy() for name, weight in objective.weights.items()], axis=0)
    curvature = float(j[0] - 2.0 * j[1] + j[2]) / 0.25
    lags = tuple(_lag_of(surrogate, name) for name in objective.weights) if objective.compensated else ()
    if seeker in ("spsa", "golden"):
        noise = float(np.std(np.diff(held))) / math.sqrt(2.0)
        tuning = _tuned(noise, curvature, best, ComponentLag(), "spsa")
    else:
        late = max(lags, key=lambda lag: lag.delay_cycles + lag.lag_cycles, default=ComponentLag())
        period = _tuned(1.0, curvature, best, late, "batch").period
        noise = _noise_at(held, period)
        tuning = _tuned(noise, curvature, best, late, "batch")
    return _Case(
        objective=objective,
        seeker=seeker,
        best=best,
        free=free,
        curvature=curvature,
        tuning=tuning,
        noise_sd=noise,
        lags=lags,
    )


def _tuned(noise: float, curvature: float, best: SurrogateOptimum, lag: ComponentLag, method: str) -> Tuning:
    return tune(
        noise,
        curvature,
        method=method,
        delay_cycles=lag.delay_cycles,
        lag_cycles=lag.lag_cycles,
        cycles=_WISHED_CYCLES,
        distance=abs(_START_CAD - best.soi_cad),
        arrival=_ARRIVAL_CAD,
        amplitude_max=_AMPLITUDE_CAD,
    )


def _held_objective(surrogate: EngineSurrogate, objective: _Objective) -> NDArray[np.float64]:
    """Measure J while the timing is held at the start."""
    engine = SurrogateEngine(surrogate, start_soi_cad=_START_CAD, seed=_HOLD_SEED)
    rows = [engine.step(_START_CAD) for _ in range(_HOLD_CYCLES)]
    return np.array([sum(w * row[name] for name, w in objective.weights.items()) for row in rows])


def _noise_at(held: NDArray[np.float64], period: int) -> float:
    """Return the white noise that would disturb a dither of this period as much as the measured one does."""
    windows = held[: held.size // period * period].reshape(-1, period)
    wave = np.exp(2j * np.pi * np.arange(period) / period)
    return float(np.sqrt(np.mean(np.abs(windows @ wave) ** 2) / period))


def _seeker(case: _Case, seed: int) -> Seeker:
    space: dict[str, Any] = {"start": _START_CAD, "lower": _LOWER_CAD, "upper": _UPPER_CAD}
    space["limits"] = [Limit(name, upper) for name, upper in case.objective.limits.items()]
    t, bend = case.tuning, abs(case.curvature)
    components = list(case.lags) or None
    if case.seeker == "batch":
        return ExtremumSeeking(
            **space, amplitude=t.amplitude, period=t.period, gain=t.gain, rate=t.rate, components=components
        )
    if case.seeker == "newton":
        slow = t.period / 10.0
        return NewtonSeeking(
            **space,
            amplitude=t.amplitude,
            period=t.period,
            time_constant_cycles=t.time_constant_cycles,
            hessian_rate=_HESSIAN_RATE / slow,
            riccati_rate=_RICCATI_RATE / slow,
            initial_hessian=-bend,
            initial_inverse=-1.0 / bend,
            largest_inverse=2.0 / bend,
            hold_cycles=_NEWTON_PERIODS * t.period,
            components=components,
        )
    if case.seeker == "spsa":
        return Spsa(**space, schedule="constant", gain=t.gain, perturbation=t.amplitude, step_max=t.rate, seed=seed)
    if case.seeker == "golden":
        return GoldenSection(**space, noise_sd=case.noise_sd)
    omega = 2.0 * math.pi / t.period
    kappa = 2.0 / (t.amplitude**2 * omega * bend * t.time_constant_cycles)
    return BoundedSeeking(**space, amplitude=t.amplitude, period=t.period, kappa=kappa)


def _run(surrogate: EngineSurrogate, case: _Case, seeds: int, cycles: int) -> _Runs:
    weights, limits = case.objective.weights, case.objective.limits
    estimate, outside = np.empty((seeds, cycles)), np.empty((seeds, cycles))
    signals = {name: np.empty((seeds, cycles)) for name in surrogate.signals}
    for seed in range(seeds):
        seeker = _seeker(case, seed)
        engine = SurrogateEngine(surrogate, start_soi_cad=_START_CAD, seed=seed)
        for cycle in range(cycles):
            estimate[seed, cycle] = seeker.estimate[0]
            reading = engine.step(float(seeker.ask()[0]))
            terms = np.array([weight * reading[name] for name, weight in weights.items()])
            told = terms if case.lags else terms.sum()
            seeker.tell(told, [reading[name] for name in limits] if limits else None)
            outside[seed, cycle] = not reading["supported"]
            for name, column in signals.items():
                column[seed, cycle] = reading[name]
    return _Runs(estimate=estimate, outside=outside, signals=signals)


def _final(run: _Runs) -> NDArray[np.float64]:
    return np.asarray(run.estimate[:, -_TAIL:].mean(axis=1), dtype=np.float64)


def _arrivals(case: _Case, run: _Runs) -> NDArray[np.float64]:
    near = np.abs(run.estimate - case.best.soi_cad) <= _ARRIVAL_CAD
    return np.where(near.any(axis=1), near.argmax(axis=1), np.nan)


def _row(case: _Case, run: _Runs) -> dict[str, Any]:
    final, arrivals = _final(run), _arrivals(case, run)
    later = run.estimate.shape[1] // 2
    reached = np.where(np.isnan(arrivals), np.inf, arrivals)
    median = float(np.median(reached))
    return {
        "objective": case.objective.name,
        "seeker": case.seeker,
        **with_interval("final_soi_cad", final),
        "final_soi_sd_cad": float(final.std(ddof=1)) if final.size > 1 else math.nan,
        "optimum_soi_cad": case.best.soi_cad,
        "error_cad": float(final.mean() - case.best.soi_cad),
        "cycles_to_1_cad": median if math.isfinite(median) else None,
        "ends_within_1_cad_share": float(np.mean(np.abs(final - case.best.soi_cad) <= _ARRIVAL_CAD)),
        "outside_share": float(run.outside.mean()),
        "mean_imep_bar": float(run.signals["imep_bar"][:, later:].mean()),
        "mean_pressure_rise": float(run.signals["mprr"][:, later:].mean()),
        "mean_nox_ppm": float(run.signals["nox_ppm"][:, later:].mean()),
        "noise_sd": case.noise_sd,
        "curvature_per_cad2": case.curvature,
        "period_cycles": case.tuning.period,
        "amplitude_cad": case.tuning.amplitude,
    }


def _half_interval(values: NDArray[np.float64]) -> float:
    mean, _, high = mean_interval(values)
    return high - mean


def _dataset(cases: list[_Case], runs: list[_Runs], surrogate: EngineSurrogate) -> xr.Dataset:
    cad, finals = "°CA aTDC", [_final(run) for run in runs]
    estimates = np.stack([run.estimate for run in runs])
    low, median, high = np.quantile(estimates, [0.1, 0.5, 0.9], axis=1)
    every = ("case", "seed")
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", np.arange(len(cases)), "-", "seeker on objective"),
        "seed": ("seed", np.arange(estimates.shape[1]), "-", "seed"),
        "cycle": ("cycle", np.arange(estimates.shape[2])),
        "objective": ("case", [case.objective.name for case in cases], "-", "objective"),
        "seeker": ("case", [case.seeker for case in cases], "-", "seeker"),
        "optimum_soi_cad": ("case", [case.best.soi_cad for case in cases], cad, "optimum of the surrogate"),
        "supported_low_cad": ("case", [case.best.range_cad[0] for case in cases], cad, "earliest supported SOI"),
        "supported_high_cad": ("case", [case.best.range_cad[1] for case in cases], cad, "latest supported SOI"),
        "final_soi_cad": (every, finals, cad, "mean estimate of the last 100 cycles"),
        "final_soi_interval_cad": (
            "case",
            [_half_interval(f) for f in finals],
            "°CA",
            "half 95 % interval of its mean",
        ),
        "cycles_to_1_cad": (
            every,
            [_arrivals(case, run) for case, run in zip(cases, runs, strict=True)],
            "cycle",
            "first cycle within 1 °CA of the optimum",
        ),
        "outside_share": (every, [r.outside.mean(axis=1) for r in runs], "-", "share of cycles outside the records"),
        "estimate_low_cad": (("case", "cycle"), low, cad, "estimate, 10 % of the seeds below"),
        "estimate_median_cad": (("case", "cycle"), median, cad, "estimate, median of the seeds"),
        "estimate_high_cad": (("case", "cycle"), high, cad, "estimate, 10 % of the seeds above"),
    }
    return labelled_dataset(variables, attrs=dict(surrogate.source))
