"""Guided and unguided under a limit of the pressure rise, on the surrogate of the measured engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.guide import CurveSeeking
from mgdd.loop import SurrogatePlant, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.studies import measured_engine_cases as measured
from mgdd.studies.guided_measured import MeasuredGuide, measured_guide
from mgdd.studies.statistics import with_interval, with_median_interval
from mgdd.surrogate import EngineSurrogate, fit_surrogate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["LIMITED_CASES", "LimitedRuns", "limited_parts", "limited_row", "limited_variables"]

OBJECTIVE = measured.OBJECTIVES[0]
LIMITED_CASES = tuple(
    (f"{form}, margin {margin:g} sd", form, margin)
    for margin in (0.0, 1.0)
    for form in ("unguided", "curve", "curve, slope of the limit learnt")
)
_NEAR_CAD, _STAYS_CAD, _GRID_CAD = 1.0, 1.5, 0.05


@dataclass(frozen=True, kw_only=True)
class LimitedRuns:
    """Of one case: estimate [°CA aTDC], J lost [bar] and pressure rise without noise, by seed and cycle."""

    case: str
    margin_sd: float
    best_cad: float
    limit: float
    estimate: NDArray[np.float64]
    lost: NDArray[np.float64]
    rise: NDArray[np.float64]

    @property
    def above(self) -> NDArray[np.bool_]:
        """Whether the pressure rise without noise is above the limit."""
        return self.rise > self.limit


def limited_parts(records: xr.Dataset, seeds: int, cycles: int) -> list[tuple[str, Callable[[], LimitedRuns]]]:
    """Give each case as a part of the study."""
    surrogate, guide = fit_surrogate(records), measured_guide(records)
    held = measured.held_objective(surrogate, OBJECTIVE)
    case = measured.tuned_case(surrogate, OBJECTIVE, "batch", held)
    return [
        (f"limited: {name}", partial(_run, surrogate, guide, case, name, form, margin, seeds, cycles))
        for name, form, margin in LIMITED_CASES
    ]


def _seeker(guide: MeasuredGuide, case: measured.Case, form: str, margin_sd: float) -> Any:
    limits = [Limit(name, upper, margin_sd=margin_sd) for name, upper in OBJECTIVE.limits.items()]
    if form == "unguided":
        return ExtremumSeeking(**{**measured.seeker_of(case, 0).settings, "limits": limits})
    return CurveSeeking(
        start=measured.START_CAD, lower=measured.LOWER_CAD, upper=measured.UPPER_CAD, curve=guide.curve, limits=limits,
        limit_curves=[guide.pressure_rise] if form == "curve" else None,
    )  # fmt: skip


def _run(
    surrogate: EngineSurrogate,
    guide: MeasuredGuide,
    case: measured.Case,
    name: str,
    form: str,
    margin_sd: float,
    seeds: int,
    cycles: int,
) -> LimitedRuns:
    grid = np.arange(measured.LOWER_CAD, measured.UPPER_CAD + 0.5 * _GRID_CAD, _GRID_CAD)
    (limited, upper), *_ = OBJECTIVE.limits.items()
    surface = surrogate.predict(grid)
    estimate, lost, rise = (np.empty((seeds, cycles)) for _ in range(3))
    for seed in range(seeds):
        plant = SurrogatePlant(
            surrogate, OBJECTIVE.weights, limits=[limited], start_soi_cad=measured.START_CAD, seed=seed
        )
        run = run_seeker(plant, _seeker(guide, case, form, margin_sd), cycles).dataset
        estimate[seed], applied = run["estimate"][:, 0], run["applied"][:, 0].to_numpy()
        lost[seed] = np.maximum(case.best.value - np.interp(applied, grid, surface["imep_bar"].to_numpy()), 0.0)
        rise[seed] = np.interp(applied, grid, surface[limited].to_numpy())
    return LimitedRuns(
        case=name, margin_sd=margin_sd, best_cad=case.best["soi_cad"], limit=upper, estimate=estimate, lost=lost,
        rise=rise,
    )  # fmt: skip


def limited_row(run: LimitedRuns, early: int) -> dict[str, Any]:
    """Give a row beside those without a limit."""
    cycles = run.estimate.shape[1]
    away = np.abs(run.estimate - run.best_cad)
    near, outside = away <= _NEAR_CAD, away > _STAYS_CAD
    arrivals = np.where(near.any(axis=1), near.argmax(axis=1), math.inf)
    stays = np.where(outside.any(axis=1), cycles - np.argmax(outside[:, ::-1], axis=1), 0)
    final = run.estimate[:, -early:].mean(axis=1)
    return {
        "case": run.case,
        "start_cad": measured.START_CAD,
        **with_median_interval("cycles_to_1_cad", arrivals),
        **with_median_interval("cycles_stays_1_5_cad", np.where(outside[:, -1], math.inf, stays)),
        **with_interval("lost_j_cycles", run.lost[:, :early].sum(axis=1)),
        **with_interval("late_loss", run.lost[:, cycles // 2 :].mean(axis=1)),
        **with_interval("final_cad", final),
        "final_sd_cad": float(final.std(ddof=1)) if final.size > 1 else math.nan,
        "limited_optimum_cad": run.best_cad,
        **with_interval("above_share", run.above.mean(axis=1)),
        **with_interval("late_above_share", run.above[:, cycles // 2 :].mean(axis=1)),
        "worst_pressure_rise": float(run.rise.max()),
    }


def limited_variables(runs: list[LimitedRuns]) -> dict[str, tuple[Any, ...]]:
    """Give what the dataset of the study has of these runs: nothing of none."""
    if not runs:
        return {}
    over = ("limited_case", "cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "limited_case": ("limited_case", [run.case for run in runs], "-", "what guides, and margin of the limit"),
        "limited_optimum_cad": ((), runs[0].best_cad, "°CA aTDC", "best timing within the limit"),
        "pressure_rise_limit": ((), runs[0].limit, "bar/°CA", "limit of the pressure rise"),
    }
    for key, unit, said in (
        ("estimate", "°CA aTDC", "estimate under the limit"), ("rise", "bar/°CA", "pressure rise without noise"),
    ):  # fmt: skip
        bands = np.quantile(np.stack([getattr(run, key) for run in runs]), [0.1, 0.5, 0.9], axis=1)
        for end, band in zip(("low", "median", "high"), bands, strict=True):
            variables[f"limited_{key}_{end}"] = (over, band, unit, f"{said}, {end} of the seeds")
    return variables
