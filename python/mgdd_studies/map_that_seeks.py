"""A map of the best timing by one search led by a rough model, beside the conventional way and one search per cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.design_to_map_engine import AXES, CELLS, LIMITS
from mgdd_studies.design_to_map_steps import Case, make_map
from mgdd_studies.guide_cases import verdict_on
from mgdd_studies.map_that_seeks_cases import (
    NO_GUIDE,
    OLD_MAP,
    STOPS,
    TROUBLES,
    VISIT_CYCLES,
    WRONG_WAY,
    Path,
    Search,
    sought_per_cell,
    truth_of,
    walk,
    walk_of_two,
)
from mgdd_studies.map_that_seeks_drives import CYCLES, DRIVEN, MAP, PROCESS, TURNS, WAYS, Driven, drive
from mgdd_studies.map_that_seeks_figures import draw
from mgdd_studies.statistics import with_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd_studies.design_to_map_engine import Truth

    Array = NDArray[np.float64]

__all__ = ["run_map_that_seeks"]

_BASE = Search()
_BARE = Search(guide=NO_GUIDE, stops=(*STOPS, 48, 64))
_WORN, _SHORTER = (Search(engine=engine, guide=OLD_MAP) for engine in ("worn", "burn 15 % shorter"))
_SHORT = STOPS[:-1]
_OTHERS = ("burn 15 % longer", "compression ratio +1", "compression ratio -1")
SEARCHES = (
    _BASE, Search(guide="adiabatic"), Search(guide=WRONG_WAY), _BARE,
    _WORN, _SHORTER, *(Search(engine=engine, guide=OLD_MAP, stops=_SHORT) for engine in _OTHERS),
    Search(engine="worn", stops=_SHORT), *(Search(trouble=trouble, stops=_SHORT) for trouble in TROUBLES),
)  # fmt: skip
QUICK_SEARCHES = (
    Search(stops=(6, 12, 24)), Search(guide=NO_GUIDE, stops=(12, 24)),
    Search(engine="worn", guide=OLD_MAP, stops=(10,)),
)  # fmt: skip
CONVENTIONAL = tuple(Case(kind="gaussian_process", points=points) for points in (32, 64, 128))
PER_CELL = 60  # cycles of a search per cell
PAIR_STOPS = (24, 60)
_ABOVE = 0.01  # share of a limit
_WITHIN = 0.1  # points


@dataclass(frozen=True, kw_only=True)
class Walked:
    """All paths of one search, by seed."""

    search: Search
    paths: Sequence[Path]

    @property
    def truth(self) -> Truth:
        """The engine."""
        return truth_of(self.search.engine)

    def judged(self, stop: int) -> tuple[Array, Array]:
        """Loss [points] and excess of the cells at a stop, shape (seeds, cells); NaN where the engine fails."""
        timing = np.array([path.timings[stop] for path in self.paths])
        runs = np.array([path.runs for path in self.paths])
        return np.where(runs, self.truth.lost(timing), np.nan), np.where(runs, self.truth.excess(timing), np.nan)

    def driven(self, visits: int) -> list[Array]:
        """Excess at the first visits, by seed."""
        return [_excess_at(self.truth, path.places[:visits], path.asked[:visits]) for path in self.paths]


def _excess_at(truth: Truth, places: NDArray[np.int_], timing: Array) -> Array:
    every = truth.excess(np.repeat(timing[:, None], CELLS[0].size, axis=1))
    return np.asarray(every[np.arange(places.size), places])


def judgement(lost: Array, excess: Array) -> dict[str, Any]:
    """Judge the finished maps of all seeds by loss and excess, shape (seeds, cells)."""
    worst = np.nanmax(lost, axis=1)
    return {
        **with_interval("lost_percent", np.nanmean(lost, axis=1)),
        **with_interval("worst_lost_percent", worst),
        "within_01_percent": 100.0 * float((worst <= _WITHIN).mean()),
        "cells_above": float((excess > _ABOVE).sum(axis=1).mean()),
        "largest_excess_percent": max(100.0 * float(np.nanmax(excess)), 0.0),
    }


def _driven_above(excess: Sequence[Array]) -> dict[str, Any]:
    largest = max(float(own.max()) for own in excess)
    return {
        "visits_above": float(np.mean([(own > _ABOVE).sum() for own in excess])),
        "largest_visit_excess_percent": max(100.0 * largest, 0.0),
    }


def visit_row(walked: Walked, stop: int) -> dict[str, Any]:
    """Say what the maps of a search are worth after some visits, and what those drove."""
    search, visits = walked.search, walked.search.stops[stop]
    lost, excess = walked.judged(stop)
    unnamed = (excess > _ABOVE) & ~np.array([path.named[stop] for path in walked.paths])
    return {
        "engine": search.engine, "guide": search.guide, "trouble": search.trouble or "none", "visits": visits,
        "engine_cycles": VISIT_CYCLES * visits, **judgement(lost, excess),
        "unnamed_above": float(unnamed.sum(axis=1).mean()), **_driven_above(walked.driven(visits)),
    }  # fmt: skip


def unvisited_row(search: Search) -> dict[str, Any]:
    """Say what the map of the guide alone is worth."""
    truth, timing = truth_of(search.engine), np.atleast_2d(truth_of(search.guide).best_cad)
    return {
        "engine": search.engine, "guide": search.guide, "visits": 0,
        **judgement(truth.lost(timing), truth.excess(timing)),
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Other:
    """Another way to a map: what it costs, and loss [points] and excess of its maps, shape (seeds, cells)."""

    way: str
    cycles: float
    lost: Array
    excess: Array
    driven: float  # cycles or points of the way that were above a limit

    @property
    def row(self) -> dict[str, Any]:
        """Its row."""
        return {"way": self.way, "engine_cycles": self.cycles, **judgement(self.lost, self.excess),
                "driven_above": self.driven}  # fmt: skip


def _conventional(case: Case, seeds: int) -> list[Other]:
    made, truth = [make_map(case, seed) for seed in range(seeds)], truth_of("as calibrated")
    out = []
    for stage, said in (("margin", "before smoothing"), ("check", "smooth and checked")):
        timing = np.array([one.timings[stage] for one in made])
        cycles = np.mean([one.cycles + (one.check_cycles if stage == "check" else 0) for one in made])
        out.append(Other(
            way=f"design of {case.points} points, {said}", cycles=float(cycles), lost=truth.lost(timing),
            excess=truth.excess(timing), driven=float(np.mean([one.broken for one in made])),
        ))  # fmt: skip
    return out


def _per_cell(guided: bool, seeds: int) -> list[Other]:
    found = [sought_per_cell(PER_CELL, seed, guided=guided) for seed in range(seeds)]
    truth, timing = truth_of("as calibrated"), np.array([one for one, _ in found])
    above = [float((truth.excess(driven) > _ABOVE).sum()) for _, driven in found]
    return [Other(
        way=f"one search per cell{', rough model' if guided else ''}", cycles=float(PER_CELL * CELLS[0].size),
        lost=truth.lost(timing), excess=truth.excess(timing), driven=float(np.mean(above)),
    )]  # fmt: skip


def _two_inputs(seeds: int) -> tuple[Array, Array]:
    found = [walk_of_two(PAIR_STOPS, seed) for seed in range(seeds)]
    return np.array([lost for lost, _ in found]), np.array([excess for _, excess in found])


def drive_row(way: str, guide: str, runs: Sequence[Driven]) -> dict[str, Any]:
    """Say what the drives with one guide lose per cycle, in both turns and in each."""
    lost = np.array([run.lost for run in runs])
    covered = [100.0 * run.covered for run in runs]
    return {
        "guide": guide, "way": way, **with_interval("lost_percent", lost.mean(axis=(1, 2, 3))),
        **with_interval("first_turn_percent", lost[:, 0].mean(axis=(1, 2))),
        **with_interval("second_turn_percent", lost[:, 1].mean(axis=(1, 2))),
        "covered_percent": float(np.mean(covered)) if way == MAP else None,
    }  # fmt: skip


def _walked(search: Search, seeds: int) -> Walked:
    return Walked(search=search, paths=[walk(search, seed) for seed in range(seeds)])


def _driven(way: str, guide: str, seeds: int) -> tuple[str, str, list[Driven]]:
    return way, guide, [drive(way, guide, seed) for seed in range(seeds)]


def run_map_that_seeks(
    *, n_seeds: int = 30, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Seek a whole map by one search led by a model, on engines that are and are not as the model says.

    `seek_map` seeks the start of combustion in 6 x 5 cells over speed and load under 130 bar and 4.2 bar/°CA, on the
    engine, cells and limits of the study ``from-design-to-map``: each visit settles 20 cycles and averages 50. The
    guide is a model with twice the wall heat, an adiabatic one, one whose efficiency is mirrored over the timing, or
    none; of changed engines it is the engine as calibrated, as an old map is. Beside it stand the conventional way with
    32 to 128 points and one search per cell; trouble is a drift, a visit of twenty that is wrong by a point, and a cell
    in which the engine fails. Then timing and intake pressure together, and drives through 12 operating points of 40
    cycles, twice, without limits.

    Parameters
    ----------
    n_seeds : int
        Repetitions of everything; of two inputs half as many.
    quick : bool
        One seed, three searches, one design, two guides.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``engine guide trouble visits engine_cycles lost_percent worst_lost_percent within_01_percent cells_above
        largest_excess_percent unnamed_above visits_above largest_visit_excess_percent``: efficiency below the best
        under the limits [points], mean and worst cell; share of maps with every cell within 0.1 points; cells, those
        of them that the finding ``no_safe_input`` does not name, and visits above a limit by more than 1 %, and the
        furthest. ``summary["unvisited"]``: maps of the guides alone.
        ``summary["others"]``: the other ways. ``summary["two_inputs"]``: timing and intake pressure.
        ``summary["drives"]``: loss per cycle of drives. ``summary["bars"]``: what was demanded.

    Raises
    ------
    ImportError
        An extra, ``gp`` or ``maps``, is not installed.

    Examples
    --------
    >>> from mgdd_studies.map_that_seeks import run_map_that_seeks
    >>> rows = run_map_that_seeks(n_seeds=1, quick=True, figures=False).summary["rows"]
    >>> [row["visits"] for row in rows if row["guide"] == "twice the wall heat" and row["worst_lost_percent"] < 0.1]
    [12, 24]
    """
    seeds = check_seeds(n_seeds, quick=quick)
    work = Parts(progress)
    searches, designs = (QUICK_SEARCHES, CONVENTIONAL[:1]) if quick else (SEARCHES, CONVENTIONAL)
    guides = DRIVEN[1::3] if quick else DRIVEN
    walked = work((f"seek, {search.label}", partial(_walked, search, seeds)) for search in searches)
    ways = [(f"calibrate, {case.label}", partial(_conventional, case, seeds)) for case in designs]
    ways += [(f"seek per cell, guided {said}", partial(_per_cell, said, seeds)) for said in (False, True)[: 2 - quick]]
    others = [one for group in work(ways) for one in group]
    two = work([] if quick else [("seek, two inputs", partial(_two_inputs, -(-seeds // 2)))])
    drives = work(
        (f"drive, {way}, {guide}", partial(_driven, way, guide, seeds))
        for guide in guides for way in WAYS if (way, guide) != (PROCESS, NO_GUIDE)
    )  # fmt: skip
    return work.finish(
        "map-that-seeks", _dataset(walked, others, drives, seeds), draw if figures else None,
        seeds=seeds,
        rows=[visit_row(own, stop) for own in walked for stop in range(len(own.search.stops))],
        unvisited=[unvisited_row(own.search) for own in walked
                   if own.search.guide not in (NO_GUIDE, WRONG_WAY) and not own.search.trouble],
        others=[one.row for one in others],
        two_inputs=[{"visits": visits, "maps": len(lost), **judgement(lost[:, k], excess[:, k])}
                    for lost, excess in two for k, visits in enumerate(PAIR_STOPS)],
        drives=[drive_row(*own) for own in drives],
        bars=bars(walked, two, drives),
        cells=CELLS[0].size,
        **{f"limit_{name}": upper for name, upper in LIMITS.items()},
    )  # fmt: skip


_MAPS, _LOST, _NEW_LOST, _GONE = 100.0 * 28.0 / 30.0, 0.015, 0.03, 85.0
_WIDER = 1.3  # by which a bar may be missed in trouble
_DRIVES = {"wall heat +30 %": 0.02, "twice the wall heat": 0.035, "adiabatic": 0.075, WRONG_WAY: 0.14}


def bars(
    walked: Sequence[Walked], two: Sequence[tuple[Array, Array]], drives: Sequence[tuple[str, str, list[Driven]]]
) -> list[dict[str, Any]]:
    """Say what was demanded of the searches, and what came of it."""
    known = {own.search.label: own for own in walked}

    def at(search: Search, visits: int) -> tuple[str, Walked, Array, Array] | None:
        own = known.get(search.label)
        if own is None or visits not in own.search.stops:
            return None
        return f"{search.label}, {visits} visits", own, *own.judged(own.search.stops.index(visits))

    out = []
    troubled = [Search(trouble=trouble) for trouble in TROUBLES]
    for search in (_BASE, *troubled):
        if found := at(search, 24):
            said, own, lost, _ = found
            times = _WIDER if search.trouble else 1.0
            within = 100.0 * float((np.nanmax(lost, axis=1) <= times * _WITHIN).mean())
            mean = float(np.nanmean(lost))
            out += [
                verdict_on(f"{said}: maps with every cell within {times * _WITHIN:g} points [%]", [within],
                           f"at least {_MAPS:.0f}", low=_MAPS),
                verdict_on(f"{said}: mean loss [points]", [mean], f"at most {times * _LOST:g}", high=times * _LOST),
                verdict_on(f"{said}: visits above a limit by more than 1 % [per map]",
                           [_driven_above(own.driven(24))["visits_above"]], "none", high=0.0),
            ]  # fmt: skip
    for lost, _ in two:
        within = 100.0 * float((lost[:, -1].max(axis=1) <= 0.15).mean())
        out.append(verdict_on(f"two inputs, {PAIR_STOPS[-1]} visits: maps with every cell within 0.15 points [%]",
                              [within], f"at least {_MAPS:.0f}", low=_MAPS))  # fmt: skip
    if found := at(_WORN, 10):
        said, own, lost, _ = found
        before = float(own.truth.lost(truth_of(OLD_MAP).best_cad).mean())
        gone = 100.0 * (1.0 - float(lost.mean()) / before)
        out.append(verdict_on(f"{said}: gone of what the old map loses [%]", [gone], f"at least {_GONE:g}", low=_GONE))
    if found := at(_WORN, 24):
        said, _, lost, _ = found
        out.append(
            verdict_on(f"{said}: mean loss [points]", [float(lost.mean())], f"at most {_NEW_LOST:g}", high=_NEW_LOST)
        )
    if found := at(_SHORTER, 12):
        said, _, _, excess = found
        out.append(verdict_on(f"{said}: cells above a limit by more than 1 % [per map]",
                              [float((excess > _ABOVE).sum(axis=1).mean())], "none", high=0.0))  # fmt: skip
    for way, guide, runs in drives:
        if way == MAP and guide in _DRIVES:
            per_cycle = float(np.mean([run.lost.mean() for run in runs]))
            most = _DRIVES[guide]
            out.append(
                verdict_on(f"drive, {guide}: loss per cycle [points]", [per_cycle], f"at most {most:g}", high=most)
            )
            covered = 100.0 * float(np.mean([run.covered for run in runs]))
            out.append(verdict_on(f"drive, {guide}: cells within 1.96 of the stated sd [%]", [covered],
                                  f"at least {_GONE:g}", low=_GONE))  # fmt: skip
    return out


def _dataset(
    walked: Sequence[Walked], others: Sequence[Other], drives: Sequence[tuple[str, str, list[Driven]]], seeds: int
) -> xr.Dataset:
    shape = tuple(entries.size for entries in AXES.values())
    visits = sorted({stop for own in walked for stop in own.search.stops})
    over = ("search", "visits", "seed")
    lost = np.full((len(walked), len(visits), seeds, 2), np.nan)
    for k, own in enumerate(walked):
        for stop, count in enumerate(own.search.stops):
            cells, _ = own.judged(stop)
            lost[k, visits.index(count)] = np.stack([np.nanmean(cells, axis=1), np.nanmax(cells, axis=1)], axis=1)
    first = walked[0]
    stop = first.search.stops.index(24)
    seen = np.bincount(first.paths[0].places[:24], minlength=CELLS[0].size)
    variables: dict[str, tuple[Any, ...]] = {
        "search": ("search", [own.search.label for own in walked], "-", "engine, guide and trouble"),
        "search_engine": ("search", [own.search.engine for own in walked], "-", "engine"),
        "search_guide": ("search", [own.search.guide for own in walked], "-", "guide"),
        "search_trouble": ("search", [own.search.trouble for own in walked], "-", "trouble"),
        "visits": ("visits", visits, "-", "visits of the search"),
        "seed": ("seed", np.arange(seeds), "-", "seed"),
        "lost_percent": (over, lost[..., 0], "%", "efficiency lost, mean of the cells"),
        "worst_lost_percent": (over, lost[..., 1], "%", "efficiency lost, worst cell"),
        "speed_rpm": ("speed_rpm", AXES["speed_rpm"], "rpm", "engine speed"),
        "fuel_mg": ("fuel_mg", AXES["fuel_mg"], "mg", "fuel"),
        "map_cad": (tuple(AXES), first.paths[0].timings[stop].reshape(shape), "°CA aTDC",
                    "timing of the first seed's map after 24 visits"),
        "map_visits": (tuple(AXES), seen.reshape(shape), "-", "visits of that map"),
        "cell_lost_percent": (tuple(AXES), np.nanmean(first.judged(stop)[0], axis=0).reshape(shape), "%",
                              "efficiency lost after 24 visits, mean over seeds"),
    }  # fmt: skip
    if others:
        variables |= {
            "way": ("way", [one.way for one in others], "-", "other way to a map"),
            "way_cycles": ("way", [one.cycles for one in others], "-", "engine cycles of that way"),
            "way_lost_percent": (("way", "seed"), [one.lost.mean(axis=1) for one in others], "%",
                                 "efficiency lost, mean of the cells"),
            "way_worst_lost_percent": (("way", "seed"), [one.lost.max(axis=1) for one in others], "%",
                                       "efficiency lost, worst cell"),
        }  # fmt: skip
    if drives:
        mean = [np.mean([run.lost.mean(axis=1) for run in runs], axis=0) for _, _, runs in drives]
        variables |= {
            "drive": ("drive", [f"{way}, {guide}" for way, guide, _ in drives], "-", "what sets the timing, and guide"),
            "drive_way": ("drive", [way for way, _, _ in drives], "-", "what sets the timing"),
            "drive_guide": ("drive", [guide for _, guide, _ in drives], "-", "guide"),
            "turn": ("turn", np.arange(1, TURNS + 1), "-", "turn through the operating points"),
            "cycle": ("cycle", np.arange(CYCLES)),
            "drive_lost_percent": (("drive", "turn", "cycle"), mean, "%", "efficiency lost, mean over drives"),
        }  # fmt: skip
    return labelled_dataset(variables)
