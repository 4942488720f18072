"""One question: how many noisy evaluations does a seeker need to the optimum, against peers, untouched and tuned.

    python benchmarks/seekers_vs_peers.py [--seeds 200] [--budget 10000] [--json FILE]

J = -0.0255 x^2, to be maximised, with normal noise of standard deviation 0.25: the efficiency over the injection timing
of an engine, in % and degrees. Seekers start 12 away, on either side by turns. Per seed: evaluations until the estimate
first is within 1 of the optimum; then, over the next 1000 evaluations, rms error of the estimate and mean J lost
by what was applied, perturbation included. Ours are tuned by `measure_map` and `tune` from 21 noisy evaluations at
start - 6, start and start + 6, anew for every seed; those are counted. Overhead is processor time per evaluation of a
function that returns zero at once, reading the estimate included.

Before anything is counted, every tuned seeker must find the optimum without noise.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import peer_seekers
from peers.peer_seekers import Contender, FinishedError, NullPlant, Plant, null_time_us, run_to_end
from support import machine

from mgdd import optimize
from mgdd.optimize.measured_map import MeasuredMap

BEND, SIGMA, AWAY, NEAR = -0.0255, 0.25, 12.0, 1.0
TAIL = 1000
MEASURED_AT, MEASURED_TIMES = (-6.0, 0.0, 6.0), 7
BRACKET, SHIFT = 20.0, 6.0
NULL_EVALUATIONS, NULL_REPEATS = 2000, 9


class NoisyPlant:
    """Counts evaluations, knows when the estimate arrived, and ends the run 1000 evaluations later or at the budget."""

    def __init__(self, start: float, seed: int, budget: int, sigma: float) -> None:
        self.estimate, self.evaluations, self.measuring = start, 0, 0
        self.arrived = math.inf
        self.squares = self.loss = 0.0
        self._budget, self._sigma = budget, sigma
        self._rng = np.random.default_rng(seed)
        self._noise: list[float] = []

    def __call__(self, x: float) -> float:
        """Return a noisy J at x, or raise FinishedError."""
        if self.arrived < math.inf:
            if self.evaluations >= self.arrived + TAIL:
                raise FinishedError
            self.squares += self.estimate**2
            self.loss -= BEND * x * x
        elif abs(self.estimate) <= NEAR:
            self.arrived = self.evaluations
            self.squares, self.loss = self.estimate**2, -BEND * x * x
        elif self.evaluations >= self._budget:
            raise FinishedError
        self.evaluations += 1
        if not self._noise:
            self._noise = (self._sigma * self._rng.standard_normal(1024)).tolist()
        return BEND * x * x + self._noise.pop()


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    name: str
    contender: Contender
    must_arrive: bool = True
    most_seeds: int = 1_000_000  # where an evaluation is slow and never is the answer


def drive(seeker: optimize.ExtremumSeeking | optimize.Spsa, plant: Plant) -> None:
    ask, tell = seeker.ask, seeker.tell
    while True:
        x = ask()
        plant.estimate = float(seeker.estimate[0])
        tell(plant(float(x[0])))


def untouched(kind: Callable[..., object], **settings: object) -> Contender:
    """One of ours as its class comes."""

    def run(plant: Plant, start: float, seed: int) -> None:
        drive(kind(start=start, **settings, **({"seed": seed} if kind is optimize.Spsa else {})), plant)

    return run


def measured(plant: Plant, start: float) -> MeasuredMap:
    at = [start + offset for offset in MEASURED_AT for _ in range(MEASURED_TIMES)]
    j = [plant(x) for x in at]
    if isinstance(plant, NullPlant):  # flat: nothing to read off, so that the time is that of the seeker alone
        j = [BEND * x * x + 0.25 * (-1) ** k for k, x in enumerate(at)]
    elif isinstance(plant, NoisyPlant):
        plant.measuring = plant.evaluations
        j = [value + 1e-3 * (-1) ** k for k, value in enumerate(j)]  # a noise-free plant has no noise to read off
    return optimize.measure_map(at, j)


def by_tune(method: str) -> Contender:
    """One of ours from measured noise and curvature, everything else left open."""

    def run(plant: Plant, start: float, seed: int) -> None:
        found = measured(plant, start)
        tuning = optimize.tune(found.noise_sd, found.curvature, method=method)
        drive(tuning.seeker(start=start, seed=seed), plant)

    return run


def golden(*, noise_known: bool) -> Contender:
    """Search a bracket of 40 around the start, shifted by chance: where cuts fall must not favour one optimum."""

    def run(plant: Plant, start: float, seed: int) -> None:
        sigma = measured(plant, start).noise_sd if noise_known else 0.0
        middle = start + np.random.default_rng([seed, 1]).uniform(-SHIFT, SHIFT)
        drive(optimize.GoldenSection(start=start, bounds=(middle - BRACKET, middle + BRACKET), noise_sd=sigma), plant)

    return run


def rows() -> list[Row]:
    every = 1_000_000
    peers: list[tuple[str, str, Callable[[], Contender], bool, int]] = [
        ("noisyopt", "noisyopt SPSA, defaults", peer_seekers.noisyopt, False, every),
        ("noisyopt", "noisyopt SPSA, tuned", lambda: peer_seekers.noisyopt(a=20, c=3, iterations=1000), True, every),
        ("nevergrad", "nevergrad SPSA, defaults", peer_seekers.nevergrad, False, 10),
        ("nevergrad", "nevergrad SPSA, tuned", lambda: peer_seekers.nevergrad(a=20, c=3), True, every),
        ("cernml", "cernml ES, defaults", peer_seekers.cernml, False, every),
        ("cernml", "cernml ES, tuned", lambda: peer_seekers.cernml(4.0, 1.0), True, every),
    ]
    versions = peer_seekers.installed()
    found = [
        Row(name, make(), arrives, most)
        for module, name, make, arrives, most in peers
        if versions[peer_seekers.PACKAGES[module]] is not None
    ]
    return [
        *found,
        Row("ten lines of Python", peer_seekers.plain_esc()),
        Row("ours by tune: batch", by_tune("batch")),
        Row("ours by tune: moving average", by_tune("moving_average")),
        Row("ours by tune: SPSA", by_tune("spsa")),
        Row("ours: golden section, noise known", golden(noise_known=True)),
        Row("ours untouched: ExtremumSeeking", untouched(optimize.ExtremumSeeking)),
        Row("ours untouched: Spsa", untouched(optimize.Spsa)),
        Row("ours untouched: GradientDescent", untouched(optimize.GradientDescent)),
        Row("ours untouched: GoldenSection", golden(noise_known=False)),
    ]


def run_once(row: Row, seed: int, budget: int, sigma: float) -> NoisyPlant:
    start = AWAY if seed % 2 == 0 else -AWAY
    plant = NoisyPlant(start, seed, budget, sigma)
    run_to_end(row.contender, plant, start, seed)
    return plant


def check_agreement(contenders: list[Row], budget: int) -> None:
    """SystemExit where a tuned seeker does not find the optimum without noise, from either side."""
    for row in contenders:
        if row.must_arrive and not all(run_once(row, seed, budget, 0.0).arrived < math.inf for seed in (0, 1)):
            sys.exit(f"{row.name} does not find the optimum without noise: nothing counted")


def quality(row: Row, seeds: int, budget: int) -> dict[str, float | int | None]:
    plants = [run_once(row, seed, budget, SIGMA) for seed in range(min(seeds, row.most_seeds))]
    arrivals = sorted(plant.arrived for plant in plants)
    there = [plant for plant in plants if plant.arrived < math.inf]
    quartiles = [arrivals[int(share * (len(arrivals) - 1) + 0.5)] for share in (0.25, 0.5, 0.75)]
    finite = [None if value == math.inf else value for value in quartiles]
    return {
        "seeds": len(plants),
        "median": finite[1],
        "quartile_low": finite[0],
        "quartile_high": finite[2],
        "arrived": len(there),
        "measuring": plants[0].measuring,
        "rms": math.sqrt(statistics.fmean(plant.squares / TAIL for plant in there)) if there else None,
        "loss": statistics.fmean(plant.loss / TAIL for plant in there) if there else None,
    }


def overheads(contenders: list[Row]) -> dict[str, float]:
    """Smallest of the interleaved repeats, microseconds per evaluation, the call of the null function included."""
    best = dict.fromkeys((row.name for row in contenders), math.inf)
    for _ in range(NULL_REPEATS):
        for row in contenders:
            best[row.name] = min(best[row.name], null_time_us(row.contender, AWAY, NULL_EVALUATIONS))
    return best


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200, help="runs per contender (default 200)")
    parser.add_argument("--budget", type=int, default=10_000, help="evaluations after which it is never (10000)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    if options.seeds < 2 or options.budget < 100:
        parser.error("--seeds must be at least 2 and --budget at least 100")
    return options


def words(row: dict[str, float | int | None], budget: int) -> str:
    if row["median"] is None:
        return f"never in {budget}"
    high = "never" if row["quartile_high"] is None else f"{row['quartile_high']:.0f}"
    return f"{row['median']:.0f} ({row['quartile_low']:.0f}-{high})"


def main() -> None:
    options = arguments()
    machine.pin()
    context = machine.versions()
    for package, version in peer_seekers.installed().items():
        context[package] = version or "missing: its rows are left out (pip install --group bench)"
    contenders = rows()
    check_agreement(contenders, options.budget)
    for key, value in context.items():
        print(f"{key:26s} {value}")
    print(f"J = {BEND} x^2, noise {SIGMA}, start {AWAY:g} away, {options.seeds} seeds, budget {options.budget}\n")
    heads = (("", "evaluations to", "of these", "rms of the", "J lost", "us per", "seeds"),)
    heads += (("", "within 1 (quartiles)", "to tune", "next 1000", "in them", "evaluation", "never"),)
    for head in heads:
        print("{:34s} {:>20s} {:>8s} {:>10s} {:>8s} {:>10s} {:>7s}".format(*head))
    costs = overheads(contenders)
    table = {}
    for row in contenders:
        found = quality(row, options.seeds, options.budget)
        table[row.name] = {**found, "overhead_us": costs[row.name]}
        rms = "-" if found["rms"] is None else f"{found['rms']:.2f}"
        loss = "-" if found["loss"] is None else f"{found['loss']:.2f}"
        never = f"{found['seeds'] - found['arrived']}/{found['seeds']}"
        print(
            f"{row.name:34s} {words(found, options.budget):>20s} {found['measuring'] or '-':>8} {rms:>10s} {loss:>8s} "
            f"{costs[row.name]:10.2f} {never:>7s}",
            flush=True,
        )
    if options.json:
        report = {"context": context, "budget": options.budget, "contenders": table}
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
