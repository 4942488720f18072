"""One question: what is a map worth whose cells scikit-optimize searches one by one, beside one search for all.

    python benchmarks/map_peers.py [--seeds 5] [--visits 2,4,8] [--cycles 60] [--only 'tuned|seek_map'] [--json FILE]

Engine, cells, bounds, limits and noise are those of the study `map-that-seeks`: a visit settles 20 cycles and averages
50. scikit-optimize begins every cell at the timing from which `seek_map` does without a model, and spends the same
number of visits in each; in the rows of cycles it is told every cycle instead. It knows no limits: what it is told is
the measured efficiency less 0.15 points per percent by which the measurement is above a limit (0.1 for cycles), up to
20 %. As it comes, nine random readings follow the first one, and the answer is the best reading: up to ten visits in a
cell none is chosen by its model. Tuned, the noise is told, one to three readings at random follow the first one, length
scales are bounded, and the answer is the best of the model's mean. Penalty and settings were found by trying on this
engine with another seed, which is not counted. `seek_map` runs on the same seeds; no smoothing anywhere.

All is judged without noise: efficiency below the best within the limits [points], mean of the cells with its 95 %
interval over the maps, and worst cell; share of maps with every cell within 0.1 points; per map the cells, and the
visits or cycles driven, above a limit by more than 1 %. The last column is processor time per map [s].
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from peers import peer_bayes
from peers.peer_seekers import Contender, FinishedError, installed
from support import machine

from mgdd.loop import Measurement, VirtualEngine, VirtualTestBed
from mgdd.loop.map_visits import dwell_of
from mgdd_studies.design_to_map_engine import AXES, CELLS, ENGINES, LIMITS, point_of
from mgdd_studies.map_that_seeks import judgement
from mgdd_studies.map_that_seeks_cases import NO_GUIDE, START_CAD, TIMING, VISIT_CYCLES, Search, truth_of, walk

ENGINE = "as calibrated"
DWELL = dwell_of(None, None, on_plant=True)  # of a visit of `seek_map`
NOISE_VISIT, NOISE_CYCLE = 0.04, 0.3  # standard deviation of the efficiency [points]
PENALTY_VISIT, PENALTY_CYCLE = 0.15, 0.1  # points per percent above a limit; noise of a cycle makes it dearer
MOST_EXCESS = 20.0  # percent: a cliff misleads the model
ABOVE = 0.01  # share of a limit
LOWER, UPPER = TIMING["soc_cad"]


def penalised(j: float, limits: dict[str, float], penalty: float) -> float:
    """Efficiency less the penalty of the worst limit, as a peer is told it."""
    excess = 100.0 * max(limits[name] / upper - 1.0 for name, upper in LIMITS.items())
    return j - penalty * min(max(excess, 0.0), MOST_EXCESS)


class CellPlant:
    """A cell of the map as a plant of the peers: so many readings, each of `read`."""

    def __init__(self, read: Callable[[float], float], readings: int) -> None:
        self._read, self._readings = read, readings
        self.estimate = START_CAD
        self.asked: list[float] = []

    def __call__(self, timing: float) -> float:
        """Read once, or raise FinishedError."""
        if len(self.asked) == self._readings:
            raise FinishedError
        self.asked.append(float(timing))
        return self._read(float(timing))


def told(measured: Sequence[Measurement], penalty: float) -> float:
    """Average cycles as a visit does."""
    return penalised(
        float(np.mean([one.performance for one in measured])),
        {name: float(np.mean([one.limits[name] for one in measured])) for name in LIMITS},
        penalty,
    )


def visiting(seed: int, cell: int, visits: int) -> CellPlant:
    """Give a cell of the test bed; every visit of a map has noise of its own."""
    bed = VirtualTestBed(ENGINES[ENGINE], point=point_of, limits=tuple(LIMITS), seed=seed)
    at = {name: float(column[cell]) for name, column in zip(AXES, CELLS, strict=True)}
    plant: CellPlant

    def read(timing: float) -> float:
        bed.begin(cell * visits + len(plant.asked))
        bed.apply({**at, "soc_cad": timing})
        return told([bed.measure() for _ in range(VISIT_CYCLES)][DWELL.settling :], PENALTY_VISIT)

    plant = CellPlant(read, visits)
    return plant


def cycling(seed: int, cell: int, cycles: int) -> CellPlant:
    """Give an engine in a cell, cycle by cycle, with the noise of one search per cell in the study."""
    place = (float(column[cell]) for column in CELLS)
    engine = VirtualEngine(ENGINES[ENGINE], point_of(*place), limits=tuple(LIMITS), seed=1000 * seed + cell)

    def read(timing: float) -> float:
        engine.apply({"soc_cad": timing})
        return told([engine.measure()], PENALTY_CYCLE)

    return CellPlant(read, cycles)


@dataclass(frozen=True, kw_only=True)
class Way:
    """A way to a map: `make` gives the timings of the cells, and the cells and timings that were driven."""

    name: str
    readings: str
    cycles: int
    make: Callable[[int], tuple[Any, Any, Any]]


def per_cell(
    contender: Contender, plant_of: Callable[[int, int, int], CellPlant], readings: int
) -> Callable[[int], tuple[Any, Any, Any]]:
    def make(seed: int) -> tuple[Any, Any, Any]:
        plants = [plant_of(seed, cell, readings) for cell in range(CELLS[0].size)]
        for cell, plant in enumerate(plants):
            try:
                contender(plant, START_CAD, 1000 * seed + cell)
            except FinishedError:
                continue
        places = np.repeat(np.arange(CELLS[0].size), readings)
        return np.array([plant.estimate for plant in plants]), places, np.concatenate([one.asked for one in plants])

    return make


def at_once(guide: str, visits: int) -> Callable[[int], tuple[Any, Any, Any]]:
    def make(seed: int) -> tuple[Any, Any, Any]:
        path = walk(Search(engine=ENGINE, guide=guide, stops=(visits,)), seed)
        return path.timings[-1], path.places, path.asked

    return make


def tuned(readings: int, noise_sd: float) -> Contender:
    """Two readings show no curvature: a short length scale keeps the answer beside the better one."""
    scale = (0.5, 2.0) if readings > 2 else (0.2, 0.3)
    return peer_bayes.skopt_by_hand(
        LOWER, UPPER, noise_sd, goes_on=True, spread_first=min(readings // 2, 3), scale=scale
    )


def ways(visits: list[int], cycles: int) -> list[Way]:
    """All rows of the table."""
    cells = CELLS[0].size
    package = peer_bayes.PACKAGES["skopt"]
    out = [
        Way(name=f"seek_map, {said}", readings=f"{count} visits", cycles=VISIT_CYCLES * count,
            make=at_once(guide, count))
        for said, guide, count in (("rough model", Search().guide, 24), ("no model", NO_GUIDE, 64))
    ]  # fmt: skip
    if installed(peer_bayes.PACKAGES)[package] is None:
        print(f"{package} is not installed: left out")
        return out
    for count in visits:
        spent = {"readings": f"{cells * count} visits, {count} a cell", "cycles": VISIT_CYCLES * cells * count}
        both = {"as it comes": peer_bayes.skopt(LOWER, UPPER), "tuned": tuned(count, NOISE_VISIT)}
        out += [Way(name=f"{package}, {said}", **spent, make=per_cell(contender, visiting, count))
                for said, contender in both.items()]  # fmt: skip
    if cycles:
        spent = {"readings": f"{cycles} cycles a cell", "cycles": cells * cycles}
        both = {"as it comes, stays after 40": peer_bayes.skopt(LOWER, UPPER), "tuned": tuned(cycles, NOISE_CYCLE)}
        out += [Way(name=f"{package}, {said}", **spent, make=per_cell(contender, cycling, cycles))
                for said, contender in both.items()]  # fmt: skip
    return out


def row_of(way: Way, seeds: int) -> dict[str, Any]:
    """Judge the maps of a way."""
    truth = truth_of(ENGINE)
    start = time.process_time()
    made = [way.make(seed) for seed in range(seeds)]
    spent = time.process_time() - start
    timing = np.array([one for one, _, _ in made])
    driven = []
    for _, places, asked in made:
        every = truth.excess(np.repeat(np.asarray(asked)[:, None], CELLS[0].size, axis=1))
        driven.append(int((every[np.arange(places.size), places] > ABOVE).sum()))
    return {
        "way": way.name, "readings": way.readings, "engine_cycles": way.cycles, "seeds": seeds,
        **judgement(truth.lost(timing), truth.excess(timing)), "driven_above": float(np.mean(driven)),
        "seconds_per_map": spent / seeds,
    }  # fmt: skip


def main() -> None:
    """Run every way, and print a row as soon as it is there."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--visits", default="2,4,8", help="in each cell")
    parser.add_argument("--cycles", type=int, default=0, help="in each cell, each told; 0: left out, they take minutes")
    parser.add_argument("--only", default="", help="regular expression for names of rows")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    machine.pin()
    print(", ".join(f"{name}: {said}" for name, said in machine.versions().items()))
    print(f"{'way':<44} {'readings':<24} {'cycles':>6} {'mean loss [points]':>25} {'worst':>6} {'within 0.1 [%]':>14} "
          f"{'cells above':>11} {'driven above':>12} {'s':>6}")  # fmt: skip
    rows = []
    for way in ways([int(count) for count in options.visits.split(",")], options.cycles):
        if not re.search(options.only, way.name):
            continue
        row = row_of(way, options.seeds)
        rows.append(row)
        mean = "{lost_percent:.4f} ({lost_percent_low:.4f} to {lost_percent_high:.4f})".format_map(row)
        print(f"{way.name:<44} {way.readings:<24} {way.cycles:>6} {mean:>25} {row['worst_lost_percent']:>6.3f} "
              f"{row['within_01_percent']:>14.0f} {row['cells_above']:>11.2f} {row['driven_above']:>12.1f} "
              f"{row['seconds_per_map']:>6.1f}", flush=True)  # fmt: skip
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
