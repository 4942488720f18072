"""Rows of the study of a guide that learns: what the runs of a case came to, and the bars they are held to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.studies.calibrated_guide_cases import BURN, HEAT, NONE, Engine, Recipe, Refit
from mgdd.studies.guide_cases import first_within, stays_within, verdict_on
from mgdd.studies.statistics import with_interval, with_median_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Case", "Runs", "Steps", "bars", "findings", "refit_row", "row", "setting_row", "step_row", "uncalibrated"]

CYCLES, LATE = 200, 60
TDC_CAD = 0.3
_STAY_CAD, _BACK_CAD, _NEAR_AFTER = 1.5, 1.0, 10


@dataclass(frozen=True, kw_only=True)
class Case:
    """An engine, where seeking starts on it, how the guide is calibrated, and how late TDC is read."""

    engine: Engine
    start_cad: float
    recipe: Recipe
    tdc_error_cad: float = 0.0
    cycles: int = CYCLES

    @property
    def name(self) -> str:
        """For a progress line."""
        tdc = f", TDC {self.tdc_error_cad:g} CAD late" if self.tdc_error_cad else ""
        return f"{self.engine.name} from {self.start_cad:g}, calibrated: {self.recipe.name}{tdc}"


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Of one case, one row per seed: errors of estimate and guide [°CA], J lost by what was applied [points]."""

    case: Case
    error: NDArray[np.float64]
    guide_error: NDArray[np.float64]
    lost: NDArray[np.float64]
    best_cad: float

    @property
    def late(self) -> NDArray[np.float64]:
        """Mean absolute error of the estimate after the first sixty cycles, by seed."""
        return np.asarray(np.abs(self.error[:, LATE:]).mean(axis=1))


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Load steps of one engine, form and recipe, one row per seed; errors from the load step on."""

    engine: Engine
    form: str
    recipe: Recipe
    error: NDArray[np.float64]
    guide_error: NDArray[np.float64]  # of the first cycle of the new point
    lost: NDArray[np.float64]


def uncalibrated(own: Runs, runs: list[Runs]) -> Runs:
    """Find the runs without calibration on the same noise; pressure has no part in those."""
    same = (own.case.engine.name, own.case.start_cad)
    return next(r for r in runs if r.case.recipe == NONE and (r.case.engine.name, r.case.start_cad) == same)


def _stays(runs: Runs) -> list[float]:
    return [stays_within(error, 0.0, _STAY_CAD) for error in runs.error]


def _quantile(values: list[float], share: float) -> float | None:
    found = float(np.quantile(values, share, method="inverted_cdf"))
    return found if math.isfinite(found) else None


def setting_row(own: Runs, plain: Runs) -> dict[str, Any]:
    """Put one case into figures, beside the same runs without calibration."""
    stays = _stays(own)
    return {
        "engine": own.case.engine.name,
        "start_cad": own.case.start_cad,
        "calibrated": own.case.recipe.name,
        **with_median_interval("median_stays", stays),
        "stays_90_percent": _quantile(stays, 0.9),
        **with_interval("late_error_cad", own.late),
        **with_interval("late_error_less_cad", plain.late - own.late),
        **with_interval("late_lost_percent", own.lost[:, LATE:].mean(axis=1)),
        "guide_error_end_cad": float(np.median(own.guide_error[:, -1])),
    }


def row(own: Runs, plain: Runs) -> dict[str, Any]:
    """Put one case into figures, with the error of the guide over cycles."""
    said = setting_row(own, plain)
    end = said.pop("guide_error_end_cad")
    at = {"guide_error_cad": 0, "guide_error_10_cad": 10, "guide_error_60_cad": 60}
    return {
        **{name: said.pop(name) for name in ("engine", "start_cad", "calibrated")},
        "tdc_error_cad": own.case.tdc_error_cad,
        **said,
        **{name: float(np.median(own.guide_error[:, k])) for name, k in at.items()},
        "guide_error_end_cad": end,
    }


def refit_row(engine: Engine, recipe: Recipe, found: list[list[Refit]], best: float) -> dict[str, Any]:
    """Say what calibrations did to the estimate, run by run."""
    early = [_change(refit, best) for refits in found for refit in refits if refit.cycle < _NEAR_AFTER]
    late = [[refit for refit in refits if refit.cycle >= _NEAR_AFTER] for refits in found]
    changes = [_change(refit, best) for refits in late for refit in refits]
    thrown = [_is_thrown_back(refit, best) for refits in late for refit in refits]
    return {
        "engine": engine.name,
        "calibrated": recipe.name,
        "refits_per_run": sum(map(len, found)) / len(found),
        "early_change_cad": float(np.mean(early)) if early else math.nan,
        **with_interval("late_change_cad", [np.mean([_change(r, best) for r in own]) for own in late if own]),
        "late_worst_cad": max(changes, default=math.nan),
        "thrown_back": sum(thrown),
        "late_refits": len(thrown),
    }


def _change(refit: Refit, best: float) -> float:
    """Give by how much the calibration made the estimate worse."""
    return abs(refit.with_it - best) - abs(refit.without - best)


def _is_thrown_back(refit: Refit, best: float) -> bool:
    return abs(refit.without - best) <= _STAY_CAD < abs(refit.with_it - best)


def step_row(own: Steps, steps: list[Steps]) -> dict[str, Any]:
    """Put the load steps of one form and recipe into figures, beside the same without calibration."""
    plain = next(s for s in steps if (s.engine, s.form) == (own.engine, own.form) and s.recipe == NONE)
    back = [first_within(error, 0.0, _BACK_CAD) for error in own.error]
    return {
        "engine": own.engine.name,
        "form": own.form,
        "calibrated": own.recipe.name,
        "guide_error_cad": float(np.median(own.guide_error)),
        **with_median_interval("median_back", back),
        "back_90_percent": _quantile(back, 0.9),
        **with_interval("lost", own.lost),
        **with_interval("lost_less", plain.lost - own.lost),
    }


def _number(value: float | None) -> float:
    return math.inf if value is None else value


def findings(rows: list[dict[str, Any]], steps: list[dict[str, Any]]) -> list[str]:
    """Say in words what calibration gains over the same guide without it."""
    said = []
    for name in (HEAT.name, BURN.name):
        own = [row for row in rows if row["calibrated"] == name and row["tdc_error_cad"] == 0.0]
        if own:
            text = f"One operating point, {name}: the mean error after {LATE} cycles is"
            said.append(f"{text} {_gain(own, 'late_error_less_cad', 2, '°CA')}")
    for form in ("curve", "feed-forward"):
        for name in (HEAT.name, BURN.name):
            own = [row for row in steps if (row["form"], row["calibrated"]) == (form, name)]
            if own:
                text = f"After a load step, {form}, {name}: the loss is"
                said.append(f"{text} {_gain(own, 'lost_less', 1, 'points x cycles')}")
    return said


def _gain(rows: list[dict[str, Any]], name: str, digits: int, unit: str) -> str:
    gains = [row[name] for row in rows]
    better = sum(row[f"{name}_low"] > 0.0 for row in rows)
    worse = sum(row[f"{name}_high"] < 0.0 for row in rows)
    span = f"{min(gains):.{digits}f} to {max(gains):.{digits}f} {unit}"
    beyond = f"beyond the 95 % interval better in {better} of {len(rows)} cases, worse in {worse}"
    return f"{span} less than without calibration, {beyond}."


def bars(rows: list[dict[str, Any]], refits: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare with what was demanded of a guide that learns."""
    said = []
    for recipe in (HEAT, BURN):
        for tdc in (0.0, TDC_CAD):
            own = [row for row in rows if row["calibrated"] == recipe.name and row["tdc_error_cad"] == tdc]
            if not own:
                continue
            text = recipe.name + (f", TDC {tdc:g} CAD late" if tdc else "")
            stays = [_number(row["median_stays"]) for row in own]
            late = [row["late_error_cad"] for row in own]
            said += [
                verdict_on(f"{text}: stays within 1.5 CAD, median [cycles]", stays, "at most 8", high=8.0),
                verdict_on(f"{text}: mean error after 60 cycles [CAD]", late, "at most 0.5", high=0.5),
            ]
            if not tdc:
                better = [row["late_error_less_cad_low"] for row in own]
                text += ": less error after 60 cycles than without calibration, low end of the interval [CAD]"
                said.append(verdict_on(text, better, "at least 0", low=0.0))
    for name in (HEAT.name, BURN.name):
        found = [row for row in refits if row["calibrated"] == name]
        if found:
            thrown = [100.0 * row["thrown_back"] / max(row["late_refits"], 1) for row in found]
            said.append(verdict_on(f"{name}: refits that throw the estimate back [%]", thrown, "none", high=0.0))
    return said
