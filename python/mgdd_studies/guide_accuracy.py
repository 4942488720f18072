"""How wrong a guide may be and still help: a load step with each guide, and trouble that no guide announces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.guide import Curve, FeedForward
from mgdd.loop import SensorDynamics, VirtualEngine
from mgdd.plot.style import new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.curves import convergence
from mgdd_studies.figures import grey_band, names_of
from mgdd_studies.guide_cases import (
    GUIDES,
    HIGH,
    LOW,
    Guide,
    SteadyMap,
    curve_seeker,
    drive,
    no_model,
    trimmed,
    verdicts,
)
from mgdd_studies.statistics import (
    band_variables,
    first_within,
    mean_interval,
    quantile_of,
    quantiles_of,
    rms,
    stays_within,
    with_interval,
    with_median_interval,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_guide_accuracy"]

SETTLED, AFTER, JUDGED, FINAL = 500, 900, 200, 400
_TEST_CYCLES = 3  # of a feed-forward's test at the new point, and one more
_EXCESS_PERCENT = {"wall heat -30 %": 5.0, "wall heat +30 %": 5.0, "duration -15 %": 10.0, "adiabatic": 50.0}
_GOOD = ("exact", "wall heat -30 %", "wall heat +30 %")


@dataclass(frozen=True, kw_only=True)
class _Step:
    """Runs of one guide: loss of the cycles after the step, cycles back to 1 CAD, final mean, each by seed."""

    form: str
    guide: Guide | None
    lost: NDArray[np.float64]
    back: NDArray[np.float64]
    final: NDArray[np.float64]
    refused: NDArray[np.bool_]
    estimates: NDArray[np.float64]

    @property
    def name(self) -> str:
        return "none" if self.guide is None else self.guide.name


def run_guide_accuracy(
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Measure what a wrong guide costs after a load step, and how curve-guided seeking takes what no guide knows.

    The load steps from 12 to 30 mg at 1500 rpm in cycle 500, with burn durations of 24 and 44 °CA, so that the optimum
    moves from -4.2 to -10.7 °CA aTDC. Every guide serves as feed-forward of extremum seeking (moving average, amplitude
    1, period 10, time constant 40, no clip; 0.25 points of noise, timing applied as asked) and as the curve of
    curve-guided seeking on the same noise. Then curve-guided seeking meets an optimum that jumps by 6 °CA, a J that
    comes 38 cycles late with a lag of 25, a cliff, three times the noise, and a drift, each with 0.3 °CA of scatter.

    Parameters
    ----------
    n_seeds : int
        Runs of every case.
    quick : bool
        At most six seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``form guide error_before_cad error_after_cad cycles_back median_back lost excess_percent_of_unguided
        cost_over_unguided found_wrong_percent final_shift_cad``: loss is J lost over the 200 cycles after the step
        [points x cycles]; the excess is what goes beyond the exact feed-forward, in percent of the unguided seeker's;
        the final shift is the mean of the last 400 estimates less that of the unguided seeker on the same noise.
        ``summary["trouble"]`` has one row per unannounced trouble, ``summary["bars"]`` what was demanded of both.

    References
    ----------
    Tan (2018), figures 5-6 and 5-7 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("guide-accuracy", n_seeds=4, quick=True)
    >>> rows = {(row["form"], row["guide"]): row for row in result.summary["rows"]}
    >>> rows["feed-forward", "wall heat +30 %"]["lost"] < 0.5 * rows["feed-forward", "none"]["lost"]
    True
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=6)
    work = Parts(progress)
    maps = [SteadyMap.of(VirtualEngine(point=point)) for point in (LOW, HIGH)]
    plain: list[Guide | None] = [None, *GUIDES]
    wanted = [("feed-forward", guide) for guide in plain] + [("curve", guide) for guide in GUIDES]
    done = work(
        (f"load step, {form}, {'none' if guide is None else guide.name}", partial(_step, form, guide, maps[1], n_seeds))
        for form, guide in wanted
    )
    trouble = work((case.name, partial(run_hard, case, n_seeds)) for case in HARD)
    rows = [_row(step, done, maps) for step in done]
    return work.finish(
        "guide-accuracy", _dataset(done, trouble, maps), _draw if figures else None,
        seeds=n_seeds,
        rows=rows,
        trouble=[hard.row for hard in trouble],
        bars=_bars(rows) + hard_bars(trouble),
        optimum_before_cad=maps[0].best_cad,
        optimum_after_cad=maps[1].best_cad,
    )  # fmt: skip


def _step(form: str, guide: Guide | None, after: SteadyMap, n_seeds: int) -> _Step:
    lost, back, final, refused, estimates = [], [], [], [], []
    curve_at = None if guide is None else guide.curve
    for seed in range(n_seeds):
        bench = VirtualEngine(schedule=[(0, LOW), (SETTLED, HIGH)], soc_scatter_cad=0.0, seed=seed)
        seeker = curve_seeker(guide.curve(LOW)) if guide is not None and form == "curve" else trimmed(guide)
        first = drive(bench, seeker, SETTLED + _TEST_CYCLES, curve_at=curve_at)
        refused.append(isinstance(seeker, FeedForward) and seeker.verdict == "wrong")
        second = drive(bench, seeker, AFTER - _TEST_CYCLES, curve_at=curve_at)
        estimate = np.concatenate([first.estimate, second.estimate])[SETTLED:]
        applied = np.concatenate([first.applied, second.applied])[SETTLED:]
        lost.append(after.lost(applied[:JUDGED]).sum())
        back.append(first_within(estimate, after.best_cad, 1.0))
        final.append(estimate[-FINAL:].mean())
        estimates.append(np.concatenate([first.estimate[SETTLED - 50 : SETTLED], estimate[:JUDGED]]))
    return _Step(
        form=form, guide=guide, lost=np.array(lost), back=np.array(back), final=np.array(final),
        refused=np.array(refused), estimates=np.stack(estimates),
    )  # fmt: skip


def _row(step: _Step, done: list[_Step], maps: list[SteadyMap]) -> dict[str, Any]:
    """Compare with the unguided seeker and the exact feed-forward on the same noise."""
    known = {(own.form, own.name): own for own in done}
    none, exact = known["feed-forward", "none"], known.get(("feed-forward", "exact"))
    share = np.full(step.lost.size, math.nan)
    if exact is not None:
        share = 100.0 * (step.lost - exact.lost) / float(np.mean(none.lost - exact.lost))
    cost = step.lost / float(none.lost.mean())
    errors = [math.nan, math.nan]
    if step.guide is not None:
        errors = [step.guide(point)["soc_cad"] - m.best_cad for point, m in zip((LOW, HIGH), maps, strict=True)]
    return {
        "form": step.form,
        "guide": step.name,
        "error_before_cad": errors[0],
        "error_after_cad": errors[1],
        **with_interval("cycles_back", np.where(np.isfinite(step.back), step.back, np.nan)),
        **with_median_interval("median_back", step.back),
        **with_interval("lost", step.lost),
        **with_interval("excess_percent_of_unguided", share),
        "cost_over_unguided": mean_interval(cost)[0],
        "found_wrong_percent": 100.0 * float(step.refused.mean()) if step.form == "feed-forward" else math.nan,
        **with_interval("final_shift_cad", step.final - none.final),
    }


def _bars(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    def trims(key: str, *names: str) -> list[float]:
        return [row[key] for row in rows if row["form"] == "feed-forward" and row["guide"] in names]

    excess = "excess loss after the step [% of unguided]"
    shift = "final mean off that of the unguided seeker [CAD]"
    return verdicts([
        *(
            (f"feed-forward, {name}: {excess}", trims("excess_percent_of_unguided", name), most)
            for name, most in _EXCESS_PERCENT.items()
        ),
        ("feed-forward, wrong sign: cost over unguided [-]", trims("cost_over_unguided", "wrong sign"), 1.2),
        ("feed-forward, good guides: false alarms [%]", trims("found_wrong_percent", *_GOOD), 1.0),
        *(
            (f"{form}: {shift}", [abs(row["final_shift_cad"]) for row in rows
                                  if row["form"] == form and row["guide"] != "none"], 0.1)
            for form in ("feed-forward", "curve")
        ),
    ])  # fmt: skip


def _dataset(done: list[_Step], trouble: list[Hard], maps: list[SteadyMap]) -> xr.Dataset:
    cad, own = "°CA aTDC", ("run", "seed")
    said = quantiles_of("estimate", "estimate of the best timing")
    variables: dict[str, tuple[Any, ...]] = {
        "run": ("run", [f"{step.form}, {step.name}" for step in done], "-", "form and guide"),
        "seed": ("seed", np.arange(done[0].lost.size), "-", "seed"),
        "cycle": ("cycle", np.arange(-50, JUDGED)),
        "lost": (own, [step.lost for step in done], "%", "loss of efficiency over the 200 cycles after the load step"),
        "cycles_back": (own, [step.back for step in done], "-", "first cycle within 1 °CA after the step"),
        "final_cad": (own, [step.final for step in done], cad, "mean estimate of the last 400 cycles"),
        "optimum_before_cad": ((), maps[0].best_cad, cad, "optimum before the load step"),
        "optimum_after_cad": ((), maps[1].best_cad, cad, "optimum after the load step"),
        **band_variables("estimate_{}_cad", ("run", "cycle"), [step.estimates for step in done], cad, said),
    }
    if trouble:
        errors = [hard.error for hard in trouble]
        said = quantiles_of("error", "error of the estimate")
        variables |= {
            "trouble": ("trouble", [hard.case.name for hard in trouble], "-", "unannounced trouble"),
            "trouble_cycle": ("trouble_cycle", np.arange(CYCLES), "-", "cycle"),
            **band_variables("error_{}_cad", ("trouble", "trouble_cycle"), errors, "°CA", said),
        }
    return labelled_dataset(variables)


CYCLES, CHANGE_AT, LATE = 500, 200, 200
_DELAY, _LAG, _CLIFF_PER_CAD = 38, 25.0, 2.0
_LOST_CAD = 2.0  # a run is lost whose mean estimate of the last 100 cycles lies farther off
_BY_NAME = {guide.name: guide for guide in GUIDES}


@dataclass(frozen=True, kw_only=True)
class HardCase:
    """A trouble, the curve that guides (a parabola at -10 without a name) and the delay given to the seeker."""

    name: str
    guide: str | None = "wall heat +30 %"
    start_cad: float | None = None
    jump_cad: float = 0.0
    drift_cad_per_kcycle: float = 0.0
    cliff: bool = False
    told_delay: float | None = None
    noise_percent: float = 0.25
    reading_noise_percent: float = 0.0  # behind delay and lag

    def curve(self) -> Curve:
        """Give the guide's curve at the default point."""
        if self.guide is None:
            return no_model()
        return _BY_NAME[self.guide].curve(OperatingPoint())

    def bench(self, seed: int) -> VirtualEngine:
        """Make the engine of one run."""
        late: dict[str, Any] = {}
        if self.told_delay is not None:
            sensor = SensorDynamics(delay_cycles=_DELAY, lag_cycles=_LAG, noise_fraction=0.0)
            late = {"analyser": sensor, "delay_whole_objective": True, "nox_sensor": "true_value"}
        return VirtualEngine(efficiency_noise_percent=self.noise_percent, seed=seed, **late)

    def late_by_cad(self, cycle: int) -> float:
        """Give by how much combustion is later than asked for [°CA]."""
        return (self.jump_cad if cycle >= CHANGE_AT else 0.0) + 1e-3 * self.drift_cad_per_kcycle * cycle


HARD: tuple[HardCase, ...] = (
    HardCase(name="jump by 6 CAD, wall heat +30 %", jump_cad=6.0),
    HardCase(name="jump by -6 CAD, wall heat +30 %", jump_cad=-6.0),
    HardCase(name="jump by 6 CAD, adiabatic", guide="adiabatic", jump_cad=6.0),
    HardCase(name="efficiency late, delay known", start_cad=-20.0, told_delay=38.0, reading_noise_percent=0.25),
    HardCase(name="efficiency late, delay given 4 short", start_cad=-20.0, told_delay=34.0, reading_noise_percent=0.25),
    HardCase(name="efficiency late, delay given 4 long", start_cad=-20.0, told_delay=42.0, reading_noise_percent=0.25),
    HardCase(name="efficiency late, noise before the lag only", start_cad=-20.0, told_delay=38.0),
    HardCase(name="cliff behind the optimum, wall heat +30 %", start_cad=-20.0, cliff=True),
    HardCase(name="cliff behind the optimum, from its steep side", start_cad=0.0, cliff=True),
    HardCase(name="three times the noise, parabola", guide=None, start_cad=-20.0, noise_percent=0.75),
    HardCase(name="drift of 10 CAD per 1000 cycles", drift_cad_per_kcycle=10.0),
)


@dataclass(frozen=True, kw_only=True)
class Hard:
    """What a case came to: its row, and the error of the estimate by seed and cycle [°CA]."""

    case: HardCase
    row: dict[str, Any]
    error: NDArray[np.float64]


def run_hard(case: HardCase, n_seeds: int) -> Hard:
    """Run a case; a jump or drift is a combustion that comes later than asked for, so that J keeps its height."""
    curve, steady = case.curve(), SteadyMap.of(VirtualEngine())
    best = steady.best_cad
    target = best - np.array([case.late_by_cad(cycle) for cycle in range(CYCLES)])

    def fall(soc_cad: Any) -> Any:
        return -_CLIFF_PER_CAD * np.maximum(soc_cad - best, 0.0) if case.cliff else 0.0 * np.asarray(soc_cad)

    errors, lost, inside = [], [], []
    for seed in range(n_seeds):
        rng = np.random.default_rng(seed)

        def told(soc_cad: float, rng: np.random.Generator = rng) -> float:
            return float(fall(soc_cad)) + case.reading_noise_percent * float(rng.standard_normal())

        sensor = {} if case.told_delay is None else {"delay": case.told_delay, "lag": _LAG}
        seeker = curve_seeker(curve, start=case.start_cad, **sensor)
        run = drive(case.bench(seed), seeker, CYCLES, late_by_cad=case.late_by_cad, beyond=told)
        error = run.estimate - target
        errors.append(error)
        lost.append((steady.lost(run.applied) - fall(run.applied))[-LATE:].mean())
        with np.errstate(invalid="ignore"):
            inside.append(100.0 * np.mean(np.abs(error) <= 1.96 * run.estimate_sd, where=np.arange(CYCLES) >= LATE))
    table = np.stack(errors)
    first = np.array([first_within(error, 0.0, 1.0) for error in table])
    stays = np.array([stays_within(error[:CHANGE_AT], 0.0, 1.5) for error in table])
    back = np.array([first_within(error[CHANGE_AT:], 0.0, 2.0) for error in table])
    stays_back = np.array([stays_within(error[CHANGE_AT : CHANGE_AT + 60], 0.0, 2.0) for error in table])
    off = np.abs(table[:, -100:].mean(axis=1)) > _LOST_CAD
    jumps = case.jump_cad != 0.0
    row = {
        "trouble": case.name,
        "start_cad": curve.best if case.start_cad is None else case.start_cad,
        **with_median_interval("median_first", first),
        "first_95_percent": quantile_of(first, 0.95),
        **with_median_interval("median_stays", stays),
        **with_median_interval("median_back", back if jumps else []),
        "back_95_percent": quantile_of(back, 0.95) if jumps else None,
        **with_median_interval("median_stays_back", stays_back if jumps else []),
        **with_interval("late_loss_percent", lost),
        "late_rms_cad": rms(table[:, -LATE:]),
        **with_interval("covered_percent", inside),
        "lost_runs_percent": 100.0 * float(off.mean()),
    }
    return Hard(case=case, row=row, error=table)


def hard_bars(done: list[Hard]) -> list[dict[str, Any]]:
    """Say which bars the cases met."""

    def values(key: str, which: Callable[[HardCase], Any]) -> list[float | None]:
        return [hard.row[key] for hard in done if which(hard.case)]

    wanted = (
        ("jump: back within 2 CAD, median [cycles]", values("median_back", lambda c: c.jump_cad), 6.0),
        ("jump: back within 2 CAD, 95th percentile [cycles]", values("back_95_percent", lambda c: c.jump_cad), 25.0),
        ("efficiency late: to 1 CAD, median [cycles]", values("median_first", lambda c: c.told_delay == _DELAY), 45.0),
        (
            "efficiency late, delay given ±4: lost runs [%]",
            values("lost_runs_percent", lambda c: c.told_delay in (34.0, 42.0)), 0.0,
        ),
        (
            "efficiency late, noise before the lag only: lost runs [%]",
            values("lost_runs_percent", lambda c: c.told_delay is not None and not c.reading_noise_percent), 0.0,
        ),
        ("cliff: loss of the last 200 cycles [points]", values("late_loss_percent", lambda c: c.cliff), 0.05),
    )  # fmt: skip
    return verdicts((f"curve, {text}", found, most) for text, found, most in wanted)


_DRAWN = ("wall heat +30 %", "duration -15 %", "adiabatic", "wrong sign")


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    runs = names_of(dataset, "run")
    names = ["estimate_median_cad", "estimate_low_cad", "estimate_high_cad"]
    figure = new_figure(11.0, 4.4)
    for ax, form in zip(figure.subplots(1, 2, sharey=True), ("feed-forward", "curve"), strict=True):
        wanted = [f"{form}, {name}" for name in _DRAWN]
        kept = [name for name in ("feed-forward, none", *wanted) if name in runs]
        own = dataset[[*names, "optimum_after_cad"]].sel(run=kept).rename(optimum_after_cad="optimum_cad")
        labels = [name.partition(", ")[2] for name in kept]
        own = own.assign_coords(run=("run", labels, dataset["run"].attrs))
        convergence(own, ax=ax)
        ax.annotate(f"guide as {form}", (0.98, 0.96), xycoords="axes fraction", ha="right", va="top")
        ax.set_xlabel("engine cycle since the load step [-]")
    out = {"Load step from 12 to 30 mg: median of the estimate over the seeds, and the band of 80 % of them": figure}
    if "trouble" in dataset:
        cases = names_of(dataset, "trouble")
        figure = new_figure(11.0, 2.1 * -(-len(cases) // 2))
        axes = figure.subplots(-(-len(cases) // 2), 2, sharex=True, sharey=True, squeeze=False)
        cycle = dataset["trouble_cycle"].to_numpy()
        for ax, at in zip(axes.flat, range(len(cases)), strict=False):
            ends = [dataset[f"error_{end}_cad"][at].to_numpy() for end in ("low", "median", "high")]
            grey_band(ax, cycle, *ends, linewidth=1.0)
            ax.set_title(cases[at], loc="left", fontsize="small")
            ax.set_ylim(-8.0, 8.0)
        for ax in axes.flat[len(cases) :]:
            ax.remove()
        for ax in axes.flat[len(cases) - 2 : len(cases)]:
            ax.tick_params(labelbottom=True)
        figure.supylabel("error of the estimate [°CA]", fontsize="medium")
        figure.supxlabel("engine cycle [-]", fontsize="medium")
        out["Unannounced trouble, curve-guided: median error of the estimate and the band of 80 % of the seeds"] = (
            figure
        )
    return out
