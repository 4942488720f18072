"""Extremum seeking behind a NOx analyser: seven cases of delay and cure, and demodulation component by component."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Performance
from mgdd.loop import LoopCriteria, SensorDynamics, VirtualEngine, run_seeker
from mgdd.optimize import ComponentLag, ExtremumSeeking
from mgdd.optimize.optimum import Optimum
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd.results.units import unit_attributes
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.curves import convergence
from mgdd_studies.statistics import OVER_SEEDS, approach_gain, band_variables, estimates, loops, rms, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_sensor_delay"]

BOUNDS_CAD = (-30.0, 10.0)
EARLY_CAD, ARRIVAL_CAD, CYCLES = 8.0, 1.5, 8000
_QUIET: dict[str, Any] = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
_ANALYSER = ComponentLag(delay_cycles=38, lag_cycles=25)


@dataclass(frozen=True, kw_only=True)
class _Case:
    """Delay and lag of the whole J, dither and time constant of the seeker, and whether it knows the delay [cycles]."""

    name: str
    lag: ComponentLag
    period: int
    time_constant: float
    compensated: bool = False


CASES = (
    _Case(name="no delay", lag=ComponentLag(), period=10, time_constant=40.0),
    _Case(name="analyser, delay 42", lag=ComponentLag(delay_cycles=42, lag_cycles=25), period=10, time_constant=40.0),
    _Case(name="analyser, delay 34", lag=ComponentLag(delay_cycles=34, lag_cycles=25), period=10, time_constant=40.0),
    _Case(name="analyser", lag=_ANALYSER, period=120, time_constant=480.0),
    _Case(name="analyser, slow dither", lag=_ANALYSER, period=400, time_constant=800.0),
    _Case(name="analyser, phase compensated", lag=_ANALYSER, period=120, time_constant=480.0, compensated=True),
    _Case(name="analyser, phase compensated", lag=_ANALYSER, period=60, time_constant=240.0, compensated=True),
)


def run_sensor_delay(
    *, n_seeds: int = 20, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Show why the delay of an analyser defeats extremum seeking of efficiency and NOx, and what helps.

    The seven rows are free of noise: the whole of J comes late, and the phase of the discrete delay and lag decides
    over the sign of the averaged step, which is measured with the estimate frozen. In the two runs of
    ``summary["component_wise"]`` only NOx is late, each component is demodulated with its own phase, and the default
    noise is on.

    Parameters
    ----------
    n_seeds : int
        Runs behind each rms of the component-wise seekers.
    quick : bool
        At most four seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``case period_cycles phase_deg step_sign cycles_stays final_cad``; ``cycles_stays`` (within 1.5 CAD of the
        optimum, for good) is None where the estimate never stays. The dataset holds every trajectory.

    References
    ----------
    Tan (2018), section 4.4; the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.sensor_delay import run_sensor_delay
    >>> rows = run_sensor_delay(n_seeds=2, quick=True, figures=False).summary["rows"]
    >>> rows[0]["cycles_stays"], rows[1]["cycles_stays"]
    (72, None)
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=4)
    work = Parts(progress)
    performance = Performance.efficiency_and_nox()
    best = VirtualEngine(**_QUIET, performance=performance, nox_sensor="true_value").find_optimum()
    done = work((f"{case.name}, period {case.period}", partial(_run_case, case, best)) for case in CASES)
    found = work(
        (f"component by component, period {period}", partial(_component_wise, period, time, best, n_seeds))
        for period, time in ((10, 40.0), (60, 240.0))
    )
    return work.finish(
        "sensor-delay", _dataset(done, found, best), _draw if figures else None,
        seeds=n_seeds,
        rows=[row for row, _, _ in done],
        component_wise=[row for row, _ in found],
        frozen_slope_percent_per_cad=[slope for _, slope, _ in done],
        optimum_cad=best["soc_cad"],
        curvature_percent_per_cad2=best.curvature,
        start_cad=best["soc_cad"] - EARLY_CAD,
        arrival_cad=ARRIVAL_CAD,
        cycles=CYCLES,
        slow_dither_rule_cycles=6.0 * (_ANALYSER.delay_cycles + _ANALYSER.lag_cycles),
    )  # fmt: skip


def _run_case(case: _Case, best: Optimum) -> tuple[dict[str, Any], float, NDArray[np.float64]]:
    """Give the row of one case, its slope as demodulated at the frozen start, and its trajectory."""
    sensor = SensorDynamics(delay_cycles=int(case.lag.delay_cycles), lag_cycles=case.lag.lag_cycles, noise_fraction=0.0)
    late = case.lag.delay_cycles + case.lag.lag_cycles

    def bench() -> VirtualEngine:
        return VirtualEngine(
            **_QUIET,
            performance=Performance.efficiency_and_nox(),
            nox_sensor="true_value",
            analyser=sensor,
            delay_whole_objective=late > 0.0,
        )

    def seeker(hold_cycles: int | None) -> ExtremumSeeking:
        lags = [case.lag] if case.compensated else None
        return _seeker(
            best, case.period, case.time_constant, early_cad=EARLY_CAD, components=lags, hold_cycles=hold_cycles
        )

    run = run_seeker(bench(), seeker(None), CYCLES, criteria=LoopCriteria(optimum=best["soc_cad"], arrival=ARRIVAL_CAD))
    settle = case.period * math.ceil((case.lag.delay_cycles + 20.0 * case.lag.lag_cycles) / case.period + 2.0)
    slope = _frozen_slope(bench(), seeker(settle + 2 * case.period), settle, case.period)
    stays = run.summary["cycles_stays"]
    row = {
        "case": case.name,
        "period_cycles": case.period,
        "phase_deg": case.lag.response(period=case.period)[1] % 360.0,
        "step_sign": int(np.sign(slope * EARLY_CAD)),  # the optimum lies EARLY_CAD later than the frozen estimate
        "cycles_stays": int(stays) if math.isfinite(stays) else None,
        "final_cad": run.summary["final_soc_cad"],
    }
    return row, slope, run.dataset["estimate"].to_numpy()[:, 0]


def _seeker(
    best: Optimum, period: int, time_constant: float, *, components: list[ComponentLag] | None, early_cad: float = 0.0,
    hold_cycles: int | None = None,
) -> ExtremumSeeking:  # fmt: skip
    return ExtremumSeeking(
        start=best["soc_cad"] - early_cad, bounds=BOUNDS_CAD, form="moving_average",
        period=period, gain=approach_gain(best.curvature, time_constant), rate=math.inf, components=components,
        hold_cycles=hold_cycles,
    )  # fmt: skip


def _frozen_slope(bench: VirtualEngine, seeker: ExtremumSeeking, settle: int, period: int) -> float:
    """Average the demodulated slope of J over one period, once the sensor has settled, with the estimate held."""
    slopes = []
    for cycle in range(settle + period):
        seeker.tell(bench.step(float(seeker.ask()[0]))["j"])
        if cycle >= settle:
            slopes.append(float(seeker.gradient[0]))
    return float(np.mean(slopes))


def _component_wise(
    period: int, time_constant: float, best: Optimum, n_seeds: int
) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Give the row of a seeker that demodulates efficiency at once and NOx with the analyser's phase, and its runs."""
    sensor = SensorDynamics(
        delay_cycles=int(_ANALYSER.delay_cycles), lag_cycles=_ANALYSER.lag_cycles, noise_fraction=0.01
    )

    def make(seed: int) -> tuple[VirtualEngine, ExtremumSeeking]:
        bench = VirtualEngine(
            performance=Performance.efficiency_and_nox(), nox_sensor="analyser", analyser=sensor, seed=seed
        )
        return bench, _seeker(best, period, time_constant, components=[ComponentLag(), _ANALYSER])

    table = loops(*make(0), range(n_seeds), cycles=CYCLES, criteria=LoopCriteria(optimum=best["soc_cad"]))
    row = {
        "case": "analyser, NOx demodulated with its own phase",
        "period_cycles": period,
        "time_constant_cycles": time_constant,
        "nox_gain": _ANALYSER.response(period=period)[0],
        "rms_cad": rms(table["rms_soc_cad"]),
        **with_interval("final_cad", table["mean_soc_cad"]),
    }
    return row, estimates(make, range(min(n_seeds, 20)), CYCLES)


def _dataset(
    done: list[tuple[dict[str, Any], float, NDArray[np.float64]]],
    found: list[tuple[dict[str, Any], NDArray[np.float64]]],
    best: Optimum,
) -> xr.Dataset:
    cad = "°CA aTDC"
    names = [f"{row['case']}, period {row['period_cycles']}" for row, _, _ in done]
    stays = [math.nan if row["cycles_stays"] is None else row["cycles_stays"] for row, _, _ in done]
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", names, "-", "case"),
        "cycle": ("cycle", np.arange(CYCLES)),
        "estimate_median_cad": (("case", "cycle"), [track for _, _, track in done], cad, "estimate of the best timing"),
        "phase_deg": ("case", [row["phase_deg"] for row, _, _ in done], "deg", "phase lag of delay and lag"),
        "step_sign": ("case", [row["step_sign"] for row, _, _ in done], "-", "sign of the averaged step, 1: right way"),
        "frozen_slope": (
            "case",
            [slope for _, slope, _ in done],
            "%/°CA",
            "demodulated slope of the objective, estimate frozen",
        ),
        "cycles_stays": ("case", stays, "-", "cycle from which the estimate stays"),
        "final_cad": ("case", [row["final_cad"] for row, _, _ in done], cad, "mean estimate of the last cycles"),
        "optimum_cad": ((), best["soc_cad"], cad, "optimum"),
    }
    if found:
        own, runs = [row for row, _ in found], [run for _, run in found]
        over, said = ("component_period", "cycle"), OVER_SEEDS | {"median": "median of the estimate over seeds"}
        variables |= {
            "component_period": ("component_period", [row["period_cycles"] for row in own], "-", "dither period"),
            **band_variables("component_{}_cad", over, runs, cad, said),
            "component_rms_cad": ("component_period", [row["rms_cad"] for row in own], "°CA", "rms error"),
        }
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:

    groups = (
        ("Without delay, and with an analyser that turns the dither: the sign of the step decides", [0, 1, 2, 3], 1000),
        ("Cures: slow dither, or demodulation with the phase of the analyser", [4, 5, 6], CYCLES),
    )
    out = {}
    for caption, places, cycles in groups:
        kept = [place for place in places if place < dataset.sizes["case"]]
        if kept:
            out[caption] = drawn(convergence, dataset.isel(case=kept, cycle=slice(cycles)), size=(7.4, 4.2))
    if "component_median_cad" in dataset:
        own = dataset[["component_median_cad", "component_low_cad", "component_high_cad", "optimum_cad"]]
        names = {f"component_{name}_cad": f"estimate_{name}_cad" for name in ("median", "low", "high")}
        own = own.rename({**names, "component_period": "case"})
        labels = [f"period {int(period)}" for period in own["case"].to_numpy()]
        own = own.assign_coords(case=("case", labels, unit_attributes("-", "case")))
        out["Only NOx is late, each component demodulated with its own phase; default noise"] = drawn(
            convergence, own.isel(cycle=slice(2000)), size=(7.4, 4.2)
        )
    return out
