"""How many cycles a rough model saves at the start: its optimum as feed-forward, and its whole curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.guide import Curve
from mgdd.loop import VirtualEngine
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.curves import convergence
from mgdd_studies.figures import convergence_panels, names_of
from mgdd_studies.guide_cases import (
    GUIDES,
    LOW,
    PLANT,
    WRONG,
    Guide,
    SteadyMap,
    curve_seeker,
    drive,
    no_model,
    trimmed,
    verdict_on,
)
from mgdd_studies.statistics import (
    OVER_SEEDS,
    band_variables,
    first_within,
    quantile_of,
    rms,
    stays_within,
    with_interval,
    with_median_interval,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_guided_start_up"]

TRIM_CYCLES, CURVE_CYCLES, LATE, SHOWN = 500, 400, 200, 200
ARRIVAL_CAD, STAY_CAD, EARLY_CAD = 1.0, 1.5, -20.0


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
            return no_model()
        return self.guide.curve(OperatingPoint(burn_duration_cad=self.told_burn_cad))


def _wiebe(scale: float) -> Cylinder:
    return PLANT.replace(burn_shape="wiebe", wall_heat_scale=scale)


_TWICE = Guide("triangle 30, wall heat 1.0", WRONG)
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
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Count the cycles from the start to the optimum, with a guide that is wrong in a stated way.

    As feed-forward, a guide says where extremum seeking (moving average, amplitude 1, period 10, time constant 40
    cycles, no clip) starts; unguided it starts at -20 °CA aTDC. As a curve, it says how J bends, and curve-guided
    seeking with default settings finds where the curve stands, from the guide's optimum and from a far start. The
    engine is ``puma_single`` with 0.25 points of efficiency noise; with the curve also 0.3 °CA of scatter, and neither
    noise, scatter nor curvature is given.

    Parameters
    ----------
    n_seeds : int
        Runs of every case.
    quick : bool
        At most eight seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows of the feed-forward: ``guide``, ``guide_error_cad`` (its optimum less the engine's), mean and median of the
        first cycle within 1 °CA, ``times_fewer`` than unguided. ``summary["curve"]``: per case and start the median
        cycle from which the estimate stays within 1.5 °CA, the 95th percentile of the first within 1 °CA, loss and rms
        error of cycles 200 to 400, and how often the estimate and 1.96 of its standard deviations hold the optimum.
        ``summary["bars"]``: what was demanded, the worst case, and whether all cases met it.

    References
    ----------
    Tan (2018), section 5.3 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("guided-start-up", n_seeds=6, quick=True)
    >>> rows = {row["guide"]: row for row in result.summary["rows"]}
    >>> rows["wall heat +30 %"]["cycles_to_1_cad"] < 0.5 * rows["none"]["cycles_to_1_cad"]
    True
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=8)
    work = Parts(progress)
    steady = SteadyMap.of(VirtualEngine(point=LOW))
    trims = [("none", None), *((guide.name, guide) for guide in _TRIM)]
    done = work((f"feed-forward, {name}", partial(_trim, guide, steady, n_seeds)) for name, guide in trims)
    curves = work(
        (f"curve, {case.name}, start at {'the guide' if near else case.far_start_cad}",
         partial(_seek, case, near, n_seeds))
        for case in _CASES for near in (True, False)
    )  # fmt: skip
    for outcome in done:
        cycles = outcome.row["cycles_to_1_cad"]
        outcome.row["times_fewer"] = done[0].row["cycles_to_1_cad"] / cycles if cycles >= 1.0 else None
    return work.finish(
        "guided-start-up", _dataset(done, curves, steady), _draw if figures else None,
        seeds=n_seeds,
        rows=[outcome.row for outcome in done],
        curve=[outcome.row for outcome in curves],
        bars=_bars([outcome.row for outcome in done], [outcome.row for outcome in curves]),
        optimum_cad=steady.best_cad,
        start_cad=EARLY_CAD,
    )  # fmt: skip


def _trim(guide: Guide | None, steady: SteadyMap, n_seeds: int) -> _Outcome:
    best = steady.best_cad
    runs = [
        drive(VirtualEngine(point=LOW, soc_scatter_cad=0.0, seed=seed), trimmed(guide), TRIM_CYCLES).estimate
        for seed in range(n_seeds)
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


def _seek(case: _Case, near: bool, n_seeds: int) -> _Outcome:
    curve = case.curve()
    start = curve.best if near else case.far_start_cad
    steady = SteadyMap.of(VirtualEngine(case.plant, case.point))
    best = steady.best_cad
    runs, lost, inside, handed = [], [], [], []
    for seed in range(n_seeds):
        seeker = curve_seeker(curve, start=start)
        run = drive(VirtualEngine(case.plant, case.point, seed=seed), seeker, CURVE_CYCLES)
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
        "first_95_percent": quantile_of(first, 0.95),
        **with_interval("late_loss_percent", lost),
        "late_rms_cad": rms(errors),
        "late_mean_error_cad": float(errors.mean()),
        **with_interval("covered_percent", inside),
        "handed_over_percent": 100.0 * float(np.mean(handed)),
    }
    return _Outcome(row=row, estimates=np.stack(runs), cycles=stays)


def _bars(trims: list[dict[str, Any]], curves: list[dict[str, Any]]) -> list[dict[str, Any]]:
    bars = []
    heat = [row["times_fewer"] for row in trims if row["guide"].startswith("wall heat")]
    if heat:
        text = "feed-forward, wall heat ±30 %: times fewer cycles to 1 CAD"
        bars.append(verdict_on(text, heat, "at least 4", low=4.0))
    if curves:
        stays, first, loss, covered = (
            [row[name] for row in curves]
            for name in ("median_stays", "first_95_percent", "late_loss_percent", "covered_percent")
        )
        held = "curve: 95 % interval holds the optimum [%]"
        bars += [
            verdict_on("curve: stays within 1.5 CAD, median [cycles]", stays, "at most 8", high=8.0),
            verdict_on("curve: first within 1 CAD, 95th percentile [cycles]", first, "at most 40", high=40.0),
            verdict_on("curve: loss of cycles 200 to 400 [points]", loss, "at most 0.025", high=0.025),
            verdict_on(held, covered, "90 to 99", low=90.0, high=99.0),
        ]
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
    bands = [o.estimates[:, :SHOWN] for o in done]
    variables |= band_variables("estimate_{}_cad", ("guide", "cycle"), bands, cad, OVER_SEEDS)
    if curves:
        names = [f"{o.row['case']}, from {o.row['start_cad']:.0f}" for o in curves]
        best = [float(o.estimates[:, LATE:].mean() - o.row["late_mean_error_cad"]) for o in curves]
        bands = [o.estimates[:, :SHOWN] for o in curves]
        variables |= {
            "case": ("case", names, "-", "case and start"),
            "cycles_stays": (("case", "seed"), [o.cycles for o in curves], "-", "estimate stays from here on"),
            "case_optimum_cad": ("case", best, cad, "optimum of the plant"),
            **band_variables("curve_estimate_{}_cad", ("case", "cycle"), bands, cad, OVER_SEEDS),
        }
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    names = {f"estimate_{end}_cad" for end in ("median", "low", "high")}
    kept = [name for name in ("none", "wall heat +30 %", "duration -15 %", "adiabatic") if name in dataset["guide"]]
    own = dataset[[*sorted(names), "optimum_cad"]].sel(guide=kept)
    out = {
        "Feed-forward: median of the estimate over the seeds, and the band that holds 80 % of them": drawn(
            convergence, own, size=(7.4, 4.2)
        )
    }
    if "case" not in dataset:
        return out
    cases = names_of(dataset, "case")
    shown = [at for at, name in enumerate(cases) if any(part in name for part in ("+30 %", "adiabatic", "60", "no mo"))]
    curve = dataset[[f"curve_{name}" for name in sorted(names)]].rename({f"curve_{n}": n for n in sorted(names)})
    panels = []
    for at in shown[:8]:
        panel = curve.isel(case=[at], cycle=slice(60)).assign(optimum_cad=dataset["case_optimum_cad"].isel(case=at))
        panels.append((cases[at], panel.drop_vars("case_optimum_cad", errors="ignore")))
    out[
        "The curve: median of the estimate and the band of 80 % of the seeds, from the guide's optimum and from afar"
    ] = convergence_panels(panels, height=5.0)
    return out
