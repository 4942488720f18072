"""One question: how much J do guided seeking, plain seekers and Bayesian optimisation lose.

    python benchmarks/guided_seeking.py [--seeds 200] [--bayes-seeds 20] [--only REGEX] [--json FILE]

J lost over 300 cycles by what was applied, without its noise, against the best input [points per cycle]: mean over
seeds with its 95 % interval (Student's t). Beside it the cycles until the estimate first is within 1 (median), the
share of runs in which it never is, and the share of runs that end farther away than that.

Maps: efficiency of the virtual bench over the start of combustion (noise 0.25 points, scatter 0.3 CAD, from -20 and 0
by turns, bounds -30 to 10), and five formulas between bounds 40 wide, optimum 4 to 5 to either side of the middle, 12
away from the start, noise 0.3: curvature 0.06 at the top of each. Untouched seekers and the curve are told no noise;
on the formulas the curve is a parabola of curvature 0.05 at the middle of the bounds. Tuned ones are told noise and
curvature, golden section and Bayesian optimisation by hand the noise.

Before anything is counted, whoever is told the noise and every curve must end within 1 of the optimum of the engine
and of the quadratic without noise.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import statistics
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from peers import peer_bayes
from peers.peer_seekers import Contender, Plant, installed, run_to_end
from support import machine
from support.seeking_maps import CYCLES, CountedPlant, SeekingMap, all_maps

from mgdd import guide, optimize
from mgdd.studies.statistics import mean_interval

Make = Callable[[SeekingMap, float, int], optimize.Seeker]  # map, start, seed


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    name: str
    contender: Callable[[SeekingMap], Contender]
    is_curve: bool = False
    is_bayes: bool = False
    must_arrive: bool = False


def driven(make: Make) -> Callable[[SeekingMap], Contender]:
    def on(field: SeekingMap) -> Contender:
        def run(plant: Plant, start: float, seed: int) -> None:
            seeker = make(field, start, seed)
            while True:
                x = seeker.ask()
                plant.estimate = float(seeker.estimate[0])
                seeker.tell(plant(float(x[0])))

        return run

    return on


def untouched(kind: Callable[..., optimize.Seeker], **settings: object) -> Callable[[SeekingMap], Contender]:
    def make(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:
        chance = {"seed": seed} if kind is optimize.Spsa else {}
        return kind(start=start, lower=field.lower, upper=field.upper, **settings, **chance)

    return driven(make)


def tuned(method: str) -> Callable[[SeekingMap], Contender]:
    """Told noise and curvature; the perturbation is kept inside the bounds at the start."""

    def make(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:
        room = 0.99 * min(start - field.lower, field.upper - start)
        found = optimize.tune(field.noise_sd, field.curvature, method=method)
        if found.amplitude > room:
            found = optimize.tune(field.noise_sd, field.curvature, method=method, amplitude_max=room)
        return found.seeker(start=start, lower=field.lower, upper=field.upper, seed=seed)

    return driven(make)


def golden(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:  # noqa: ARG001 - no chance in it
    return optimize.GoldenSection(start=start, lower=field.lower, upper=field.upper, noise_sd=field.noise_sd)


def curve(name: str) -> Callable[[SeekingMap], Contender]:
    def make(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:  # noqa: ARG001 - no chance in it
        return guide.CurveSeeking(
            start=start, lower=field.lower, upper=field.upper, curve=field.guides[name], prior_sd=field.prior_sd
        )

    return driven(make)


def rows_for(field: SeekingMap) -> list[Row]:
    versions = installed(peer_bayes.PACKAGES)
    bayes: list[tuple[str, str, Callable[[SeekingMap], Contender], bool]] = [
        ("bayes_opt", "defaults, 40", lambda m: peer_bayes.bayes_opt(m.lower, m.upper), False),
        ("bayes_opt", "by hand, 40", lambda m: peer_bayes.bayes_opt_by_hand(m.lower, m.upper, m.noise_sd), True),
        (
            "bayes_opt",
            "by hand, goes on",
            lambda m: peer_bayes.bayes_opt_by_hand(m.lower, m.upper, m.noise_sd, goes_on=True),
            True,
        ),
        ("skopt", "defaults, 40", lambda m: peer_bayes.skopt(m.lower, m.upper), False),
    ]
    found = [
        Row(f"{peer_bayes.PACKAGES[module]}, {words}", contender, is_bayes=True, must_arrive=arrives)
        for module, words, contender, arrives in bayes
        if versions[peer_bayes.PACKAGES[module]] is not None
    ]
    return [
        *(Row(f"curve: {name}", curve(name), is_curve=True, must_arrive=True) for name in field.guides),
        *(
            Row(f"extremum seeking, {form.replace('_', ' ')}", untouched(optimize.ExtremumSeeking, form=form))
            for form in ("batch", "moving_average", "washout")
        ),
        Row("Newton seeking", untouched(optimize.NewtonSeeking)),
        Row("bounded seeking", untouched(optimize.BoundedSeeking)),
        Row("SPSA", untouched(optimize.Spsa)),
        Row("gradient descent", untouched(optimize.GradientDescent)),
        *(
            Row(f"tuned: {method.replace('_', ' ')}", tuned(method), must_arrive=True)
            for method in ("batch", "moving_average", "spsa")
        ),
        Row("golden section, noise given", driven(golden), must_arrive=True),
        *found,
    ]


def run_once(row: Row, field: SeekingMap, seed: int, *, noisy: bool = True) -> CountedPlant:
    setting = field.setting(seed, noisy)
    plant = CountedPlant(setting)
    run_to_end(row.contender(field), plant, setting.start, seed)
    return plant


def check_agreement(rows: list[Row], field: SeekingMap) -> None:
    """SystemExit where one that must arrive ends elsewhere without noise."""
    for row in rows:
        if row.must_arrive and not all(run_once(row, field, seed, noisy=False).near() for seed in (0, 1)):
            sys.exit(f"{row.name} does not find the optimum of {field.name} without noise: nothing counted")


@dataclass(frozen=True)
class Figures:
    """What came out of one contender on one map."""

    seeds: int
    lost: float
    lost_low: float
    lost_high: float
    median_arrival: float | None
    never: float
    away_at_end: float


def judged(row: Row, field: SeekingMap, seeds: int) -> Figures:
    plants = [run_once(row, field, seed) for seed in range(seeds)]
    arrivals = [plant.arrived for plant in plants]
    median = statistics.median(arrivals)
    return Figures(
        seeds,
        *mean_interval([plant.lost / CYCLES for plant in plants]),
        None if median == math.inf else median,
        sum(arrival == math.inf for arrival in arrivals) / seeds,
        sum(not plant.near() for plant in plants) / seeds,
    )


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200, help="runs per contender and map (default 200)")
    parser.add_argument("--bayes-seeds", type=int, default=20, help="the same for Bayesian optimisation (default 20)")
    parser.add_argument("--only", type=re.compile, default=re.compile(""), help="contenders whose name has this in it")
    parser.add_argument("--maps", type=re.compile, default=re.compile(""), help="maps whose name has this in it")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    if options.seeds < 2 or options.bayes_seeds < 2:
        parser.error("--seeds and --bayes-seeds must be at least 2")
    return options


def print_row(name: str, found: Figures) -> None:
    half = (found.lost_high - found.lost_low) / 2
    arrival = "never" if found.median_arrival is None else f"{found.median_arrival:.0f}"
    print(
        f"{name:40s} {found.lost:8.3f} +-{half:6.3f} {arrival:>8s} {found.never:7.0%} "
        f"{found.away_at_end:8.0%} {found.seeds:6d}",
        flush=True,
    )


def best_other(table: dict[str, Figures], rows: list[Row]) -> str | None:
    """Name of the one without a curve that loses least."""
    return min((row.name for row in rows if not row.is_curve), key=lambda name: table[name].lost, default=None)


def main() -> None:
    options = arguments()
    context = machine.versions()
    for package, version in installed(peer_bayes.PACKAGES).items():
        context[package] = version or "missing: its rows are left out (pip install --group bench)"
    fields = [field for field in all_maps() if options.maps.search(field.name)]
    chosen = {field.name: [row for row in rows_for(field) if options.only.search(row.name)] for field in fields}
    for field in fields:
        if field.name in ("engine", "quadratic"):
            check_agreement(chosen[field.name], field)
    for key, value in context.items():
        print(f"{key:26s} {value}")
    report = {}
    for field in fields:
        rows = chosen[field.name]
        print(f"\n{field.name}: noise {field.noise_sd:g}, {CYCLES} cycles")
        print(f"{'':40s} {'J lost':>8s} {'95 %':>8s} {'cycles':>8s} {'never':>7s} {'away':>8s} {'':>6s}")
        print(f"{'':40s} {'a cycle':>8s} {'':>8s} {'to 1':>8s} {'':>7s} {'at end':>8s} {'seeds':>6s}")
        table: dict[str, Figures] = {}
        for row in rows:
            table[row.name] = judged(row, field, options.bayes_seeds if row.is_bayes else options.seeds)
            print_row(row.name, table[row.name])
        best = best_other(table, rows)
        ratios = {row.name: table[row.name].lost / table[best].lost for row in rows if row.is_curve} if best else {}
        for name, ratio in ratios.items():
            print(f"{name} loses {ratio:.2f} times what {best} loses")
        report[field.name] = {
            "contenders": {name: asdict(found) for name, found in table.items()},
            "best_of_the_others": best,
            "ratios": ratios,
        }
        if options.json:
            whole = {"context": context, "cycles": CYCLES, "maps": report}
            options.json.write_text(json.dumps(whole, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
