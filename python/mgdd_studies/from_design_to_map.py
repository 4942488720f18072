"""From a design of experiments to a map in the controller, what that costs and leaves, and what a guide makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.design_to_map_engine import (
    AXES,
    DWELL,
    EARLY,
    ENGINES,
    LIMITS,
    MIDDLES,
    Truth,
    drive,
    drive_by_map,
    rough_model,
    timing_map,
)
from mgdd_studies.design_to_map_steps import (
    CASES,
    POLYNOMIAL,
    PROCESS,
    QUICK_CASES,
    SETTLING,
    SLOPES,
    STAGES,
    Case,
    Made,
    make_map,
)
from mgdd_studies.from_design_to_map_figures import draw
from mgdd_studies.guide_cases import verdict_on
from mgdd_studies.statistics import with_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd_studies.design_to_map_engine import Drive

    Array = NDArray[np.float64]

__all__ = ["run_from_design_to_map"]

WITHIN = (0.1, 0.2, 0.5)  # points of efficiency
GUIDED = ("map, no seeker", "plain seeker", "rough model", "map that learns")


@dataclass(frozen=True, kw_only=True)
class Maps:
    """All calibrations of one way, by seed."""

    case: Case
    made: Sequence[Made]

    def timings(self, stage: str) -> Array:
        """Give the timings after a step, shape (seeds, cells) [°CA aTDC]."""
        return np.array([one.timings[stage] for one in self.made])

    @property
    def between(self) -> Array:
        """What the maps say between four cells, shape (seeds, middles) [°CA aTDC]."""
        return np.array([one.between for one in self.made])


@dataclass(frozen=True, kw_only=True)
class Guided:
    """Drives on one engine, by guide and seed; and what the map alone loses on another route, before and after."""

    engine: str
    drives: dict[str, list[Drive]]
    before: list[Drive]
    after: list[Drive]


def _largest(excess: Array) -> float:
    """Give how far the worst cell is beyond a limit [%], 0 where none is."""
    return max(100.0 * float(excess.max()), 0.0)


def effort_row(maps: Maps, cells: Truth, middles: Truth) -> dict[str, Any]:
    """Say what a way costs, and what its finished maps lose."""
    lost, excess = cells.lost(maps.timings("check")), cells.excess(maps.timings("check"))
    worst = lost.max(axis=1)
    cycles = [one.cycles + one.check_cycles for one in maps.made]
    return {
        "way": maps.case.name,
        "points": float(np.mean([one.points for one in maps.made])),
        "averaged_cycles": maps.case.cycles,
        "cycles": float(np.mean(cycles)),
        **with_interval("lost_percent", lost.mean(axis=1)),
        **with_interval("worst_lost_percent", worst),
        **with_interval("between_lost_percent", middles.lost(maps.between).mean(axis=1)),
        **{f"within_{int(10 * bound):02d}_percent": 100.0 * float((worst <= bound).mean()) for bound in WITHIN},
        "points_above": float(np.mean([one.broken for one in maps.made])),
        "cells_found_above": float(np.mean([one.found for one in maps.made])),
        "cells_left_above": float((excess > 0.0).sum(axis=1).mean()),
        "largest_excess_percent": _largest(excess),
        "price_percent": max(one.price for one in maps.made),
    }


def loss_parts(maps: Maps, cells: Truth) -> dict[str, Array]:
    """Give what each step adds to the loss of a cell, shape (seeds, cells) [points]; they sum to the whole loss."""
    before, parts = np.zeros((len(maps.made), cells.best.size)), {}
    for stage in STAGES:
        after = cells.lost(maps.timings(stage))
        parts[stage], before = after - before, after
    return parts


def part_rows(maps: Maps, cells: Truth) -> list[dict[str, Any]]:
    """Say where the loss of a finished map comes from, and what the limits cost even the best map."""

    def row(part: str, lost: Array, excess: Array) -> dict[str, Any]:
        return {
            "way": maps.case.name,
            "part": part,
            **with_interval("lost_percent", lost.mean(axis=1)),
            "largest_of_a_cell_percent": float(lost.max()),
            "cells_above": float((excess > 0.0).sum(axis=1).mean()),
            "largest_excess_percent": _largest(excess),
        }

    limits = np.tile(cells.free - cells.best, (2, 1))
    return [
        row("limits, at the best map", limits, np.zeros((2, 1))),
        *(row(stage, lost, cells.excess(maps.timings(stage))) for stage, lost in loss_parts(maps, cells).items()),
    ]


def worn_row(engine: str, maps: Maps, new: Truth, old: Truth) -> dict[str, Any]:
    """Say what maps that were made on one engine do on another."""
    lost, excess = new.lost(maps.timings("check")), new.excess(maps.timings("check"))
    return {
        "engine": engine,
        "optimum_moved_cad": float(np.abs(new.best_cad - old.best_cad).mean()),
        **with_interval("lost_percent", lost.mean(axis=1)),
        **with_interval("worst_lost_percent", lost.max(axis=1)),
        **with_interval("cells_above", (excess > 0.0).sum(axis=1)),
        "largest_excess_percent": _largest(excess),
    }


def guide_row(guided: Guided, name: str, early: int) -> dict[str, Any]:
    """Say what a drive with a guide loses, and how much less than by plain seeker and rough model on the same noise."""
    lost = {key: np.array([run.lost.mean() for run in guided.drives[key]]) for key in GUIDED}
    own, plain, rough = lost[name], lost["plain seeker"], lost["rough model"]
    return {
        "engine": guided.engine,
        "guide": name,
        **with_interval("lost_percent", own),
        **with_interval("early_lost_percent", [run.lost[:early].mean() for run in guided.drives[name]]),
        **with_interval("late_lost_percent", [run.lost[-early:].mean() for run in guided.drives[name]]),
        **with_interval("saved_percent", 100.0 * (plain - own) / plain.mean()),
        **with_interval("less_than_rough_percent", 100.0 * (rough - own) / rough.mean()),
        **with_interval("above_percent", [run.above_percent for run in guided.drives[name]]),
        "learnt_points": float(np.mean([run.learnt for run in guided.drives[name]])),
    }


def learnt_row(guided: Guided) -> dict[str, Any]:
    """Say what the map alone loses on a route that it has not seen, before and after it has learnt on another."""
    before, after = (np.array([run.lost.mean() for run in runs]) for runs in (guided.before, guided.after))
    return {
        "engine": guided.engine,
        **with_interval("lost_before_percent", before),
        **with_interval("lost_after_percent", after),
        **with_interval("gone_percent", 100.0 * (before - after) / before.mean()),
        **with_interval("above_before_percent", [run.above_percent for run in guided.before]),
        **with_interval("above_after_percent", [run.above_percent for run in guided.after]),
    }


def bars(every: Sequence[Maps], cells: Truth) -> list[dict[str, Any]]:
    """Say what was demanded of smoothing and check in every cell of every map, and what came of it."""
    slopes = [
        float((np.abs(np.diff(np.moveaxis(one.table.values, at, -1))) / np.diff(entries)).max()) / SLOPES[name]
        for maps in every for one in maps.made for at, (name, entries) in enumerate(AXES.items())
    ]  # fmt: skip
    by_model = [one.by_model - one.price for maps in every for one in maps.made]
    true = [
        float((cells.lost(one.timings["smoothing"]) - cells.lost(one.timings["margin"])).max()) - one.price
        for maps in every for one in maps.made
    ]  # fmt: skip
    excess = [100.0 * float(cells.excess(one.timings["check"]).max()) for maps in every for one in maps.made]
    return [
        verdict_on("slope of the map over its limit [-]", slopes, "at most 1", high=1.0 + 1e-9),
        verdict_on("smoothing, loss by the model beyond its price [points]", by_model, "at most 0", high=1e-9),
        verdict_on("smoothing, true loss beyond its price [points]", true, "at most 0", high=0.0),
        verdict_on("after the check, beyond a limit [%]", excess, "at most 0.5", high=0.5),
    ]


_DRIVEN = ("as calibrated", "worn", "burn 15 % shorter")
_OTHER_ROUTE = 10_000  # of a drive by the map alone: points that it has not learnt at
_PARTED = (POLYNOMIAL, PROCESS)


def run_from_design_to_map(
    *, n_seeds: int = 30, quick: bool = False, figures: bool = True, progress: Progress | None = None
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
    n_seeds : int
        Repetitions of everything: design, noise, route.
    quick : bool
        At most two seeds, three ways and two engines.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

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
    ImportError
        An extra, ``gp`` or ``maps``, is not installed.

    References
    ----------
    Tan (2018), chapter 2 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.from_design_to_map import run_from_design_to_map
    >>> rows = run_from_design_to_map(n_seeds=1, quick=True, figures=False).summary["rows"]
    >>> [row["way"] for row in rows], all(row["worst_lost_percent"] < 0.5 for row in rows)
    (['sweep in every cell', 'polynomial of degree 3', 'Gaussian process'], True)
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=2)
    work = Parts(progress)
    wanted, driven = (QUICK_CASES, _DRIVEN[:2]) if quick else (CASES, _DRIVEN)
    every = work((f"calibrate, {case.label}", partial(_made_by, case, n_seeds)) for case in wanted)
    known = {maps.case: maps for maps in every}
    guided = work((f"drive, {engine}", partial(_driven_by, engine, known[PROCESS])) for engine in driven)
    cells = {name: Truth.of(cylinder) for name, cylinder in ENGINES.items()}
    own, middles = cells["as calibrated"], Truth.of(ENGINES["as calibrated"], MIDDLES)
    worn = [worn_row(name, known[PROCESS], truth, own) for name, truth in cells.items()] if PROCESS in known else []
    return work.finish(
        "from-design-to-map", _dataset(every, guided, cells, n_seeds), draw if figures else None,
        seeds=n_seeds,
        rows=[effort_row(maps, own, middles) for maps in every],
        parts=[row for case in _PARTED if case in known for row in part_rows(known[case], own)],
        other_engines=worn,
        guides=[guide_row(runs, name, EARLY) for runs in guided for name in GUIDED],
        learnt=[learnt_row(runs) for runs in guided],
        bars=bars(every, own),
        cells=own.best.size,
        settling_cycles=SETTLING,
        **{f"limit_{name}": upper for name, upper in LIMITS.items()},
    )  # fmt: skip


def _made_by(case: Case, n_seeds: int) -> Maps:
    made = [make_map(case, seed, noise_free=case in _PARTED) for seed in range(n_seeds)]
    return Maps(case=case, made=made)


def _driven_by(engine: str, maps: Maps) -> Guided:
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
        before.append(drive_by_map(cylinder, old, seed + _OTHER_ROUTE))
        after.append(drive_by_map(cylinder, learning, seed + _OTHER_ROUTE))
    return Guided(engine=engine, drives=drives, before=before, after=after)


def _dataset(every: list[Maps], guided: list[Guided], cells: dict[str, Truth], n_seeds: int) -> xr.Dataset:
    own, shape = cells["as calibrated"], [entries.size for entries in AXES.values()]
    variables: dict[str, tuple[Any, ...]] = {
        "way": ("way", [maps.case.label for maps in every], "-", "fit, points and averaged cycles of each"),
        "seed": ("seed", np.arange(n_seeds), "-", "seed"),
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
