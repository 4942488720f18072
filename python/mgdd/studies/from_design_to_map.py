"""From a design of experiments to a map in the controller, what that costs and leaves, and what a guide makes of it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.design_to_map_cases import CASES, POLYNOMIAL, PROCESS, QUICK_CASES, STAGES, Case, make_map
from mgdd.studies.design_to_map_drives import DWELL, EARLY, drive, drive_by_map, rough_model, timing_map
from mgdd.studies.design_to_map_engine import AXES, ENGINES, LIMITS, MIDDLES, Truth
from mgdd.studies.design_to_map_rows import (
    GUIDED,
    Guided,
    Maps,
    bars,
    effort_row,
    guide_row,
    learnt_row,
    loss_parts,
    part_rows,
    worn_row,
)
from mgdd.studies.design_to_map_steps import SETTLING
from mgdd.studies.from_design_to_map_figures import draw

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["run_from_design_to_map"]

_DRIVEN = ("as calibrated", "worn", "burn 15 % shorter")
_OTHER_ROUTE = 10_000  # of a drive by the map alone: points that it has not learnt at
_PARTED = (POLYNOMIAL, PROCESS)


def run_from_design_to_map(
    *, seeds: int = 30, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Calibrate a timing map the conventional way, judge it by the truth, and let the guide use it and teach it.

    Seven steps, each by the function of the package: points that a rough model permits (`design_points`), their
    measurement on the virtual bench (20 cycles to settle, 50 averaged, default noise), models of efficiency, maximum
    pressure and pressure rise (`fit_response`), the best timing of 6 x 5 cells over speed and load under 130 bar and
    4.2 bar/°CA (`optimize_map`) with a margin of 1.64 times the error at left-out points, the smooth map with limited
    slopes (`smooth_map`), the check of every cell on the bench, and the table in the controller. Engine:
    ``puma_single``, 1000 to 3000 rpm, 8 to 32 mg, intake pressure 100 kPa + 3 kPa/mg; the rough model has twice its
    wall heat. The map then meets other engines, alone and as feed-forward of extremum seeking under the same limits on
    drives through 16 random operating points of 200 cycles, all judged but the first, and learns the settled estimates.

    Parameters
    ----------
    seeds : int
        Repetitions of everything: design, noise, route.
    quick : bool
        At most two seeds, three ways and two engines.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows ``way points averaged_cycles cycles lost_percent worst_lost_percent between_lost_percent
        within_01_percent within_02_percent within_05_percent points_above cells_found_above cells_left_above
        largest_excess_percent price_percent``: engine cycles with settling and check; efficiency below the best under
        the limits [points], mean and worst cell, and between four cells; share of maps with every cell within 0.1, 0.2
        and 0.5 points; measured points and cells beyond a limit. ``summary["parts"]``: what each step adds to the loss.
        ``summary["other_engines"]``: the maps on engines that they were not made on. ``summary["guides"]``: loss of
        drives [points per cycle]. ``summary["learnt"]``: loss of the map alone before and after it has learnt.
        ``summary["bars"]``: what was demanded of every cell of every map.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.
    ImportError
        An extra, ``gp`` or ``maps``, is not installed.

    References
    ----------
    Tan (2018), chapter 2 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.from_design_to_map import run_from_design_to_map
    >>> rows = run_from_design_to_map(seeds=1, quick=True, figures=False).summary["rows"]
    >>> [row["way"] for row in rows], all(row["worst_lost_percent"] < 0.5 for row in rows)
    (['sweep in every cell', 'polynomial of degree 3', 'Gaussian process'], True)
    """
    seeds = min(check_seeds(seeds), 2) if quick else check_seeds(seeds)
    wanted, driven = (QUICK_CASES, _DRIVEN[:2]) if quick else (CASES, _DRIVEN)
    every, interrupted = run_parts(
        [(f"calibrate, {case.label}", partial(_maps, case, seeds)) for case in wanted], progress
    )
    known = {maps.case: maps for maps in every}
    guided: list[Guided] = []
    if not interrupted:
        drives = [(f"drive, {engine}", partial(_drives, engine, known[PROCESS])) for engine in driven]
        guided, interrupted = run_parts(drives, progress)
    cells = {name: Truth.of(cylinder) for name, cylinder in ENGINES.items()}
    own, middles = cells["as calibrated"], Truth.of(ENGINES["as calibrated"], MIDDLES)
    worn = [worn_row(name, known[PROCESS], truth, own) for name, truth in cells.items()] if PROCESS in known else []
    summary = {
        "study": "from-design-to-map",
        "seeds": seeds,
        "rows": [effort_row(maps, own, middles) for maps in every],
        "parts": [row for case in _PARTED if case in known for row in part_rows(known[case], own)],
        "other_engines": worn,
        "guides": [guide_row(runs, name, EARLY) for runs in guided for name in GUIDED],
        "learnt": [learnt_row(runs) for runs in guided],
        "bars": bars(every, own),
        "cells": own.best.size,
        "settling_cycles": SETTLING,
        **{f"limit_{name}": upper for name, upper in LIMITS.items()},
        "interrupted": interrupted,
    }
    return finish(_dataset(every, guided, cells, seeds), to_jsonable(summary), draw if figures else None)


def _maps(case: Case, seeds: int) -> Maps:
    made = [make_map(case, seed, noise_free=case in _PARTED) for seed in range(seeds)]
    return Maps(case=case, made=made)


def _drives(engine: str, maps: Maps) -> Guided:
    """Drive each route with every guide; the map of a seed learns on its route and is then tried on another."""
    cylinder = ENGINES[engine]
    drives: dict[str, list[Any]] = {name: [] for name in GUIDED}
    before, after = [], []
    for seed, one in enumerate(maps.made):
        old, learning = timing_map(one.table), timing_map(one.table)
        drives["map, no seeker"].append(drive_by_map(cylinder, old, seed))
        drives["plain seeker"].append(drive(cylinder, None, seed))
        drives["rough model"].append(drive(cylinder, rough_model(), seed))
        drives["map that learns"].append(drive(cylinder, learning, seed, learns=True))
        taught = timing_map(one.table.learned_from(learning))
        before.append(drive_by_map(cylinder, old, seed + _OTHER_ROUTE))
        after.append(drive_by_map(cylinder, taught, seed + _OTHER_ROUTE))
    return Guided(engine=engine, drives=drives, before=before, after=after)


def _dataset(every: list[Maps], guided: list[Guided], cells: dict[str, Truth], seeds: int) -> xr.Dataset:
    own, shape = cells["as calibrated"], [entries.size for entries in AXES.values()]
    variables: dict[str, tuple[Any, ...]] = {
        "way": ("way", [maps.case.label for maps in every], "-", "fit, points and averaged cycles of each"),
        "seed": ("seed", np.arange(seeds), "-", "seed"),
        "speed_rpm": ("speed_rpm", AXES["speed_rpm"], "rpm", "engine speed"),
        "fuel_mg": ("fuel_mg", AXES["fuel_mg"], "mg", "fuel"),
        "engine_cycles": (
            "way", [np.mean([one.cycles + one.check_cycles for one in maps.made]) for maps in every], "-",
            "engine cycles of measurement and check",
        ),
        "best_cad": (tuple(AXES), own.best_cad.reshape(shape), "°CA aTDC", "best timing under the limits"),
        "free_cad": (tuple(AXES), own.free_cad.reshape(shape), "°CA aTDC", "best timing without limits"),
    }  # fmt: skip
    lost = [own.lost(maps.timings("check")) for maps in every]
    over = ("way", "seed")
    variables |= {
        "lost_percent": (over, [part.mean(axis=1) for part in lost], "%", "efficiency lost, mean of the cells"),
        "worst_lost_percent": (over, [part.max(axis=1) for part in lost], "%", "efficiency lost, worst cell"),
        "cell_lost_percent": (("way", *AXES), [part.mean(axis=0).reshape(shape) for part in lost], "%",
                              "efficiency lost, mean over seeds"),
        "map_cad": (("way", *AXES), [maps.made[0].table.values for maps in every], "°CA aTDC",
                    "timing of the first seed's map"),
    }  # fmt: skip
    parted = [maps for maps in every if maps.case in _PARTED]
    if parted:
        parts = [[part.mean(axis=1) for part in loss_parts(maps, own).values()] for maps in parted]
        variables["parted_way"] = ("parted_way", [maps.case.name for maps in parted], "-", "fit")
        variables["part"] = ("part", list(STAGES), "-", "step of the calibration")
        variables["part_percent"] = (("parted_way", "part", "seed"), parts, "%", "efficiency lost by a step")
    if any(maps.case == PROCESS for maps in every):
        made = next(maps for maps in every if maps.case == PROCESS).timings("check")
        worn = [truth.lost(made).mean(axis=1) for truth in cells.values()]
        variables["engine"] = ("engine", list(cells), "-", "engine that the map meets")
        variables["other_lost_percent"] = (("engine", "seed"), worn, "%", "efficiency lost, mean of the cells")
    if guided:
        mean = [
            [np.mean([run.lost.mean(axis=1) for run in runs.drives[name]], axis=0) for name in GUIDED]
            for runs in guided
        ]
        variables["driven"] = ("driven", [runs.engine for runs in guided], "-", "engine that is driven")
        variables["guide"] = ("guide", list(GUIDED), "-", "what sets the timing")
        variables["cycle"] = ("cycle", np.arange(DWELL))
        variables["drive_lost_percent"] = (("driven", "guide", "cycle"), mean, "%", "efficiency lost")
        for when in ("before", "after"):
            alone = [[run.lost.mean() for run in getattr(runs, when)] for runs in guided]
            text = f"efficiency lost by the map alone, {when} learning"
            variables[f"lost_{when}_percent"] = (("driven", "seed"), alone, "%", text)
    return labelled_dataset(variables)
