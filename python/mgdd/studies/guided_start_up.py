"""How many cycles a rough model saves at the start: its optimum as feed-forward, and its whole curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import Curve
from mgdd.loop import EngineBench
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.guide_cases import (
    GUIDES,
    LOW,
    PLANT,
    Guide,
    SteadyMap,
    curve_seeker,
    drive,
    first_within,
    stays_within,
    trimmed,
    verdict_on,
)
from mgdd.studies.guided_start_up_figures import draw
from mgdd.studies.statistics import rms, with_interval, with_median_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_guided_start_up"]

TRIM_CYCLES, CURVE_CYCLES, LATE, SHOWN = 500, 400, 200, 200
ARRIVAL_CAD, STAY_CAD, EARLY_CAD = 1.0, 1.5, -20.0
_BEND = -0.05  # curvature of the parabola that stands for no model [points/CAD**2]
_MIDDLE_CAD, _REACH_CAD = -10.0, 60.0


@dataclass(frozen=True, kw_only=True)
class _Case:
    """A plant, and the curve that guides there; without a guide a parabola in the middle of the bounds."""

    name: str
    guide: Guide | None
    plant: Cylinder = PLANT
    burn_cad: float | None = None
    told_burn_cad: float | None = None
    far_start_cad: float = EARLY_CAD

    @property
    def point(self) -> OperatingPoint:
        return OperatingPoint(burn_duration_cad=self.burn_cad)

    def curve(self) -> Curve:
        if self.guide is None:
            return Curve.parabola(curvature=_BEND, best=_MIDDLE_CAD, reach=_REACH_CAD)
        return self.guide.curve(OperatingPoint(burn_duration_cad=self.told_burn_cad))


def _wiebe(scale: float) -> Cylinder:
    return PLANT.replace(burn_shape="wiebe", wall_heat_scale=scale)


_TWICE = Guide("triangle 30, wall heat 1.0", PLANT.replace(wall_heat_scale=1.0))
_TRIM = tuple(guide for guide in GUIDES if not guide.backwards)  # the wrong sign is exact until the load changes
_CASES = (
    *(_Case(name=guide.name, guide=guide) for guide in _TRIM),
    _Case(name="wall heat +100 %", guide=_TWICE),
    _Case(name="plant Wiebe 45, wall heat 0.5", guide=_TWICE, plant=_wiebe(0.5), burn_cad=45.0, told_burn_cad=30.0),
    _Case(
        name="plant Wiebe 60, wall heat 0.35", guide=_TWICE, plant=_wiebe(0.35), burn_cad=60.0, told_burn_cad=30.0,
        far_start_cad=0.0,
    ),
    _Case(name="no model, a parabola", guide=None),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Outcome:
    row: dict[str, Any]
    estimates: NDArray[np.float64]
    cycles: NDArray[np.float64]


def run_guided_start_up(
    *, seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Count the cycles from the start to the optimum, with a guide that is wrong in a stated way.

    As feed-forward, a guide says where extremum seeking (moving average, amplitude 1, period 10, time constant 40
    cycles, no clip) starts; unguided it starts at -20 °CA aTDC. As a curve, it says how J bends, and curve-guided
    seeking with default settings finds where the curve stands, from the guide's optimum and from a far start. The
    engine is ``puma_single`` with 0.25 points of efficiency noise; with the curve also 0.3 °CA of scatter, and neither
    noise, scatter nor curvature is told.

    Parameters
    ----------
    seeds : int
        Runs of every case.
    quick : bool
        At most eight seeds.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows of the feed-forward: ``guide``, ``guide_error_cad`` (its optimum less the engine's), mean and median of the
        first cycle within 1 °CA, ``times_fewer`` than unguided. ``summary["curve"]``: per case and start the median
        cycle from which the estimate stays within 1.5 °CA, the 95th percentile of the first within 1 °CA, loss and rms
        error of cycles 200 to 400, and how often the estimate and 1.96 of its standard deviations hold the optimum.
        ``summary["bars"]``: what was demanded, the worst case, and whether all cases met it.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), section 5.3 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.guided_start_up import run_guided_start_up
    >>> result = run_guided_start_up(seeds=4, quick=True, figures=False)
    >>> rows = {row["guide"]: row for row in result.summary["rows"]}
    >>> rows["wall heat +30 %"]["cycles_to_1_cad"] < 0.5 * rows["none"]["cycles_to_1_cad"]
    True
    """
    seeds = min(check_seeds(seeds), 8) if quick else check_seeds(seeds)
    steady = SteadyMap.of(EngineBench(point=LOW))
    trims = [("feed-forward, none", partial(_trim, None, steady, seeds))]
    trims += [(f"feed-forward, {guide.name}", partial(_trim, guide, steady, seeds)) for guide in _TRIM]
    done, interrupted = run_parts(trims, progress)
    curves: list[_Outcome] = []
    if not interrupted:
        each = [
            (f"curve, {case.name}, start at {'the guide' if near else case.far_start_cad}",
             partial(_seek, case, near, seeds))
            for case in _CASES for near in (True, False)
        ]  # fmt: skip
        curves, interrupted = run_parts(each, progress)
    for outcome in done:
        cycles = outcome.row["cycles_to_1_cad"]
        outcome.row["times_fewer"] = done[0].row["cycles_to_1_cad"] / cycles if cycles >= 1.0 else None
    summary = {
        "study": "guided-start-up",
        "seeds": seeds,
        "rows": [outcome.row for outcome in done],
        "curve": [outcome.row for outcome in curves],
        "bars": _bars([outcome.row for outcome in done], [outcome.row for outcome in curves]),
        "optimum_cad": steady.best_cad,
        "start_cad": EARLY_CAD,
        "interrupted": interrupted,
    }
    return finish(_dataset(done, curves, steady), to_jsonable(summary), draw if figures else None)


def _trim(guide: Guide | None, steady: SteadyMap, seeds: int) -> _Outcome:
    best = steady.best_cad
    runs = [
        drive(EngineBench(point=LOW, soc_scatter_cad=0.0, seed=seed), trimmed(guide), TRIM_CYCLES).estimate
        for seed in range(seeds)
    ]
    cycles = np.array([first_within(estimate, best, ARRIVAL_CAD) for estimate in runs])
    arrived = np.where(np.isfinite(cycles), cycles, np.nan)
    row = {
        "guide": "none" if guide is None else guide.name,
        "guide_error_cad": math.nan if guide is None else guide(LOW)["soc_cad"] - best,
        **with_interval("cycles_to_1_cad", arrived),
        **with_median_interval("median_cycles", cycles),
        "share_arrived": float(np.isfinite(cycles).mean()),
    }
    return _Outcome(row=row, estimates=np.stack(runs), cycles=cycles)


def _seek(case: _Case, near: bool, seeds: int) -> _Outcome:
    curve = case.curve()
    start = curve.best if near else case.far_start_cad
    steady = SteadyMap.of(EngineBench(case.plant, case.point))
    best = steady.best_cad
    runs, lost, inside, handed = [], [], [], []
    for seed in range(seeds):
        seeker = curve_seeker(curve, start=start)
        run = drive(EngineBench(case.plant, case.point, seed=seed), seeker, CURVE_CYCLES)
        error = run.estimate[LATE:] - best
        runs.append(run.estimate)
        lost.append(steady.lost(run.applied[LATE:]).mean())
        inside.append(100.0 * float(np.mean(np.abs(error) <= 1.96 * run.estimate_sd[LATE:])))
        handed.append(seeker.handed_over)
    first = np.array([first_within(estimate, best, ARRIVAL_CAD) for estimate in runs])
    stays = np.array([stays_within(estimate, best, STAY_CAD) for estimate in runs])
    errors = np.stack(runs)[:, LATE:] - best
    row = {
        "case": case.name,
        "start_cad": start,
        "guide_error_cad": curve.best - best,
        **with_median_interval("median_stays", stays),
        "first_95_percent": _none(np.quantile(first, 0.95, method="inverted_cdf")),
        **with_interval("late_loss_percent", lost),
        "late_rms_cad": rms(errors),
        "late_mean_error_cad": float(errors.mean()),
        **with_interval("covered_percent", inside),
        "handed_over_percent": 100.0 * float(np.mean(handed)),
    }
    return _Outcome(row=row, estimates=np.stack(runs), cycles=stays)


def _none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _number(value: float | None) -> float:
    return math.inf if value is None else value


def _bars(trims: list[dict[str, Any]], curves: list[dict[str, Any]]) -> list[dict[str, Any]]:
    bars = []
    heat = [_number(row["times_fewer"]) for row in trims if row["guide"].startswith("wall heat")]
    if heat:
        text = "feed-forward, wall heat ±30 %: times fewer cycles to 1 CAD"
        bars.append(verdict_on(text, heat, "at least 4", low=4.0))
    if curves:
        stays = [_number(row["median_stays"]) for row in curves]
        first = [_number(row["first_95_percent"]) for row in curves]
        bars += [
            verdict_on("curve: stays within 1.5 CAD, median [cycles]", stays, "at most 8", high=8.0),
            verdict_on("curve: first within 1 CAD, 95th percentile [cycles]", first, "at most 40", high=40.0),
            verdict_on(
                "curve: loss of cycles 200 to 400 [points]", [row["late_loss_percent"] for row in curves],
                "at most 0.025", high=0.025,
            ),
            verdict_on(
                "curve: 95 % interval holds the optimum [%]", [row["covered_percent"] for row in curves],
                "90 to 99", low=90.0, high=99.0,
            ),
        ]  # fmt: skip
    return bars


def _dataset(done: list[_Outcome], curves: list[_Outcome], steady: SteadyMap) -> xr.Dataset:
    cad = "°CA aTDC"
    variables: dict[str, tuple[Any, ...]] = {
        "guide": ("guide", [outcome.row["guide"] for outcome in done], "-", "guide"),
        "seed": ("seed", np.arange(done[0].cycles.size), "-", "seed"),
        "cycle": ("cycle", np.arange(SHOWN)),
        "cycles_to": (("guide", "seed"), [o.cycles for o in done], "-", "first cycle within 1 °CA of the optimum"),
        "optimum_cad": ((), steady.best_cad, cad, "optimum"),
    }
    groups = [("", "guide", done)]
    if curves:
        names = [f"{o.row['case']}, from {o.row['start_cad']:.0f}" for o in curves]
        best = [_best(o) for o in curves]
        variables["case"] = ("case", names, "-", "case and start")
        variables["cycles_stays"] = (("case", "seed"), [o.cycles for o in curves], "-", "estimate stays from here on")
        variables["case_optimum_cad"] = ("case", best, cad, "optimum of the plant")
        groups.append(("curve_", "case", curves))
    for front, dim, outcomes in groups:
        bands = [np.quantile(o.estimates[:, :SHOWN], [0.5, 0.1, 0.9], axis=0) for o in outcomes]
        for at, (name, text) in enumerate((("median", "median"), ("low", "10 % quantile"), ("high", "90 % quantile"))):
            label = f"{text} of the estimate over seeds" if at else "estimate of the best timing"
            variables[f"{front}estimate_{name}_cad"] = ((dim, "cycle"), [band[at] for band in bands], cad, label)
    return labelled_dataset(variables)


def _best(outcome: _Outcome) -> float:
    return float(outcome.estimates[:, LATE:].mean() - outcome.row["late_mean_error_cad"])
