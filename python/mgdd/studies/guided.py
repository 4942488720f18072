"""Guided against unguided on one engine: the virtual bench, or the surrogate of a measured engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import Curve, CurveSeeking, ModelOptimum
from mgdd.loop import EngineBench, SurrogatePlant, run_seeker
from mgdd.optimize import ExtremumSeeking
from mgdd.optimize.by_curvature import approach_gain
from mgdd.results.labels import labelled_dataset
from mgdd.studies import measured_engine_cases as measured
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.guided_figures import draw
from mgdd.studies.guided_limited import LimitedRuns, limited_parts, limited_row, limited_variables
from mgdd.studies.guided_measured import drawn_curve, measured_guide
from mgdd.studies.statistics import with_interval, with_median_interval
from mgdd.surrogate import EngineSurrogate, fit_surrogate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_guided"]

_NAME = "guided"
_CYCLES, _EARLY_CYCLES, _QUICK_SEEDS = 400, 100, 20
_GRID_CAD, _REACH_CAD = 0.1, 60.0
_BEND = -0.05  # of a parabola, points of efficiency per (°CA)**2: what cycle models have, -0.037 to -0.054
_WRONG_WALL_HEAT = 1.0  # of the guide of the bench, which has 0.5
_AMPLITUDE_CAD, _PERIOD, _TIME_CONSTANT = 1.0, 10, 40.0  # of the seeker on the bench, as `mgdd engine seek` has them


@dataclass(frozen=True, kw_only=True)
class _Engine:
    """A plant, its optimum, its J over timing without noise, and its guide."""

    unit: str
    start_cad: float
    bounds_cad: tuple[float, float]
    best_cad: float
    best_j: float
    grid_cad: NDArray[np.float64]
    steady_j: NDArray[np.float64]
    curve: Curve
    bend: float  # of the parabola
    plant: Callable[[int, float], Any]
    plain: Callable[[float], ExtremumSeeking]

    def seeker(self, case: str) -> Any:
        """Make the seeker of a case."""
        led_cad = min(max(self.curve.best, self.bounds_cad[0]), self.bounds_cad[1])
        if case in ("unguided", "feed_forward"):
            return self.plain(self.start_cad if case == "unguided" else led_cad)
        shape = self.curve
        if case == "parabola":
            shape = Curve.parabola(curvature=self.bend, best=led_cad, reach=_REACH_CAD)
        return CurveSeeking(start=led_cad, lower=self.bounds_cad[0], upper=self.bounds_cad[1], curve=shape)


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """Of one case, one row per seed."""

    case: str
    start_cad: float
    estimate: NDArray[np.float64]
    lost: NDArray[np.float64]


_CASES = ("unguided", "feed_forward", "curve", "parabola")


def run_guided(
    *, seeds: int = 200, quick: bool = False, figures: bool = True, real: bool = False, progress: Progress | None = None
) -> StudyResult:
    """Start an engine with a rough model and without one, and count cycles and the J that is lost.

    Cases: extremum seeking from a start far away; the same from the guide's best timing, which is what a feed-forward
    does at one operating point; `CurveSeeking` with the guide's curve, and with a parabola about its best timing.
    The guide of the virtual bench has twice its wall heat. The guide of the measured engine is the cycle model of a
    diesel with a triangular burn: size, energy, burn angles and speed are those of the records; bore, stroke,
    compression ratio, intake and wall heat are usual ones, and hydrogen, pilot and residuals are left out. On that
    engine there are further cases with a limit of the pressure rise, all from the same late start: extremum seeking,
    the curve with and without the guide's curve of the pressure rise, each without and with a margin for its scatter.

    Parameters
    ----------
    seeds : int
        Runs per case.
    quick : bool
        At most twenty seeds.
    figures : bool
        Whether to draw.
    real : bool
        Whether the plant is the surrogate of the measured hydrogen-diesel engine, J its IMEP, input its injection.
    progress : callable, optional
        Called with a few words before each case.

    Returns
    -------
    StudyResult
        ``summary["rows"]``: per case the median of the first cycle within 1 °CA of the optimum and of the cycle from
        which on the estimate stays within 1.5 °CA (None: never in most runs), J lost in the first 100 cycles
        (J x cycles), J lost per cycle in the second half, and the final timing, with 95 % intervals. Cases with a limit
        are judged by the best timing within it, J above that is not counted as a gain, and ``above_share`` is the share
        of cycles whose pressure rise without noise is above the limit.

    Raises
    ------
    mgdd.errors.DataError
        The records are not at hand.
    mgdd.errors.ParameterError
        Fewer than one seed.

    Examples
    --------
    >>> from mgdd.studies.guided import run_guided
    >>> rows = run_guided(seeds=8, figures=False).summary["rows"]
    >>> [row["case"] for row in rows], 5 * rows[2]["cycles_to_1_cad"] < rows[0]["cycles_to_1_cad"]
    (['unguided', 'feed_forward', 'curve', 'parabola'], True)
    """
    seeds = min(check_seeds(seeds), _QUICK_SEEDS if quick else seeds)
    if progress is not None:
        progress("drawing the guide")
    engine = _measured_engine() if real else _bench_engine()
    parts = [(case, partial(_run, engine, case, seeds)) for case in _CASES]
    runs, interrupted = run_parts(parts, progress)
    limited: list[LimitedRuns] = []
    if real and not interrupted:
        limited, interrupted = run_parts(limited_parts(measured.measured_records(_NAME), seeds, _CYCLES), progress)
    summary: dict[str, Any] = {
        "study": _NAME,
        "plant": "surrogate of the measured engine" if real else "virtual bench",
        "seeds": seeds,
        "cycles": _CYCLES,
        "unit_of_j": engine.unit,
        "optimum_cad": engine.best_cad,
        "guide_cad": engine.curve.best,
        "interrupted": interrupted,
        "rows": [_row(engine, run) for run in runs] + [limited_row(run, _EARLY_CYCLES) for run in limited],
    }
    return finish(_dataset(engine, runs, limited), summary, draw if figures else None)


def _bench_engine() -> _Engine:
    bench, bounds = EngineBench(), (-30.0, 10.0)
    best = bench.find_optimum(bounds_cad=bounds)
    grid = np.arange(bounds[0], bounds[1] + 0.5 * _GRID_CAD, _GRID_CAD)
    model = ModelOptimum(bench.settings["cylinder"].replace(wall_heat_scale=_WRONG_WALL_HEAT), bounds_cad=bounds)
    gain = approach_gain(abs(best.curvature), _TIME_CONSTANT, amplitude=_AMPLITUDE_CAD)
    return _Engine(
        unit="%",
        start_cad=-20.0,
        bounds_cad=bounds,
        best_cad=best["soc_cad"],
        best_j=best.value,
        grid_cad=grid,
        steady_j=bench.steady_map(grid)["j"].to_numpy(),
        curve=drawn_curve(model, bench.point),
        bend=_BEND,
        plant=_bench_plant,
        plain=partial(
            _seeker_from, lower=bounds[0], upper=bounds[1], amplitude=_AMPLITUDE_CAD, period=_PERIOD, gain=gain
        ),
    )


def _bench_plant(seed: int, _: float) -> EngineBench:
    return EngineBench(seed=seed)


def _seeker_from(start: float, **settings: Any) -> ExtremumSeeking:
    return ExtremumSeeking(**{**settings, "start": start})


def _measured_engine() -> _Engine:
    records = measured.measured_records(_NAME)
    surrogate = fit_surrogate(records)
    objective = measured.Objective(name="IMEP", weights={"imep_bar": 1.0})
    case = measured.tuned_case(surrogate, objective, "batch", measured.held_objective(surrogate, objective))
    bounds = (measured.LOWER_CAD, measured.UPPER_CAD)
    grid = np.arange(bounds[0], bounds[1] + 0.5 * _GRID_CAD, _GRID_CAD)
    guide = measured_guide(records)
    settings = {name: value for name, value in measured.seeker_of(case, 0).settings.items() if name != "start"}
    return _Engine(
        unit="bar",
        start_cad=measured.START_CAD,
        bounds_cad=bounds,
        best_cad=case.best["soi_cad"],
        best_j=case.best.value,
        grid_cad=grid,
        steady_j=surrogate.predict(grid)["imep_bar"].to_numpy(),
        curve=guide.curve,
        bend=_BEND * guide.bar_per_point,
        plant=partial(_measured_plant, surrogate),
        plain=partial(_seeker_from, **settings),
    )


def _measured_plant(surrogate: EngineSurrogate, seed: int, start_cad: float) -> SurrogatePlant:
    return SurrogatePlant(surrogate, "imep_bar", start_soi_cad=start_cad, seed=seed)


def _run(engine: _Engine, case: str, seeds: int) -> _Runs:
    estimate, lost = np.empty((seeds, _CYCLES)), np.empty((seeds, _CYCLES))
    start = float(engine.seeker(case).estimate[0])
    for seed in range(seeds):
        cycles = run_seeker(engine.plant(seed, start), engine.seeker(case), _CYCLES).dataset
        if "estimate_cad" in cycles:
            estimate[seed], applied = cycles["estimate_cad"], cycles["soc_applied_cad"].to_numpy()
        else:
            estimate[seed], applied = cycles["estimate"][:, 0], cycles["applied"][:, 0].to_numpy()
        lost[seed] = engine.best_j - np.interp(applied, engine.grid_cad, engine.steady_j)
    return _Runs(case=case, start_cad=start, estimate=estimate, lost=lost)


def _arrivals(engine: _Engine, run: _Runs) -> NDArray[np.float64]:
    near = np.abs(run.estimate - engine.best_cad) <= 1.0
    return np.where(near.any(axis=1), near.argmax(axis=1), math.inf)


def _stays(engine: _Engine, run: _Runs) -> NDArray[np.float64]:
    outside = np.abs(run.estimate - engine.best_cad) > 1.5
    after = _CYCLES - np.argmax(outside[:, ::-1], axis=1)
    stays = np.where(outside.any(axis=1), after, 0).astype(np.float64)
    return np.where(outside[:, -1], math.inf, stays)


def _row(engine: _Engine, run: _Runs) -> dict[str, Any]:
    final = run.estimate[:, -_EARLY_CYCLES:].mean(axis=1)
    return {
        "case": run.case,
        "start_cad": run.start_cad,
        **with_median_interval("cycles_to_1_cad", _arrivals(engine, run)),
        **with_median_interval("cycles_stays_1_5_cad", _stays(engine, run)),
        **with_interval("lost_j_cycles", run.lost[:, :_EARLY_CYCLES].sum(axis=1)),
        **with_interval("late_loss", run.lost[:, _CYCLES // 2 :].mean(axis=1)),
        **with_interval("final_cad", final),
        "final_sd_cad": float(final.std(ddof=1)) if final.size > 1 else math.nan,
    }


def _dataset(engine: _Engine, runs: list[_Runs], limited: list[LimitedRuns]) -> xr.Dataset:
    cad, unit = "°CA aTDC", engine.unit
    low, median, high = np.quantile(np.stack([run.estimate for run in runs]), [0.1, 0.5, 0.9], axis=1)
    lost = np.stack([np.cumsum(run.lost, axis=1).mean(axis=0) for run in runs])
    over = ("case", "cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", [run.case for run in runs], "-", "what guides"),
        "cycle": ("cycle", np.arange(_CYCLES)),
        "timing_cad": ("timing_cad", engine.grid_cad, cad, "timing"),
        "steady_j": ("timing_cad", engine.steady_j, unit, "J without noise"),
        "guide_j": ("timing_cad", np.asarray(engine.curve(engine.grid_cad)), unit, "J by the guide"),
        "optimum_cad": ((), engine.best_cad, cad, "best timing"),
        "estimate_low_cad": (over, low, cad, "estimate, 10 % of the seeds below"),
        "estimate_median_cad": (over, median, cad, "estimate, median of the seeds"),
        "estimate_high_cad": (over, high, cad, "estimate, 10 % of the seeds above"),
        "lost_j_cycles": (over, lost, unit, "J lost so far, summed over cycles, mean of the seeds"),
    }
    return labelled_dataset(variables | limited_variables(limited))
