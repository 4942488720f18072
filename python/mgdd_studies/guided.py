"""Guided against unguided on one engine: the virtual bench, or the surrogate of a measured engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import Curve, CurveSeeking, ModelOptimum
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.plot.style import BLACK, GREY, LINE_STYLES, legend, minus, new_figure
from mgdd.results.labels import label_of, labelled_dataset
from mgdd_studies import measured_engine_cases as measured
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import band, legend_outside, names_of
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant, fit_surrogate
from mgdd_studies.statistics import (
    OF_SEEDS,
    approach_gain,
    band_variables,
    first_within,
    sd_of,
    stays_within,
    with_interval,
    with_median_interval,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_guided"]

_LABELS = {
    "unguided": "extremum seeking, unguided",
    "feed_forward": "extremum seeking from the guide's timing",
    "curve": "guided by the curve",
    "parabola": "guided by a parabola",
}
_NAME = "guided"
_CYCLES, _EARLY_CYCLES, _QUICK_SEEDS = 400, 100, 20
_GRID_CAD, _FINE_CAD, _REACH_CAD = 0.1, 0.05, 60.0
_BEND = -0.05  # of a parabola, points of efficiency per (°CA)**2: what cycle models have, -0.037 to -0.054
_WRONG_WALL_HEAT = 1.0  # of the guide of the bench, which has 0.5
_OBJECTIVE = measured.OBJECTIVES[0]  # of the cases with a limit
_AMPLITUDE_CAD, _PERIOD, _TIME_CONSTANT = 1.0, 10, 40.0  # of the seeker on the bench, as `mgdd engine seek` has them
_CASES = ("unguided", "feed_forward", "curve", "parabola")
_LIMITED_CASES = tuple(
    (f"{form}, margin {margin:g} sd", form, margin)
    for margin in (0.0, 1.0)
    for form in ("unguided", "curve", "curve, slope of the limit learnt")
)


@dataclass(frozen=True, kw_only=True)
class _Engine:
    """A plant, its optimum, its J over timing without noise, and its guide."""

    objective: str  # what J is
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
    plain: Callable[..., ExtremumSeeking]

    def seeker(self, case: str) -> Any:
        """Make the seeker of a case."""
        led_cad = min(max(self.curve.best, self.bounds_cad[0]), self.bounds_cad[1])
        if case in ("unguided", "feed_forward"):
            return self.plain(start=self.start_cad if case == "unguided" else led_cad)
        shape = self.curve
        if case == "parabola":
            shape = Curve.parabola(curvature=self.bend, best=led_cad, reach=_REACH_CAD)
        return CurveSeeking(start=led_cad, bounds=self.bounds_cad, curve=shape)


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Of one case: estimate [°CA aTDC] and J lost, by seed and cycle."""

    case: str
    start_cad: float
    best_cad: float
    estimate: NDArray[np.float64]
    lost: NDArray[np.float64]

    def row(self, early: int = _EARLY_CYCLES) -> dict[str, Any]:
        """Give the row of the case."""
        final = self.estimate[:, -early:].mean(axis=1)
        arrivals = [first_within(own, self.best_cad, 1.0) for own in self.estimate]
        stays = [stays_within(own, self.best_cad, 1.5) for own in self.estimate]
        return {
            "case": self.case,
            "start_cad": self.start_cad,
            **with_median_interval("cycles_to_1_cad", arrivals),
            **with_median_interval("cycles_stays_1_5_cad", stays),
            **with_interval("lost_j_cycles", self.lost[:, :early].sum(axis=1)),
            **with_interval("late_loss", self.lost[:, self.lost.shape[1] // 2 :].mean(axis=1)),
            **with_interval("final_cad", final),
            "final_sd_cad": sd_of(final),
        }


@dataclass(frozen=True, kw_only=True)
class LimitedRuns(Runs):
    """Of one case with a limit also the pressure rise without noise [bar/°CA]."""

    limit: float
    rise: NDArray[np.float64]

    @property
    def above(self) -> NDArray[np.bool_]:
        """Whether the pressure rise without noise is above the limit."""
        return self.rise > self.limit

    def row(self, early: int = _EARLY_CYCLES) -> dict[str, Any]:
        """Give the row of the case, beside those without a limit."""
        return {
            **super().row(early),
            "limited_optimum_cad": self.best_cad,
            **with_interval("above_share", self.above.mean(axis=1)),
            **with_interval("late_above_share", self.above[:, self.lost.shape[1] // 2 :].mean(axis=1)),
            "worst_pressure_rise": float(self.rise.max()),
        }


def run_guided(
    *,
    n_seeds: int = 200,
    quick: bool = False,
    figures: bool = True,
    real: bool = False,
    progress: Progress | None = None,
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
    n_seeds : int
        Runs per case.
    quick : bool
        At most twenty seeds.
    real : bool
        Whether the plant is the surrogate of the measured hydrogen-diesel engine, J its IMEP, input its injection.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

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

    Examples
    --------
    >>> from mgdd_studies.guided import run_guided
    >>> rows = run_guided(n_seeds=8, figures=False).summary["rows"]
    >>> [row["case"] for row in rows], 5 * rows[2]["cycles_to_1_cad"] < rows[0]["cycles_to_1_cad"]
    (['unguided', 'feed_forward', 'curve', 'parabola'], True)
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=_QUICK_SEEDS)
    work = Parts(progress)
    work.progress("drawing the guide")
    engine = _measured_engine() if real else _bench_engine()
    runs = work((case, partial(_run, engine, case, n_seeds)) for case in _CASES)
    limited = work(limited_parts(measured.measured_records(_NAME), n_seeds, _CYCLES)) if real else []
    return work.finish(
        _NAME, _dataset(engine, runs, limited), _draw if figures else None,
        plant="surrogate of the measured engine" if real else "virtual bench",
        seeds=n_seeds,
        cycles=_CYCLES,
        unit_of_j=engine.unit,
        optimum_cad=engine.best_cad,
        guide_cad=engine.curve.best,
        rows=[run.row() for run in [*runs, *limited]],
    )  # fmt: skip


def _bench_engine() -> _Engine:
    bench, bounds = VirtualEngine(), (-30.0, 10.0)
    best = bench.find_optimum(bounds={"soc_cad": bounds})
    grid = np.arange(bounds[0], bounds[1] + 0.5 * _GRID_CAD, _GRID_CAD)
    model = ModelOptimum(bench.settings["cylinder"].replace(wall_heat_scale=_WRONG_WALL_HEAT), bounds_cad=bounds)
    gain = approach_gain(abs(best.curvature), _TIME_CONSTANT, amplitude=_AMPLITUDE_CAD)
    return _Engine(
        objective="efficiency",
        unit="%",
        start_cad=-20.0,
        bounds_cad=bounds,
        best_cad=best["soc_cad"],
        best_j=best.value,
        grid_cad=grid,
        steady_j=bench.steady_map(grid)["j"].to_numpy(),
        curve=measured.drawn_curve(model, bench.point),
        bend=_BEND,
        plant=_bench_plant,
        plain=partial(ExtremumSeeking, bounds=bounds, amplitude=_AMPLITUDE_CAD, period=_PERIOD, gain=gain),
    )


def _bench_plant(seed: int, _: float) -> VirtualEngine:
    return VirtualEngine(seed=seed)


def _measured_engine() -> _Engine:
    records = measured.measured_records(_NAME)
    surrogate = fit_surrogate(records)
    objective = measured.Objective(name="IMEP", weights={"imep_bar": 1.0})
    case = measured.tuned_case(surrogate, objective, "batch", measured.held_objective(surrogate, objective))
    bounds = (measured.LOWER_CAD, measured.UPPER_CAD)
    grid = np.arange(bounds[0], bounds[1] + 0.5 * _GRID_CAD, _GRID_CAD)
    guide = measured.measured_guide(records)
    settings = {name: value for name, value in measured.seeker_of(case, 0).settings.items() if name != "start"}
    return _Engine(
        objective="IMEP", unit="bar", start_cad=measured.START_CAD, bounds_cad=bounds, best_cad=case.best["soi_cad"],
        best_j=case.best.value, grid_cad=grid, steady_j=surrogate.predict(grid)["imep_bar"].to_numpy(),
        curve=guide.curve, bend=_BEND * guide.bar_per_point, plant=partial(_measured_plant, surrogate),
        plain=partial(ExtremumSeeking, **settings),
    )  # fmt: skip


def _measured_plant(surrogate: EngineSurrogate, seed: int, start_cad: float) -> SurrogatePlant:
    return SurrogatePlant(surrogate, "imep_bar", start_soi_cad=start_cad, seed=seed)


def _run(engine: _Engine, case: str, n_seeds: int) -> Runs:
    estimate, lost = np.empty((n_seeds, _CYCLES)), np.empty((n_seeds, _CYCLES))
    start = float(engine.seeker(case).estimate[0])
    for seed in range(n_seeds):
        cycles = run_seeker(engine.plant(seed, start), engine.seeker(case), _CYCLES).dataset
        estimate[seed] = cycles["estimate"][:, 0]
        lost[seed] = engine.best_j - np.interp(cycles["applied"][:, 0], engine.grid_cad, engine.steady_j)
    return Runs(case=case, start_cad=start, best_cad=engine.best_cad, estimate=estimate, lost=lost)


def limited_parts(records: xr.Dataset, n_seeds: int, cycles: int) -> Iterator[tuple[str, Callable[[], LimitedRuns]]]:
    """Give each case with a limit as a part of the study."""
    surrogate, guide = fit_surrogate(records), measured.measured_guide(records)
    case = measured.tuned_case(surrogate, _OBJECTIVE, "batch", measured.held_objective(surrogate, _OBJECTIVE))
    for name, form, margin in _LIMITED_CASES:
        limits = [Limit(limited, upper, margin_sd=margin) for limited, upper in _OBJECTIVE.limits.items()]
        if form == "unguided":
            make: Callable[[], Any] = partial(
                ExtremumSeeking, **measured.seeker_of(case, 0).settings | {"limits": limits}
            )
        else:
            make = partial(
                CurveSeeking, start=measured.START_CAD, bounds=(measured.LOWER_CAD, measured.UPPER_CAD),
                curve=guide.curve, limits=limits, limit_curves=[guide.pressure_rise] if form == "curve" else None,
            )  # fmt: skip
        yield f"limited: {name}", partial(_run_limited, surrogate, case, name, make, n_seeds, cycles)


def _run_limited(
    surrogate: EngineSurrogate, case: measured.Case, name: str, make: Callable[[], Any], n_seeds: int, cycles: int
) -> LimitedRuns:
    grid = np.arange(measured.LOWER_CAD, measured.UPPER_CAD + 0.5 * _FINE_CAD, _FINE_CAD)
    (limited, upper), *_ = _OBJECTIVE.limits.items()
    surface = surrogate.predict(grid)
    estimate, lost, rise = (np.empty((n_seeds, cycles)) for _ in range(3))
    for seed in range(n_seeds):
        plant = SurrogatePlant(
            surrogate, _OBJECTIVE.weights, limits=[limited], start_soi_cad=measured.START_CAD, seed=seed
        )
        run = run_seeker(plant, make(), cycles).dataset
        estimate[seed], applied = run["estimate"][:, 0], run["applied"][:, 0].to_numpy()
        lost[seed] = np.maximum(case.best.value - np.interp(applied, grid, surface["imep_bar"].to_numpy()), 0.0)
        rise[seed] = np.interp(applied, grid, surface[limited].to_numpy())
    return LimitedRuns(
        case=name, start_cad=measured.START_CAD, best_cad=case.best["soi_cad"], limit=upper, estimate=estimate,
        lost=lost, rise=rise,
    )  # fmt: skip


def _dataset(engine: _Engine, runs: list[Runs], limited: list[LimitedRuns]) -> xr.Dataset:
    cad, over = "°CA aTDC", ("case", "cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", [run.case for run in runs], "-", "what guides"),
        "cycle": ("cycle", np.arange(_CYCLES)),
        "timing_cad": ("timing_cad", engine.grid_cad, cad, "timing"),
        "steady_j": ("timing_cad", engine.steady_j, engine.unit, f"{engine.objective} without noise"),
        "guide_j": ("timing_cad", engine.curve(engine.grid_cad), engine.unit, f"{engine.objective} by the guide"),
        "optimum_cad": ((), engine.best_cad, cad, "best timing"),
        **band_variables("estimate_{}_cad", over, [run.estimate for run in runs], cad, OF_SEEDS),
        "lost_j_cycles": (
            over, [np.cumsum(run.lost, axis=1).mean(axis=0) for run in runs], engine.unit,
            f"loss of {engine.objective} so far, summed over cycles, mean of the seeds",
        ),
    }  # fmt: skip
    if limited:
        variables |= {
            "limited_case": (
                "limited_case",
                [run.case for run in limited],
                "-",
                "what guides, and margin of the limit",
            ),
            "limited_optimum_cad": ((), limited[0].best_cad, cad, "best timing within the limit"),
            "pressure_rise_limit": ((), limited[0].limit, "bar/°CA", "limit of the pressure rise"),
        }
        for key, unit, text in (
            ("estimate", cad, "estimate under the limit"),
            ("rise", "bar/°CA", "pressure rise without noise"),
        ):
            said = {end: f"{text}, {end} of the seeds" for end in OF_SEEDS}
            each = [getattr(run, key) for run in limited]
            variables |= band_variables(f"limited_{key}_{{}}", ("limited_case", "cycle"), each, unit, said)
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    what = _objective(dataset)
    out = {
        f"Estimates and loss of {what}, median and mean of the seeds; the bands hold 80 %": _starts(dataset),
        f"{what} of the engine and of its guide over timing, each from its own maximum": _curves(dataset),
    }
    if "limited_case" in dataset:
        out["Under a limit of the pressure rise: estimate and true pressure rise, medians; the bands hold 80 %"] = (
            _limited(dataset)
        )
    return out


def _objective(dataset: xr.Dataset) -> str:
    return str(dataset["steady_j"].attrs["long_name"]).removesuffix(" without noise")


def _starts(dataset: xr.Dataset) -> Figure:
    figure = new_figure(8.0, 6.4)
    above, below = figure.subplots(2, 1, sharex=True)
    lines = []
    for at, case in enumerate(names_of(dataset, "case")):
        one = dataset.isel(case=at)
        dash, color = LINE_STYLES[at % len(LINE_STYLES)]
        look: dict[str, Any] = {"linestyle": dash, "color": color, "label": _LABELS[case]}
        lines += above.plot(one["cycle"], one["estimate_median_cad"], **look)
        if case in ("unguided", "curve"):
            low, high = one["estimate_low_cad"], one["estimate_high_cad"]
            above.fill_between(one["cycle"], low, high, color=color, alpha=0.15, linewidth=0.0)
        below.plot(one["cycle"], one["lost_j_cycles"], **look)
    best = float(dataset["optimum_cad"])
    lines.append(above.axhline(best, color=GREY, linewidth=1.0, label=minus(f"best timing: {best:.1f} °CA aTDC")))
    above.set_ylabel("timing [°CA aTDC]")
    units = label_of(dataset["steady_j"]).units
    below.set_ylabel(f"loss of {_objective(dataset)} since the start\n[{units} × cycles]")
    below.set_yscale("log")
    below.set_xlabel("cycle")
    legend(above, lines)
    return figure


def _curves(dataset: xr.Dataset) -> Figure:
    figure = new_figure(7.0, 4.0)
    ax = figure.subplots()
    own, guide = dataset["steady_j"], dataset["guide_j"]
    lines = ax.plot(dataset["timing_cad"], own - own.max(), color=BLACK, label="engine")
    lines += ax.plot(dataset["timing_cad"], guide - guide.max(), color=LINE_STYLES[1][1], linestyle="--", label="guide")
    ax.set_xlabel("timing [°CA aTDC]")
    ax.set_ylabel(f"{_objective(dataset)} less its maximum [{label_of(own).units}]")
    legend(ax, lines)
    return figure


def _limited(dataset: xr.Dataset) -> Figure:
    figure = new_figure(9.0, 5.6)
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    cases = names_of(dataset, "limited_case")
    margins = list(dict.fromkeys(name.rpartition(", ")[2] for name in cases))
    for column, margin in enumerate(margins[:2]):
        above, below = axes[0, column], axes[1, column]
        for at, case in enumerate(name for name in cases if name.endswith(margin)):
            own = dataset.isel(limited_case=cases.index(case))
            dash, color = LINE_STYLES[at % len(LINE_STYLES)]
            for ax, key in ((above, "estimate"), (below, "rise")):
                ends = [own[f"limited_{key}_{end}"] for end in OF_SEEDS]
                label = case.rpartition(", ")[0]
                band(ax, own["cycle"], *ends, dash=dash, color=color, alpha=0.12, label=label)
        above.axhline(float(dataset["limited_optimum_cad"]), color=GREY, linewidth=1.0, label="best within the limit")
        below.axhline(float(dataset["pressure_rise_limit"]), color=GREY, linewidth=1.0)
        above.set_title(margin, loc="left", fontsize="small")
        below.set_xlabel("cycle")
    axes[0, 0].set_ylabel("timing [°CA aTDC]")
    axes[1, 0].set_ylabel("pressure rise\nwithout noise [bar/°CA]")
    legend_outside(figure, axes[0, 0], 4)
    return figure
