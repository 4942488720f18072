"""Seekers on the surrogate of a measured hydrogen-diesel engine: what they find, how fast, what a late sensor costs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import run_seeker
from mgdd.plot.style import BLACK, GREY, LINE_STYLES, axis_label, legend, minus, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant, fit_surrogate
from mgdd_studies.measured_engine_cases import (
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
from mgdd_studies.statistics import (
    OF_SEEDS,
    band_variables,
    first_within,
    mean_interval,
    sd_of,
    with_interval,
    with_median_interval,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_measured_engine_seek"]

_NAME = "measured-engine-seek"
_CYCLES, _QUICK_CYCLES, _QUICK_SEEDS = 1500, 600, 3
_TAIL = 100


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """Trajectories of one case, one row per seed."""

    case: Case
    estimate: NDArray[np.float64]
    outside: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]

    @property
    def final(self) -> NDArray[np.float64]:
        return np.asarray(self.estimate[:, -_TAIL:].mean(axis=1), dtype=np.float64)

    @property
    def arrivals(self) -> NDArray[np.float64]:
        return np.array([first_within(own, self.case.best["soi_cad"], ARRIVAL_CAD) for own in self.estimate])


def run_measured_engine_seek(
    *, n_seeds: int = 20, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Let every seeker look for the best injection timing of the measured hydrogen-diesel engine.

    The surrogate of the records keeps their residuals, drawn in stretches, so that scatter has its measured size and
    memory. Each seeker is tuned by `mgdd.optimize.tune` from the curvature of the surface and from noise that is
    measured while the timing is held: at the period of the dither, or between neighbouring cycles for those that
    compare neighbours. Objectives: IMEP under a limit of the pressure rise; IMEP less weighted NOx, whose sensor is
    late, once with the lag of each component turned back and once with the lag ignored.

    Parameters
    ----------
    n_seeds : int
        Runs per seeker and objective.
    quick : bool
        At most three seeds and 600 instead of 1500 cycles.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

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

    References
    ----------
    A. Winkler, V. Sharma, D. Gordon, A. Norouzi, H2dfDnnTrainExpData, Zenodo doi 10.5281/zenodo.16902579.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd_studies.measured_engine_seek import run_measured_engine_seek
    >>> if "h2df_502" in datasets.names():
    ...     result = run_measured_engine_seek(n_seeds=1, quick=True, figures=False)
    ...     assert len(result.summary["rows"]) == 7
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=_QUICK_SEEDS)
    work = Parts(progress)
    cycles = _QUICK_CYCLES if quick else _CYCLES
    work.progress("fitting the surrogate")
    surrogate = _surrogate()
    cases = []
    for objective in OBJECTIVES:
        held = held_objective(surrogate, objective)
        cases += [tuned_case(surrogate, objective, name, held) for name in objective.seekers]
    runs = work(
        (f"{case.objective.name}: {case.seeker}", partial(_run, surrogate, case, n_seeds, cycles)) for case in cases
    )
    sensor = surrogate.signals["nox_ppm"].sensor
    lag = lag_of(surrogate, "nox_ppm")
    return work.finish(
        _NAME, _dataset(runs, surrogate), _draw if figures else None,
        seeds=n_seeds,
        cycles=cycles,
        start_soi_cad=START_CAD,
        bounds_soi_cad=[LOWER_CAD, UPPER_CAD],
        nox_delay_cycles=lag.delay_cycles,
        nox_lag_cycles=lag.lag_cycles,
        nox_lag_stderr_cycles=sensor.tau_stderr_cycles if sensor is not None else math.nan,
        records=dict(surrogate.source),
        rows=[_row(run) for run in runs],
    )  # fmt: skip


def _surrogate() -> EngineSurrogate:
    return fit_surrogate(measured_records(_NAME))


def _run(surrogate: EngineSurrogate, case: Case, n_seeds: int, cycles: int) -> _Runs:
    estimate, outside = np.empty((n_seeds, cycles)), np.empty((n_seeds, cycles))
    signals = {name: np.empty((n_seeds, cycles)) for name in surrogate.signals}
    for seed in range(n_seeds):
        plant = SurrogatePlant(
            surrogate, case.objective.weights, limits=list(case.objective.limits), start_soi_cad=START_CAD, seed=seed
        )
        run = run_seeker(plant, seeker_of(case, seed), cycles).dataset
        estimate[seed] = run["estimate"][:, 0]
        outside[seed] = 1.0 - run["supported"]
        for name, column in signals.items():
            column[seed] = run[name]
    return _Runs(case=case, estimate=estimate, outside=outside, signals=signals)


def _row(run: _Runs) -> dict[str, Any]:
    case, final, later = run.case, run.final, run.estimate.shape[1] // 2
    away = final - case.best["soi_cad"]
    return {
        "objective": case.objective.name,
        "seeker": case.seeker,
        **with_interval("final_soi_cad", final),
        "final_soi_sd_cad": sd_of(final),
        "optimum_soi_cad": case.best["soi_cad"],
        "error_cad": float(final.mean() - case.best["soi_cad"]),
        "cycles_to_1_cad": with_median_interval("median", run.arrivals)["median"],
        "ends_within_1_cad_share": float(np.mean(np.abs(away) <= ARRIVAL_CAD)),
        "outside_share": float(run.outside.mean()),
        "mean_imep_bar": float(run.signals["imep_bar"][:, later:].mean()),
        "mean_pressure_rise": float(run.signals["mprr"][:, later:].mean()),
        "mean_nox_ppm": float(run.signals["nox_ppm"][:, later:].mean()),
        "noise_sd": case.noise_sd,
        "curvature_per_cad2": case.curvature,
        "period_cycles": case.tuning.period,
        "amplitude_cad": case.tuning.amplitude,
    }


def _dataset(runs: list[_Runs], surrogate: EngineSurrogate) -> xr.Dataset:
    cad, every, cases = "°CA aTDC", ("case", "seed"), [run.case for run in runs]
    ranges = [case.best.bounds["soi_cad"] for case in cases]
    half = [high - mean for mean, _, high in (mean_interval(run.final) for run in runs)]
    arrivals = [np.where(np.isfinite(run.arrivals), run.arrivals, np.nan) for run in runs]
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", np.arange(len(cases)), "-", "seeker on objective"),
        "seed": ("seed", np.arange(runs[0].estimate.shape[0]), "-", "seed"),
        "cycle": ("cycle", np.arange(runs[0].estimate.shape[1])),
        "objective": ("case", [case.objective.name for case in cases], "-", "objective"),
        "seeker": ("case", [case.seeker for case in cases], "-", "seeker"),
        "optimum_soi_cad": ("case", [case.best["soi_cad"] for case in cases], cad, "optimum of the surrogate"),
        "supported_low_cad": ("case", [low for low, _ in ranges], cad, "earliest supported SOI"),
        "supported_high_cad": ("case", [high for _, high in ranges], cad, "latest supported SOI"),
        "final_soi_cad": (every, [run.final for run in runs], cad, "mean estimate of the last 100 cycles"),
        "final_soi_interval_cad": ("case", half, "°CA", "half 95 % interval of its mean"),
        "cycles_to_1_cad": (every, arrivals, "cycle", "first cycle within 1 °CA of the optimum"),
        "outside_share": (every, [r.outside.mean(axis=1) for r in runs], "-", "share of cycles outside the records"),
        **band_variables("estimate_{}_cad", ("case", "cycle"), [run.estimate for run in runs], cad, OF_SEEDS),
    }
    return labelled_dataset(variables, attrs=dict(surrogate.source))


_MARKS = "osD^v"


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    return {
        "Estimates, median of the seeds; the band holds 80 % of the batch seeker's, dotted: end of the records": (
            _trajectories(dataset)
        ),
        "Where the seekers end: mean with its 95 % interval, below it each seed; dashed: optimum of the surrogate, "
        "dotted: end of the records": _ends(dataset),
    }


def _groups(dataset: xr.Dataset) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for at, name in enumerate(dataset["objective"].to_numpy()):
        groups.setdefault(str(name), []).append(at)
    return groups


def _styles(dataset: xr.Dataset) -> dict[str, int]:
    return {name: at for at, name in enumerate(dict.fromkeys(map(str, dataset["seeker"].to_numpy())))}


def _trajectories(dataset: xr.Dataset) -> Figure:
    groups, styles = _groups(dataset), _styles(dataset)
    figure = new_figure(8.0, 3.4 * len(groups))
    panels = figure.subplots(len(groups), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    cycle = dataset["cycle"]
    for ax, (objective, cases) in zip(panels, groups.items(), strict=True):
        lines = []
        for at in cases:
            one = dataset.isel(case=at)
            seeker = str(one["seeker"].item())
            dash, color = LINE_STYLES[styles[seeker] % len(LINE_STYLES)]
            lines += ax.plot(cycle, one["estimate_median_cad"], linestyle=dash, color=color, label=seeker)
            if at == cases[0]:
                low, high = one["estimate_low_cad"], one["estimate_high_cad"]
                ax.fill_between(cycle, low, high, color=color, alpha=0.15, linewidth=0.0)
        best = float(dataset["optimum_soi_cad"][cases[0]])
        line = ax.axhline(best, color=GREY, linewidth=1.0, label=minus(f"optimum of the surrogate: {best:.1f}"))
        for edge in ("supported_low_cad", "supported_high_cad"):
            ax.axhline(float(dataset[edge][cases[0]]), color=GREY, linewidth=0.8, linestyle=":")
        ax.annotate(minus(objective), (0.99, 0.95), xycoords="axes fraction", ha="right", va="top")
        ax.set_ylabel("start of injection [°CA aTDC]")
        legend(ax, [*lines, line], columns=6)
    panels[-1].set_xlabel(axis_label(dataset, "cycle"))
    return figure


def _ends(dataset: xr.Dataset) -> Figure:
    groups, styles = _groups(dataset), _styles(dataset)
    figure = new_figure(8.0, 0.42 * dataset.sizes["case"] + 1.2)
    ax = figure.add_subplot()
    rows: list[str] = []
    for objective, cases in groups.items():
        best = float(dataset["optimum_soi_cad"][cases[0]])
        top = len(rows) - 0.4
        for at in cases:
            one = dataset.isel(case=at)
            seeker, place = str(one["seeker"].item()), len(rows)
            color = LINE_STYLES[styles[seeker] % len(LINE_STYLES)][1]
            each = one["final_soi_cad"].to_numpy()
            ax.plot(each, np.full(each.size, place + 0.28), ".", color=color, markersize=3)
            half = float(np.nan_to_num(one["final_soi_interval_cad"]))
            mark = _MARKS[styles[seeker] % len(_MARKS)]
            ax.errorbar(each.mean(), place, xerr=half, fmt=mark, color=color, capsize=4, markersize=6)
            rows.append(minus(f"{objective}: {seeker}"))
        ax.vlines(best, top, len(rows) - 0.6, color=BLACK, linestyle="--", linewidth=1.0)
    for edge in ("supported_low_cad", "supported_high_cad"):
        ax.axvline(float(dataset[edge][0]), color=GREY, linewidth=0.8, linestyle=":")
    ax.set_yticks(range(len(rows)), rows)
    ax.invert_yaxis()
    ax.set_xlabel("final start of injection [°CA aTDC]")
    return figure
