"""Whether a guide that learns from the pressure beats one that stays wrong: at one operating point, and at the next."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.calibrated_guide_cases import (
    BURN,
    HEAT,
    RECIPES,
    STEADY,
    VARIANTS,
    WIEBE_45,
    WIEBE_60,
    Engine,
    GuidedRun,
    Recipe,
    curve_of,
    guided_run,
    refits_of,
    step_run,
)
from mgdd.studies.calibrated_guide_figures import draw
from mgdd.studies.calibrated_guide_rows import (
    CYCLES,
    TDC_CAD,
    Case,
    Runs,
    Steps,
    bars,
    findings,
    refit_row,
    row,
    setting_row,
    step_row,
    uncalibrated,
)
from mgdd.studies.guide_cases import SteadyMap

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_calibrated_guide"]

SHORT_CYCLES, REFIT_CYCLES = 100, 50
STEP_CYCLE, AFTER = 150, 120
_ENGINES = (WIEBE_45, WIEBE_60)
_STARTS_CAD = (-20.0, 0.0)


def run_calibrated_guide(
    *, seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
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
    seeds : int
        Runs of every case.
    quick : bool
        At most two seeds.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

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

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), chapter 6 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.calibrated_guide import run_calibrated_guide
    >>> rows = run_calibrated_guide(seeds=1, quick=True, figures=False).summary["rows"]
    >>> [round(rows[at]["guide_error_end_cad"], 0) for at in (0, 1)]  # Wiebe 45, not calibrated and calibrated
    [7.0, -1.0]
    """
    seeds = min(check_seeds(seeds), 2) if quick else check_seeds(seeds)
    maps = {engine.name: SteadyMap.of(engine.bench()) for engine in _ENGINES}
    runs, interrupted = run_parts([(case.name, partial(seek, case, maps, seeds)) for case in _main_cases()], progress)
    refits: list[dict[str, Any]] = []
    settings: list[Runs] = []
    steps: list[Steps] = []
    if not interrupted:
        parts = [
            (f"refits, {engine.name}, {recipe.name}", partial(_refits, engine, recipe, maps, seeds))
            for engine in _ENGINES for recipe in (HEAT, BURN)
        ]  # fmt: skip
        refits, interrupted = run_parts(parts, progress)
    if not interrupted:
        cases = [
            Case(engine=engine, start_cad=start, recipe=recipe, cycles=SHORT_CYCLES)
            for engine, start in zip(_ENGINES, _STARTS_CAD, strict=True) for recipe in VARIANTS
        ]  # fmt: skip
        settings, interrupted = run_parts([(c.name, partial(seek, c, maps, seeds)) for c in cases], progress)
    if not interrupted:
        each = [
            (engine, form, recipe)
            for engine in _ENGINES
            for form in ("curve", "feed-forward")
            for recipe in (*RECIPES, STEADY)
        ]
        texts = [f"load step, {form}, {engine.name}, calibrated: {recipe.name}" for engine, form, recipe in each]
        works = [partial(_step, engine, form, recipe, seeds) for engine, form, recipe in each]
        steps, interrupted = run_parts(list(zip(texts, works, strict=True)), progress)
    rows = [row(own, uncalibrated(own, runs)) for own in runs]
    step_rows = [step_row(own, steps) for own in steps]
    summary = {
        "study": "calibrated-guide",
        "seeds": seeds,
        "rows": rows,
        "refits": refits,
        "settings": [setting_row(own, uncalibrated(own, settings)) for own in settings],
        "load_step": step_rows,
        "findings": findings(rows, step_rows),
        "bars": bars(rows, refits),
        "guide_cad": curve_of().best,
        "interrupted": interrupted,
    }
    return finish(_dataset(runs, steps), to_jsonable(summary), draw if figures else None)


def _main_cases() -> list[Case]:
    return [
        Case(engine=engine, start_cad=start, recipe=recipe, tdc_error_cad=tdc)
        for tdc in (0.0, TDC_CAD) for engine in _ENGINES for start in _STARTS_CAD
        for recipe in (RECIPES if tdc == 0.0 else (HEAT, BURN))
    ]  # fmt: skip


def seek(case: Case, maps: dict[str, SteadyMap], seeds: int) -> Runs:
    """Run one case, once per seed."""
    steady = maps[case.engine.name]
    found = [
        guided_run(
            case.engine.bench(seed, tdc_error_cad=case.tdc_error_cad), case.recipe, case.start_cad, case.cycles
        )
        for seed in range(seeds)
    ]  # fmt: skip
    return Runs(case=case, best_cad=steady.best_cad, **_errors(found, steady))


def _errors(found: list[GuidedRun], steady: SteadyMap) -> dict[str, NDArray[np.float64]]:
    return {
        "error": np.stack([run.estimate for run in found]) - steady.best_cad,
        "guide_error": np.stack([run.guide for run in found]) - steady.best_cad,
        "lost": np.stack([steady.lost(run.applied) for run in found]),
    }


def _refits(engine: Engine, recipe: Recipe, maps: dict[str, SteadyMap], seeds: int) -> dict[str, Any]:
    found = [refits_of(engine.bench(seed), recipe, _STARTS_CAD[0], REFIT_CYCLES) for seed in range(seeds)]
    return refit_row(engine, recipe, found, maps[engine.name].best_cad)


def _step(engine: Engine, form: str, recipe: Recipe, seeds: int) -> Steps:
    _, after = engine.step_maps()
    whole = [step_run(engine.stepping(seed, STEP_CYCLE), recipe, form, STEP_CYCLE + AFTER) for seed in range(seeds)]
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
        "cycle": ("cycle", np.arange(CYCLES)),
        "seed": ("seed", np.arange(runs[0].error.shape[0]), "-", "seed"),
        "late_error_cad": (("run", "seed"), [own.late for own in runs], "°CA", "mean error after 60 cycles"),
    }
    for at, (name, text) in enumerate((("median", "median"), ("low", "10 % quantile"), ("high", "90 % quantile"))):
        share = (0.5, 0.1, 0.9)[at]
        for what, label in (("error", "error of the estimate"), ("guide_error", "error of the guide")):
            bands = [np.quantile(getattr(own, what), share, axis=0) for own in runs]
            variables[f"{what}_{name}_cad"] = (("run", "cycle"), bands, "°CA", f"{label}, {text}")
    if steps:
        names = [f"{own.engine.name}, {own.form}, {own.recipe.name}" for own in steps]
        variables["step"] = ("step", names, "-", "engine, form and calibration")
        variables["after_step"] = ("after_step", np.arange(AFTER), "-", "cycles since the load step")
        variables["step_lost"] = (("step", "seed"), [own.lost for own in steps], "%", "J lost after the load step")
        for at, name in enumerate(("median", "low", "high")):
            bands = [np.quantile(own.error, (0.5, 0.1, 0.9)[at], axis=0) for own in steps]
            label = "error of the estimate after the load step" + ("", ", 10 % quantile", ", 90 % quantile")[at]
            variables[f"step_error_{name}_cad"] = (("step", "after_step"), bands, "°CA", label)
    return labelled_dataset(variables)
