"""Whether a guide that learns from the pressure beats one that stays wrong: at one operating point, and at the next."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies import calibrated_guide_cases as cases
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.calibrated_guide_cases import Case, Engine, GuidedRun, Recipe, Runs, Steps
from mgdd_studies.figures import band, legend_outside, names_of
from mgdd_studies.guide_cases import SteadyMap
from mgdd_studies.statistics import band_variables, with_quantiles

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_calibrated_guide"]

SHORT_CYCLES, REFIT_CYCLES = 100, 50
STEP_CYCLE, AFTER = 150, 120
_ENGINES = (cases.WIEBE_45, cases.WIEBE_60)
_STARTS_CAD = (-20.0, 0.0)
_MAIN_CASES = [
    Case(engine=engine, start_cad=start, recipe=recipe, tdc_error_cad=tdc)
    for tdc in (0.0, cases.TDC_CAD) for engine in _ENGINES for start in _STARTS_CAD
    for recipe in (cases.RECIPES if tdc == 0.0 else (cases.HEAT, cases.BURN))
]  # fmt: skip
_SHORT_CASES = [
    Case(engine=engine, start_cad=start, recipe=recipe, cycles=SHORT_CYCLES)
    for engine, start in zip(_ENGINES, _STARTS_CAD, strict=True) for recipe in cases.VARIANTS
]  # fmt: skip


def run_calibrated_guide(
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Seek with a guide of the wrong burn and wall heat, which the measured pressure calibrates or not.

    Two engines with a Wiebe burn, 45 °CA with a wall heat of 0.5 and 60 °CA with 0.35, and one guide: a triangle of
    30 °CA with a wall heat of 1.0, whose best timing is 7 and 15 °CA too late. Curve-guided seeking starts at -20 and
    0 °CA aTDC; pressure has 0.2 bar of noise, J 0.25 points, the timing scatters by 0.3 °CA. Calibrated is nothing, the
    wall heat (`mgdd engine seek --guide calibrated`), or wall heat and burn duration where the timing counts as known
    to 3 °CA only. Then, with the curve and with the guide's best timing as feed-forward of extremum seeking, the load
    steps from 12 to 30 mg.

    Parameters
    ----------
    n_seeds : int
        Runs of every case.
    quick : bool
        At most two seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``engine start_cad calibrated tdc_error_cad median_stays stays_90_percent late_error_cad
        late_error_less_cad late_lost_percent guide_error_cad guide_error_10_cad guide_error_60_cad
        guide_error_end_cad``:
        cycle from which the estimate stays within 1.5 °CA of the best timing (median, and 90 % of the runs); mean
        absolute error after 60 cycles, how much less it is than without calibration on the same noise, J lost per cycle
        there; how far the guide's best timing is off before, and after 10, 60 and all cycles (median).
        ``summary["refits"]``: what a calibration did to the estimate, against the same cycle without it.
        ``summary["settings"]``: other parameters, windows and trusts, 100 cycles each. ``summary["load_step"]``: J
        lost after a load step. ``summary["findings"]``: what calibration gains, in words. ``summary["bars"]``: what was
        demanded.

    References
    ----------
    Tan (2018), chapter 6 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("calibrated-guide", n_seeds=2, quick=True).summary["rows"]
    >>> [round(rows[at]["guide_error_end_cad"], 0) for at in (0, 1)]  # Wiebe 45, not calibrated and calibrated
    [7.0, -1.0]
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=2)
    work = Parts(progress)
    maps = {engine.name: SteadyMap.of(engine.bench()) for engine in _ENGINES}
    runs = work((case.name, partial(_seek, case, maps, n_seeds)) for case in _MAIN_CASES)
    refits = work(
        (f"refits, {engine.name}, {recipe.name}", partial(_refits, engine, recipe, maps, n_seeds))
        for engine in _ENGINES for recipe in (cases.HEAT, cases.BURN)
    )  # fmt: skip
    settings = work((case.name, partial(_seek, case, maps, n_seeds)) for case in _SHORT_CASES)
    steps = work(
        (f"load step, {form}, {engine.name}, calibrated: {recipe.name}", partial(_step, engine, form, recipe, n_seeds))
        for engine in _ENGINES for form in ("curve", "feed-forward") for recipe in (*cases.RECIPES, cases.STEADY)
    )  # fmt: skip
    rows = [cases.row(own, cases.uncalibrated(own, runs)) for own in runs]
    step_rows = [cases.step_row(own, steps) for own in steps]
    return work.finish(
        "calibrated-guide", _dataset(runs, steps), _draw if figures else None,
        seeds=n_seeds,
        rows=rows,
        refits=refits,
        settings=[cases.setting_row(own, cases.uncalibrated(own, settings)) for own in settings],
        load_step=step_rows,
        findings=cases.findings(rows, step_rows),
        bars=cases.bars(rows, refits),
        guide_cad=cases.curve_of().best,
    )  # fmt: skip


def _seek(case: Case, maps: dict[str, SteadyMap], n_seeds: int) -> Runs:
    """Run one case, once per seed."""
    steady = maps[case.engine.name]
    benches = [case.engine.bench(seed, tdc_error_cad=case.tdc_error_cad) for seed in range(n_seeds)]
    found = [cases.guided_run(bench, case.recipe, case.start_cad, case.cycles) for bench in benches]
    return Runs(case=case, best_cad=steady.best_cad, **_errors(found, steady))


def _errors(found: list[GuidedRun], steady: SteadyMap) -> dict[str, NDArray[np.float64]]:
    return {
        "error": np.stack([run.estimate for run in found]) - steady.best_cad,
        "guide_error": np.stack([run.guide for run in found]) - steady.best_cad,
        "lost": np.stack([steady.lost(run.applied) for run in found]),
    }


def _refits(engine: Engine, recipe: Recipe, maps: dict[str, SteadyMap], n_seeds: int) -> dict[str, Any]:
    found = [cases.refits_of(engine.bench(seed), recipe, _STARTS_CAD[0], REFIT_CYCLES) for seed in range(n_seeds)]
    return cases.refit_row(engine, recipe, found, maps[engine.name].best_cad)


def _step(engine: Engine, form: str, recipe: Recipe, n_seeds: int) -> Steps:
    _, after = engine.step_maps()
    whole = [
        cases.step_run(engine.stepping(seed, STEP_CYCLE), recipe, form, STEP_CYCLE + AFTER) for seed in range(n_seeds)
    ]
    found = _errors([GuidedRun(*(column[STEP_CYCLE:] for column in run)) for run in whole], after)
    return Steps(
        engine=engine, form=form, recipe=recipe, error=found["error"], guide_error=found["guide_error"][:, 0],
        lost=found["lost"].sum(axis=1),
    )  # fmt: skip


def _dataset(runs: list[Runs], steps: list[Steps]) -> xr.Dataset:
    cad = "°CA aTDC"
    variables: dict[str, tuple[Any, ...]] = {
        "run": ("run", [own.case.name for own in runs], "-", "engine, start and calibration"),
        "engine": ("run", [own.case.engine.name for own in runs], "-", "engine"),
        "calibrated": ("run", [own.case.recipe.name for own in runs], "-", "what is calibrated"),
        "start_cad": ("run", [own.case.start_cad for own in runs], cad, "start of the run"),
        "tdc_error_cad": ("run", [own.case.tdc_error_cad for own in runs], "°CA", "error of TDC of the pressure"),
        "best_cad": ("run", [own.best_cad for own in runs], cad, "best timing"),
        "cycle": ("cycle", np.arange(cases.CYCLES)),
        "seed": ("seed", np.arange(runs[0].error.shape[0]), "-", "seed"),
        "late_error_cad": (("run", "seed"), [own.late for own in runs], "°CA", "mean error after 60 cycles"),
    }
    for what, label in (("error", "error of the estimate"), ("guide_error", "error of the guide")):
        said = with_quantiles(label) | {"median": f"{label}, median"}
        variables |= band_variables(
            f"{what}_{{}}_cad", ("run", "cycle"), [getattr(own, what) for own in runs], "°CA", said
        )
    if steps:
        names = [f"{own.engine.name}, {own.form}, {own.recipe.name}" for own in steps]
        text = "error of the estimate after the load step"
        bands = [own.error for own in steps]
        variables |= {
            "step": ("step", names, "-", "engine, form and calibration"),
            "after_step": ("after_step", np.arange(AFTER), "-", "cycles since the load step"),
            "step_lost": (("step", "seed"), [own.lost for own in steps], "%", "loss of efficiency after the load step"),
            **band_variables("step_error_{}_cad", ("step", "after_step"), bands, "°CA", with_quantiles(text)),
        }
    return labelled_dataset(variables)


_LOOKS = dict(zip((recipe.name for recipe in cases.RECIPES), (("-", BLACK), ("--", BLUE), ("-.", ORANGE)), strict=True))
_SHOWN, _SHOWN_AFTER = 80, 60


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    out = {
        "Error of the guide's best timing (above) and of the estimate (below): median of the seeds, and the band that "
        "holds 80 % of them": _starts(dataset)
    }
    if "step" in dataset:
        out["Error of the estimate after a load step from 12 to 30 mg, by the curve and by feed-forward"] = _steps(
            dataset
        )
    return out


def _starts(dataset: xr.Dataset) -> Figure:
    own = dataset.isel(run=np.flatnonzero(dataset["tdc_error_cad"] == 0.0))
    columns = list(dict.fromkeys(zip(own["engine"].to_numpy(), own["start_cad"].to_numpy(), strict=True)))
    figure = new_figure(3.1 * len(columns) + 0.6, 5.4)
    axes = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    for (above, below), (engine, start) in zip(axes.T, columns, strict=True):
        runs = own.isel(
            run=np.flatnonzero((own["engine"] == engine) & (own["start_cad"] == start)), cycle=slice(_SHOWN)
        )
        for at, name in enumerate(map(str, runs["calibrated"].to_numpy())):
            one = runs.isel(run=at)
            _band(above, one["cycle"], one, "guide_error", name)
            _band(below, one["cycle"], one, "error", name)
        above.set_title(f"{engine},\nfrom {start:g} °CA aTDC".replace("-", "−"), loc="left", fontsize="small")
        below.set_ylim(-4.0, 4.0)
        below.axhspan(-1.5, 1.5, color=GREY, alpha=0.15, linewidth=0.0)
    axes[0, 0].set_ylabel("error of the guide's\nbest timing [°CA]")
    axes[1, 0].set_ylabel("error of the estimate [°CA]")
    figure.supxlabel("engine cycle [-]", fontsize="medium")
    legend_outside(figure, axes[0, 0], 3)
    return figure


def _steps(dataset: xr.Dataset) -> Figure:
    parts = [name.rsplit(", ", 2) for name in names_of(dataset, "step")]
    columns = list(dict.fromkeys((engine, form) for engine, form, _ in parts))
    figure = new_figure(3.1 * len(columns) + 0.6, 3.8)
    axes = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    cycle = dataset["after_step"].to_numpy()[:_SHOWN_AFTER]
    for ax, case in zip(axes, columns, strict=True):
        for at, (engine, form, name) in enumerate(parts):
            if (engine, form) == case and name in _LOOKS:
                _band(ax, cycle, dataset.isel(step=at, after_step=slice(_SHOWN_AFTER)), "step_error", name)
        ax.axhspan(-1.5, 1.5, color=GREY, alpha=0.15, linewidth=0.0)
        ax.set_title(f"{case[0]},\n{case[1]}", loc="left", fontsize="small")
    axes[0].set_ylabel("error of the estimate [°CA]")
    figure.supxlabel("cycles since the load step [-]", fontsize="medium")
    legend_outside(figure, axes[0], 3)
    return figure


def _band(ax: Axes, cycle: xr.DataArray | np.ndarray, one: xr.Dataset, what: str, name: str) -> None:
    dash, color = _LOOKS[name]
    ends = [one[f"{what}_{end}_cad"] for end in ("low", "median", "high")]
    label = "not calibrated" if name == "none" else f"calibrated: {name}"
    band(ax, cycle, *ends, dash=dash, color=color, alpha=0.13, linewidth=1.3, label=label)
    ax.axhline(0.0, color=GREY, linewidth=0.7)
    ax.grid(alpha=0.3)
