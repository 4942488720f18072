"""Four tests of extremum seeking on the bench: efficiency, another start, NOx by analyser and by soft sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Performance
from mgdd.loop import LoopCriteria, VirtualEngine
from mgdd.optimize import ComponentLag, ExtremumSeeking, Limit
from mgdd.optimize.optimum import Optimum
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.statistics import approach_gain, loops, rms, run_with_slope, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["run_timing_tests"]

BOUNDS_CAD, CYCLES, TAIL, ARRIVAL_CAD, NOX_WEIGHT, P_MAX_BAR = (-30.0, 10.0), 3000, 300, 1.0, 0.004, 95.0
_SHOWN = 1000
_LATE_RATE = 0.2  # CAD per cycle: a clip at one amplitude per period of 60 would take 1300 cycles to arrive


@dataclass(frozen=True, kw_only=True)
class _Test:
    """What is maximised and how: period and time constant of the seeker [cycles], component-wise where NOx is late."""

    name: str
    start_cad: float
    nox_sensor: str = "none"
    period: int = 10
    time_constant: float = 40.0

    def bench(self, seed: int = 0, *, limited: bool = False) -> VirtualEngine:
        nox = self.nox_sensor != "none"
        return VirtualEngine(
            performance=Performance.efficiency_and_nox(NOX_WEIGHT) if nox else None,
            nox_sensor=self.nox_sensor if nox else "soft",
            limits=["p_max_bar"] if limited else [],
            seed=seed,
        )

    def seeker(self, best: Optimum, *, limited: bool = False) -> ExtremumSeeking:
        late = self.nox_sensor == "analyser"
        return ExtremumSeeking(
            start=self.start_cad, bounds=BOUNDS_CAD, period=self.period,
            gain=approach_gain(best.curvature, self.time_constant), rate=_LATE_RATE if late else None,
            components=[ComponentLag(), ComponentLag(delay_cycles=38, lag_cycles=25)] if late else None,
            limits=[Limit("p_max_bar", P_MAX_BAR)] if limited else [],
        )  # fmt: skip


TESTS = (
    _Test(name="1: efficiency", start_cad=-20.0),
    _Test(name="2: efficiency, another start", start_cad=5.0),
    _Test(
        name="3: efficiency and NOx, analyser", start_cad=-20.0, nox_sensor="analyser", period=60, time_constant=240.0
    ),
    _Test(name="4: efficiency and NOx, soft sensor", start_cad=-20.0, nox_sensor="soft"),
)


@dataclass(frozen=True, kw_only=True)
class _Outcome:
    row: dict[str, Any]
    run: xr.Dataset
    table: xr.Dataset


def run_timing_tests(
    *, n_seeds: int = 50, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Run four tests of extremum seeking as an engine test cell would, each over many seeds.

    Test 1 seeks the best gross efficiency from SOC -20, test 2 from +5 °CA aTDC. Tests 3 and 4 charge 0.004 points per
    ppm of NOx: test 3 with the analyser (3 s late, 2 s slow), which asks for a dither of 60 cycles and demodulation of
    NOx with the analyser's phase; test 4 with the soft sensor, which is as fast as test 1. An extra run repeats test 1
    under a limit of 95 bar on the maximum pressure.

    Parameters
    ----------
    n_seeds : int
        Runs of each test, of 3000 cycles.
    quick : bool
        At most ten seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        One row per test: start, optimum of its J, mean estimate of the last 300 cycles, first cycle within 1 CAD,
        each with its 95 % interval over seeds, efficiency and true NOx before (steady, at the start) and after (mean
        of cycles 1500 to 3000, dither included), and the gain in J by true NOx. The limited row adds the worst
        pressure, the share of all cycles and of those from ``judged_from`` on above the limit, and of the latter also
        above ``exceed_above_bar``, the limit and three standard deviations of its scatter.

    References
    ----------
    Tan (2018), section 4.5, ran such tests on an engine; the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.timing_tests import run_timing_tests
    >>> rows = run_timing_tests(n_seeds=2, quick=True, figures=False).summary["rows"]
    >>> [row["gain_percent_points"] > 0.0 for row in rows]
    [True, True, True, True]
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=10)
    work = Parts(progress)
    done = work((f"test {t.name}", partial(_run, t, n_seeds)) for t in TESTS)
    limited = work([("test 1 under a pressure limit", partial(_run, TESTS[0], n_seeds, limited=True))])
    return work.finish(
        "timing-tests", _dataset(done), (lambda _: _draw(done, limited)) if figures else None,
        seeds=n_seeds,
        rows=[outcome.row for outcome in done],
        limited=[outcome.row for outcome in limited],
        nox_weight_percent_per_ppm=NOX_WEIGHT,
        p_max_limit_bar=P_MAX_BAR,
        cycles=CYCLES,
    )  # fmt: skip


def _run(test: _Test, n_seeds: int, *, limited: bool = False) -> _Outcome:
    bench = test.bench(limited=limited)
    caps = {"p_max_bar": P_MAX_BAR} if limited else {}
    best = bench.find_optimum(caps)
    seeker = test.seeker(best, limited=limited)
    above = {name: cap + 3.0 * best[f"scatter_{name}"] for name, cap in caps.items()}
    table = loops(
        bench, seeker, range(n_seeds), cycles=CYCLES,
        criteria=LoopCriteria(optimum=best["soc_cad"], arrival=ARRIVAL_CAD, tail_cycles=TAIL, exceed_above=above),
    )  # fmt: skip
    before = bench.steady_map([test.start_cad])
    efficiency = 100.0 * float(before["efficiency_gross"][0])
    nox = float(before["nox_true_ppm"][0])
    weight = 0.0 if test.nox_sensor == "none" else NOX_WEIGHT
    after = table["mean_efficiency_percent"] - weight * table["mean_nox_ppm"]
    row = {
        "test": test.name,
        "period_cycles": test.period,
        "start_cad": test.start_cad,
        "optimum_cad": best["soc_cad"],
        **with_interval("final_cad", table["final_soc_cad"]),
        "rms_cad": rms(table["rms_soc_cad"]),
        **with_interval("cycles_to_1_cad", table["cycles_to"]),
        "share_arrived": float(np.isfinite(table["cycles_to"]).mean()),
        "efficiency_before_percent": efficiency,
        **with_interval("efficiency_after_percent", table["mean_efficiency_percent"]),
        "nox_before_ppm": nox,
        **with_interval("nox_after_ppm", table["mean_nox_ppm"]),
        **with_interval("gain_percent_points", after - (efficiency - weight * nox)),
    }
    if limited:
        row |= {
            "worst_p_max_bar": float(table["worst_p_max_bar"].max()),
            "above_share": float(table["above_fraction_p_max_bar"].mean()),
            "judged_from": int(table["judged_from"].max()),
            "judged_above_share": float(table["judged_above_fraction_p_max_bar"].mean()),
            "exceed_above_bar": above["p_max_bar"],
            "exceeded_share": float(table["exceeded_fraction"].mean()),
        }
    run = run_with_slope(test.bench(limited=limited), seeker, CYCLES)
    return _Outcome(row=row, run=run, table=table)


def _dataset(done: Sequence[_Outcome]) -> xr.Dataset:
    cad, seeds, cycles = "°CA aTDC", ("test", "seed"), ("test", "cycle")

    def stack(name: str) -> list[Any]:
        return [outcome.table[name].to_numpy() for outcome in done]

    def track(name: str) -> list[Any]:
        return [outcome.run[name].to_numpy() for outcome in done]

    return labelled_dataset(
        {
            "test": ("test", [outcome.row["test"] for outcome in done], "-", "test"),
            "seed": ("seed", done[0].table["seed"].to_numpy().astype(np.int64), "-", "seed"),
            "cycle": ("cycle", np.arange(CYCLES)),
            "optimum_cad": ("test", [outcome.row["optimum_cad"] for outcome in done], cad, "optimum"),
            "final_cad": (seeds, stack("final_soc_cad"), cad, "mean estimate of the last 300 cycles"),
            "cycles_to": (seeds, stack("cycles_to"), "-", "first cycle within 1 °CA of the optimum"),
            "efficiency_after": (seeds, stack("mean_efficiency_percent"), "%", "mean efficiency, second half"),
            "nox_after_ppm": (seeds, stack("mean_nox_ppm"), "ppm", "mean true NOx, second half"),
            "estimate_cad": (cycles, [run[:, 0] for run in track("estimate")], cad, "estimate of the best timing"),
            "soc_requested_cad": (cycles, [run[:, 0] for run in track("asked")]),
            "j": (cycles, track("j")),
            "nox_true_ppm": (cycles, track("nox_true_ppm")),
            "gradient_per_cad": (cycles, track("gradient_per_cad"), "%/°CA", "estimated slope of the objective"),
        }
    )


def _draw(done: Sequence[_Outcome], limited: Sequence[_Outcome]) -> dict[str, Figure]:
    from mgdd import plot

    out = {}
    for outcome, caps in [*((o, None) for o in done), *((o, {"p_max_bar": P_MAX_BAR}) for o in limited)]:
        run, best = outcome.run.isel(cycle=slice(_SHOWN)), outcome.row["optimum_cad"]
        under = f", maximum pressure at most {P_MAX_BAR:g} bar" if caps else ""
        out[f"Test {outcome.row['test']}{under} (one seed)"] = drawn(
            plot.seeking, run, size=(7.4, 8.0 if caps else 6.4), optimum_cad=best, limit_values=caps
        )
    return out
