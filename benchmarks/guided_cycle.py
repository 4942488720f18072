"""One question: what does one full guided cycle cost from Python: simulate, seek, calibrate, re-optimise.

    python benchmarks/guided_cycle.py [--repeats 9] [--json FILE]

The virtual bench on `puma_single` with a noisy pressure sensor, `GuidedEngine` with `CurveSeeking` and a guide of twice
the wall heat. Processor time of one core per cycle, so that neighbours on a shared machine disturb it less. In the row
that passes the model on in every cycle, each calibration is followed by a search of the model's best timing and by a
new curve for the seeker: the most work that a cycle can be; it shall stay below 1 ms.

Before anything is timed, the loop that is timed must equal `run_seeker` bit for bit, the wall heat must be found, and
the model must really have been passed on in every cycle.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from support import machine

from mgdd.engine import Cylinder
from mgdd.guide import CurveSeeking, GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.loop import VirtualEngine, run_seeker

CYCLES, SETTLED, WINDOW, MOST_MS = 400, 50, 5, 1.0
WRONG = Cylinder(wall_heat_scale=1.0)  # twice that of the bench
Row = Callable[[], tuple[VirtualEngine, GuidedEngine | None]]


def bench() -> VirtualEngine:
    return VirtualEngine(seed=1, pressure_noise_bar=0.2)


def guided(*, calibrated: bool = True, recalibrated_cad: float = 0.1) -> GuidedEngine:
    model = ModelOptimum(WRONG)
    curve = model.curve(bench().point)
    if curve is None:
        sys.exit("the guide has no curve: nothing timed")
    seeker = CurveSeeking(start=curve.best, bounds=(-30.0, 10.0), curve=curve)
    calibration = OnlineCalibration(WRONG, window_cycles=WINDOW, steady_cycles=0) if calibrated else None
    return GuidedEngine(seeker, model, bench().point, calibration=calibration, recalibrated_cad=recalibrated_cad)


ROWS: dict[str, Row] = {
    "the engine alone, with its pressure": lambda: (bench(), None),
    "seek": lambda: (bench(), guided(calibrated=False)),
    "seek, calibrate, re-optimise": lambda: (bench(), guided()),
    "the same, model passed on in every cycle": lambda: (bench(), guided(recalibrated_cad=0.0)),
}


def drive(plant: VirtualEngine, engine: GuidedEngine | None, cycles: int) -> None:
    for _ in range(cycles):
        if engine is None:
            plant.step(-6.0)
            plant.pressure()
            continue
        engine.at(plant.point)
        cycle = plant.step(float(engine.ask()[0]))
        engine.tell(cycle["j"], misfire=cycle["misfire"], pressure_bar=plant.pressure()[1])


def check_agreement() -> None:
    """SystemExit where the timed loop is another one, finds another wall heat, or leaves work out."""
    run = run_seeker(bench(), guided(), CYCLES).dataset
    plant, engine = bench(), guided()
    drive(plant, engine, CYCLES)
    if not np.array_equal(run["estimate"][:, 0], engine.history["estimate"][:, 0]):
        sys.exit("the loop that is timed and run_seeker differ: nothing timed")
    if abs(engine.cylinder.wall_heat_scale - 0.5) > 0.05:
        sys.exit("the wall heat was not found: nothing timed")
    always = guided(recalibrated_cad=0.0)
    drive(bench(), always, CYCLES)
    if always.recalibrations < 0.95 * (CYCLES - WINDOW):
        sys.exit(f"the model was passed on in {always.recalibrations} of {CYCLES} cycles only: nothing timed")


def time_row(row: Row) -> float:
    """Milliseconds of processor time per cycle, after the window has filled."""
    plant, engine = row()
    drive(plant, engine, SETTLED)
    begin = time.process_time()
    drive(plant, engine, CYCLES)
    return (time.process_time() - begin) / CYCLES * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=9, help="interleaved repeats (default 9)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    check_agreement()
    machine.pin()
    times: dict[str, list[float]] = {name: [] for name in ROWS}
    for _ in range(options.repeats):
        for name, row in ROWS.items():
            times[name].append(time_row(row))
    for key, value in machine.versions().items():
        print(f"{key:20s} {value}")
    print(f"\n{'ms per cycle':42s} {'min':>8s} {'median':>8s}")
    for name, own in times.items():
        print(f"{name:42s} {min(own):8.3f} {statistics.median(own):8.3f}")
    most = statistics.median(list(times.values())[-1])
    print(f"\none full cycle takes {most:.3f} ms, {'within' if most <= MOST_MS else 'ABOVE'} {MOST_MS:g} ms")
    if options.json:
        report = {"context": machine.versions(), "ms": times}
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
