"""Seekers on the surrogate of a measured hydrogen-diesel engine: what they find, how fast, what a late sensor costs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import SurrogatePlant, run_seeker
from mgdd.results.labels import labelled_dataset
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.measured_engine_cases import (
    ARRIVAL_CAD,
    LOWER_CAD,
    OBJECTIVES,
    START_CAD,
    UPPER_CAD,
    Case,
    held_objective,
    lag_of,
    measured_records,
    seeker_of,
    tuned_case,
)
from mgdd.studies.measured_engine_figures import draw
from mgdd.studies.statistics import mean_interval, with_interval
from mgdd.surrogate import EngineSurrogate, fit_surrogate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_measured_engine_seek"]

_NAME = "measured-engine-seek"
_CYCLES, _QUICK_CYCLES, _QUICK_SEEDS = 1500, 600, 3
_TAIL = 100


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """Trajectories of one case, one row per seed."""

    estimate: NDArray[np.float64]
    outside: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]


def run_measured_engine_seek(
    *, seeds: int = 20, quick: bool = False, figures: bool = True, progress: Progress | None = None
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
    >>> from mgdd.studies.measured_engine_seek import run_measured_engine_seek
    >>> if "h2df_502" in datasets.available():
    ...     result = run_measured_engine_seek(seeds=1, quick=True, figures=False)
    ...     assert len(result.summary["rows"]) == 12
    """
    seeds = min(check_seeds(seeds), _QUICK_SEEDS if quick else seeds)
    cycles = _QUICK_CYCLES if quick else _CYCLES
    if progress is not None:
        progress("fitting the surrogate")
    surrogate = _surrogate()
    cases = []
    for objective in OBJECTIVES:
        held = held_objective(surrogate, objective)
        cases += [tuned_case(surrogate, objective, name, held) for name in objective.seekers]
    parts = [(f"{case.objective.name}: {case.seeker}", partial(_run, surrogate, case, seeds, cycles)) for case in cases]
    runs, interrupted = run_parts(parts, progress)
    cases = cases[: len(runs)]
    dataset = _dataset(cases, runs, surrogate)
    sensor = surrogate.signals["nox_ppm"].sensor
    lag = lag_of(surrogate, "nox_ppm")
    summary: dict[str, Any] = {
        "study": _NAME,
        "seeds": seeds,
        "cycles": cycles,
        "start_soi_cad": START_CAD,
        "bounds_soi_cad": [LOWER_CAD, UPPER_CAD],
        "nox_delay_cycles": lag.delay_cycles,
        "nox_lag_cycles": lag.lag_cycles,
        "nox_lag_stderr_cycles": sensor.tau_stderr_cycles if sensor is not None else math.nan,
        "records": dict(surrogate.source),
        "interrupted": interrupted,
        "rows": [_row(case, run) for case, run in zip(cases, runs, strict=True)],
    }
    return finish(dataset, summary, draw if figures else None)


def _surrogate() -> EngineSurrogate:
    return fit_surrogate(measured_records(_NAME))


def _run(surrogate: EngineSurrogate, case: Case, seeds: int, cycles: int) -> _Runs:
    estimate, outside = np.empty((seeds, cycles)), np.empty((seeds, cycles))
    signals = {name: np.empty((seeds, cycles)) for name in surrogate.signals}
    for seed in range(seeds):
        plant = SurrogatePlant(
            surrogate, case.objective.weights, limits=list(case.objective.limits), start_soi_cad=START_CAD, seed=seed
        )
        run = run_seeker(plant, seeker_of(case, seed), cycles).dataset
        estimate[seed] = run["estimate"][:, 0]
        outside[seed] = 1.0 - run["supported"]
        for name, column in signals.items():
            column[seed] = run[name]
    return _Runs(estimate=estimate, outside=outside, signals=signals)


def _final(run: _Runs) -> NDArray[np.float64]:
    return np.asarray(run.estimate[:, -_TAIL:].mean(axis=1), dtype=np.float64)


def _arrivals(case: Case, run: _Runs) -> NDArray[np.float64]:
    near = np.abs(run.estimate - case.best["soi_cad"]) <= ARRIVAL_CAD
    return np.where(near.any(axis=1), near.argmax(axis=1), np.nan)


def _row(case: Case, run: _Runs) -> dict[str, Any]:
    final, arrivals = _final(run), _arrivals(case, run)
    later = run.estimate.shape[1] // 2
    reached = np.where(np.isnan(arrivals), np.inf, arrivals)
    median = float(np.median(reached))
    return {
        "objective": case.objective.name,
        "seeker": case.seeker,
        **with_interval("final_soi_cad", final),
        "final_soi_sd_cad": float(final.std(ddof=1)) if final.size > 1 else math.nan,
        "optimum_soi_cad": case.best["soi_cad"],
        "error_cad": float(final.mean() - case.best["soi_cad"]),
        "cycles_to_1_cad": median if math.isfinite(median) else None,
        "ends_within_1_cad_share": float(np.mean(np.abs(final - case.best["soi_cad"]) <= ARRIVAL_CAD)),
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


def _dataset(cases: list[Case], runs: list[_Runs], surrogate: EngineSurrogate) -> xr.Dataset:
    cad, finals = "°CA aTDC", [_final(run) for run in runs]
    estimates = np.stack([run.estimate for run in runs])
    low, median, high = np.quantile(estimates, [0.1, 0.5, 0.9], axis=1)
    every = ("case", "seed")
    ranges = [case.best.bounds["soi_cad"] for case in cases]
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", np.arange(len(cases)), "-", "seeker on objective"),
        "seed": ("seed", np.arange(estimates.shape[1]), "-", "seed"),
        "cycle": ("cycle", np.arange(estimates.shape[2])),
        "objective": ("case", [case.objective.name for case in cases], "-", "objective"),
        "seeker": ("case", [case.seeker for case in cases], "-", "seeker"),
        "optimum_soi_cad": ("case", [case.best["soi_cad"] for case in cases], cad, "optimum of the surrogate"),
        "supported_low_cad": ("case", [low for low, _ in ranges], cad, "earliest supported SOI"),
        "supported_high_cad": ("case", [high for _, high in ranges], cad, "latest supported SOI"),
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
