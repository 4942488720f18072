"""What a guide saves while the operating point keeps changing: a drive sequence, and the whole speed-load plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.loop import EngineBench
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.guide_cases import GUIDES, Guide, SteadyMap, drive, guided_by, verdict_on
from mgdd.studies.guided_plane import FUELS_MG, PLANE_GUIDES, PLANE_RUNS, SPEEDS_RPM, Plane, plane_row, run_plane
from mgdd.studies.guided_transients_figures import draw
from mgdd.studies.statistics import mean_interval, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_guided_transients"]

# Speed [rpm] and fuel [mg] of 250 cycles each: pulling away, cruising, overtaking, coasting down.
SEQUENCE = (
    (900.0, 8.0), (1500.0, 12.0), (1500.0, 30.0), (2000.0, 24.0), (2500.0, 34.0), (1800.0, 10.0),
    (1200.0, 18.0), (1500.0, 36.0), (2200.0, 14.0), (2800.0, 28.0), (1500.0, 8.0), (1000.0, 12.0),
)  # fmt: skip
_DWELL, _BIN = 250, 50
_GUIDES = ("wall heat +30 %", "duration -15 %", "adiabatic")


@dataclass(frozen=True, kw_only=True)
class _Drive:
    """J lost per cycle [points], shape (seed, cycle), and the mean estimate of every cycle."""

    form: str
    guide: str
    lost: NDArray[np.float64]
    estimate: NDArray[np.float64]


def run_guided_transients(
    *, seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Measure the efficiency lost over a sequence of twelve operating points, and after a step to each cell of a plane.

    The sequence takes 3000 cycles, with burn durations by the duration law. Unguided extremum seeking starts at -20 °CA
    aTDC and restarts at every point; guides lead it as feed-forward, or give their curve to curve-guided seeking
    (`GuidedEngine` without calibration). Noise of 0.25 points, 0.3 °CA of scatter. The plane has 8 x 8 cells from 900
    to 3000 rpm and 6 to 40 mg; the trim is learnt at 1500 rpm and 20 mg, then the point steps to the cell; no noise.

    Parameters
    ----------
    seeds : int
        Runs of the sequence.
    quick : bool
        At most two seeds, and a plane of 3 x 3 cells.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows ``form guide lost_per_100 lost_per_100_moving lost_over_unguided moving_over_unguided``: J lost per 100
        cycles [points x cycles] against the noise-free optimum, of the whole sequence and from the second point on.
        ``summary["plane"]``: cells that take more cycles than unguided, or lose more, cycles and loss saved.
        ``summary["bars"]``: what was demanded of the plane.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), figures 5-9, 5-13 and 5-14 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.guided_transients import run_guided_transients
    >>> result = run_guided_transients(seeds=1, quick=True, figures=False)
    >>> all(row["lost_over_unguided"] < 0.7 for row in result.summary["rows"][1:])
    True
    """
    seeds = min(check_seeds(seeds), 2) if quick else check_seeds(seeds)
    points = [OperatingPoint(speed_rpm=speed, fuel_mg=fuel) for speed, fuel in SEQUENCE]
    maps = [SteadyMap.of(EngineBench(point=point)) for point in points]
    wanted = [("none", "none"), *((form, name) for form in ("feed-forward", "curve") for name in _GUIDES)]
    parts = [
        (f"sequence, {form}, {name}", partial(_sequence, form, name, points, maps, seeds)) for form, name in wanted
    ]
    done, interrupted = run_parts(parts, progress)
    planes: list[Plane] = []
    speeds, fuels = (SPEEDS_RPM[::3], FUELS_MG[::3]) if quick else (SPEEDS_RPM, FUELS_MG)
    if not interrupted:
        cells = [
            [SteadyMap.of(EngineBench(point=OperatingPoint(speed_rpm=float(n), fuel_mg=float(m)))) for m in fuels]
            for n in speeds
        ]
        each = [
            (f"plane, {form}, {name}", partial(run_plane, form, name, cells, speeds=speeds, fuels=fuels))
            for form, name in PLANE_RUNS
        ]
        planes, interrupted = run_parts(each, progress)
    table = [plane_row(plane, planes[0]) for plane in planes]
    summary = {
        "study": "guided-transients",
        "seeds": seeds,
        "rows": [_row(own, done[0]) for own in done],
        "plane": table,
        "bars": _bars(table),
        "interrupted": interrupted,
    }
    data = _dataset(done, planes, maps, speeds, fuels)
    return finish(data, to_jsonable(summary), draw if figures else None)


def _sequence(form: str, name: str, points: list[OperatingPoint], maps: list[SteadyMap], seeds: int) -> _Drive:
    guides: dict[str, Guide] = {guide.name: guide for guide in GUIDES}
    schedule = [(_DWELL * at, point) for at, point in enumerate(points)]
    lost, estimates = [], []
    for seed in range(seeds):
        bench = EngineBench(schedule=schedule, seed=seed)
        run = drive(bench, guided_by(form, guides.get(name), points[0]), _DWELL * len(points))
        parts = run.applied.reshape(len(points), _DWELL)
        lost.append(np.concatenate([own.lost(part) for own, part in zip(maps, parts, strict=True)]))
        estimates.append(run.estimate)
    return _Drive(form=form, guide=name, lost=np.stack(lost), estimate=np.stack(estimates))


def _row(own: _Drive, none: _Drive) -> dict[str, Any]:
    """Give loss per 100 cycles, of all of the sequence and without its first point, which is the start."""
    whole, moving = (100.0 * run.mean(axis=1) for run in (own.lost, own.lost[:, _DWELL:]))
    plain, plain_moving = (100.0 * float(run.mean()) for run in (none.lost, none.lost[:, _DWELL:]))
    return {
        "form": own.form,
        "guide": own.guide,
        **with_interval("lost_per_100", whole),
        **with_interval("lost_per_100_moving", moving),
        "lost_over_unguided": mean_interval(whole)[0] / plain,
        **with_interval("moving_over_unguided", moving / plain_moving),
    }


def _bars(table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    bars = []
    for form in ("feed-forward", "curve"):
        known = {row["guide"]: row for row in table if row["form"] == form}
        good = [known[name] for name in PLANE_GUIDES[:-1] if name in known]
        for key, text in (("cells_slower", "more cycles to 1 CAD"), ("cells_costlier", "over 1 % more loss")):
            if good:
                said = f"plane, {form}, wall heat ±30 % and duration -15 %: cells with {text} than unguided"
                bars.append(verdict_on(said, [float(row[key]) for row in good], "none", high=0.0))
        if "adiabatic" in known:
            worst = [known["adiabatic"]["worst_cost_over_unguided"]]
            said = f"plane, {form}, adiabatic: worst cost over unguided [-]"
            bars.append(verdict_on(said, worst, "at most 1.2", high=1.2))
    return bars


def _dataset(done: list[_Drive], planes: list[Plane], maps: list[SteadyMap], speeds: Any, fuels: Any) -> xr.Dataset:
    cad = "°CA aTDC"
    names = ["unguided" if own.form == "none" else f"{own.form}, {own.guide}" for own in done]
    bins = [100.0 * own.lost.reshape(own.lost.shape[0], -1, _BIN).mean(axis=(0, 2)) for own in done]
    cycles = done[0].lost.shape[1]
    lows, highs = (
        [np.array([mean_interval(c)[end] for c in own.lost.reshape(own.lost.shape[0], -1, _BIN).mean(axis=2).T]) * 100.0
         for own in done]
        for end in (1, 2)
    )  # fmt: skip
    run = ("run", "middle_cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "run": ("run", names, "-", "form and guide"),
        "cycle": ("cycle", np.arange(cycles)),
        "middle_cycle": ("middle_cycle", np.arange(_BIN / 2, cycles, _BIN), "-", "engine cycle"),
        "lost_per_100": (run, bins, "%", "J lost per 100 cycles"),
        "lost_per_100_low": (run, lows, "%", "J lost per 100 cycles, low end of the interval"),
        "lost_per_100_high": (run, highs, "%", "J lost per 100 cycles, high end of the interval"),
        "estimate_cad": (("run", "cycle"), [np.median(own.estimate, axis=0) for own in done], cad, "median estimate"),
        "optimum_cad": ("cycle", np.repeat([own.best_cad for own in maps], _DWELL), cad, "optimum"),
        "speed_rpm": ("cycle", np.repeat([speed for speed, _ in SEQUENCE], _DWELL), "rpm", "engine speed"),
        "fuel_mg": ("cycle", np.repeat([fuel for _, fuel in SEQUENCE], _DWELL), "mg", "fuel per cycle"),
    }
    if planes:
        dims = ("plane_run", "plane_speed_rpm", "plane_fuel_mg")
        named = ["unguided" if plane.form == "none" else f"{plane.form}, {plane.name}" for plane in planes]
        variables |= {
            "plane_run": ("plane_run", named, "-", "form and guide"),
            "plane_speed_rpm": ("plane_speed_rpm", speeds, "rpm", "engine speed"),
            "plane_fuel_mg": ("plane_fuel_mg", fuels, "mg", "fuel per cycle"),
            "plane_cycles": (dims, [plane.cycles for plane in planes], "-", "cycles to 1 °CA after the step"),
            "plane_lost": (dims, [plane.lost for plane in planes], "%", "J lost over 200 cycles after the step"),
        }
    return labelled_dataset(variables)
