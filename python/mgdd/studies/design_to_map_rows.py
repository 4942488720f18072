"""Rows of the study from design to map: what a way of calibration costs and leaves, and where the loss comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.studies.design_to_map_cases import STAGES, Case, Made
from mgdd.studies.design_to_map_engine import AXES, Truth
from mgdd.studies.design_to_map_steps import SLOPES
from mgdd.studies.guide_cases import verdict_on
from mgdd.studies.statistics import with_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.studies.design_to_map_drives import Drive

    Array = NDArray[np.float64]

__all__ = [
    "GUIDED",
    "Guided",
    "Maps",
    "bars",
    "effort_row",
    "guide_row",
    "learnt_row",
    "loss_parts",
    "part_rows",
    "worn_row",
]

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
        "largest_excess_percent": max(100.0 * float(excess.max()), 0.0),
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
    rows = [
        {
            "way": maps.case.name,
            "part": "limits, at the best map",
            **with_interval("lost_percent", np.full(2, (cells.free - cells.best).mean())),
            "largest_of_a_cell_percent": float((cells.free - cells.best).max()),
            "cells_above": 0.0,
            "largest_excess_percent": 0.0,
        }
    ]
    for stage, part in loss_parts(maps, cells).items():
        excess = cells.excess(maps.timings(stage))
        rows.append({
            "way": maps.case.name,
            "part": stage,
            **with_interval("lost_percent", part.mean(axis=1)),
            "largest_of_a_cell_percent": float(part.max()),
            "cells_above": float((excess > 0.0).sum(axis=1).mean()),
            "largest_excess_percent": max(100.0 * float(excess.max()), 0.0),
        })  # fmt: skip
    return rows


def worn_row(engine: str, maps: Maps, new: Truth, old: Truth) -> dict[str, Any]:
    """Say what maps that were made on one engine do on another."""
    lost, excess = new.lost(maps.timings("check")), new.excess(maps.timings("check"))
    return {
        "engine": engine,
        "optimum_moved_cad": float(np.abs(new.best_cad - old.best_cad).mean()),
        **with_interval("lost_percent", lost.mean(axis=1)),
        **with_interval("worst_lost_percent", lost.max(axis=1)),
        **with_interval("cells_above", (excess > 0.0).sum(axis=1)),
        "largest_excess_percent": max(100.0 * float(excess.max()), 0.0),
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
