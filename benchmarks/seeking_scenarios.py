"""One question: how much J does `GaussianProcessSeeking` lose beside peers where what is sought moves or hides.

    python benchmarks/seeking_scenarios.py [--seeds 100] [--bayes-seeds 3] [--only REGEX] [--maps REGEX] [--json FILE]

Two inputs, -20 to 20 and 0 to 0.4, on the map "coupled" of `seeking_several_inputs.py`: optimum 4 to 5 off the middle
of each, start 12 away, noise 0.3, 300 cycles. Each scenario adds one thing (lengths in fortieths of the bounds, J in
points):

- drift of the optimum: by 8 over the run, in a drawn direction
- drift of the level: of J everywhere, by 3 over the run, up or down
- jump: half-way the optimum by 8, the level by 1
- delay 20, lag 10: J is read 20 cycles late, through a first-order sensor of 10 cycles
- delay 8, told 5 or 11
- half of the readings missing: each with probability 0.5
- a region that fails: all that is more than 3 beyond the optimum across both inputs; a failed cycle loses 10

What is counted: as in `seeking_several_inputs.py`, against the best input of that moment. "85 % holds" is the share of
cycles from the 20th on in which J at the estimate, without noise, lies within 1.44 standard deviations of what is
expected of it.

"Set" is what an engineer would set: a memory of 50 cycles where something moves, the delay that was told. Where a
reading is missing ours is told of a misfire, or its input is applied again. Peers have settings that were found by
trying on these very scenarios. Where J is late they hold each input for the delay and some cycles more, or take it for
that of the present input ("as if at once"). Where a reading is missing they apply the input again, and a failed cycle
they read as -3, which served them best.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from peers.peer_seekers import Contender, Plant, Point, held, installed
from seeking_several_inputs import KAPPA, at_rest, cobyqa, noisyopt, skopt
from support.moving_maps import Scenario, scenarios
from support.seeking_report import arguments, print_tables
from support.seeking_rows import OnMap, Row, driven, untouched

from mgdd.optimize import GaussianProcessSeeking, Seeker

if TYPE_CHECKING:
    from mgdd_studies.several_maps import SeekingMap

PACKAGES = {name: name for name in ("noisyopt", "scipy", "scikit-optimize")}

MEMORY = 50.0  # cycles, where something moves
SPSA, SLOW_SPSA = (14.0, 1.25, 500), (20.0, 1.5, 500)  # a, c and iterations of noisyopt; the second where J is late
EXTRA = (4, 10)  # cycles held beyond the delay, without a lag and with it
FAILS_LIKE = -3.0


def ours(scenario: Scenario) -> list[Row]:
    """As it comes, and as an engineer would set it for this scenario."""

    def make(field: SeekingMap, start: Point, seed: int) -> Seeker:
        moves = scenario.drift or scenario.jump or scenario.level_drift
        return GaussianProcessSeeking(
            start=start,
            bounds=(field.lower, field.upper),
            delay_cycles=scenario.told_delay(seed),
            lag_cycles=scenario.lag,
            **({"memory_cycles": MEMORY} if moves else {}),
        )

    rows = [Row("as it comes", untouched(GaussianProcessSeeking), is_tested=True)]
    if scenario.missing:
        rows.append(Row("asked again", driven(make, asks_again=True), is_tested=True))
    elif not scenario.fails:
        rows.append(Row("set", driven(make), is_tested=True))
    return [replace(row, name=f"Gaussian process seeking, {row.name}") for row in rows]


def waiting(scenario: Scenario, on: OnMap, extra: int) -> OnMap:
    """Let a peer hold each input for the delay that it is told, and so many cycles more."""

    def on_map(field: SeekingMap) -> Contender:
        peer = on(field)

        def run(plant: Plant, start: Point, seed: int) -> None:
            held(peer, scenario.told_delay(seed) + extra)(plant, start, seed)

        return run

    return on_map


def peers(scenario: Scenario) -> list[Row]:
    rows = [
        Row("noisyopt, SPSA, scaled, tuned", noisyopt(*(SLOW_SPSA if scenario.delay else SPSA))),
        Row("scipy, COBYQA, scaled, tuned, goes on", cobyqa(goes_on=True, initial_tr_radius=4.0, final_tr_radius=3.0)),
        Row("scikit-optimize, LCB, tuned, goes on", skopt("LCB", kappa=KAPPA), is_bayes=True),
    ]
    versions = installed(PACKAGES)
    rows = [row for row in rows if any(row.name.startswith(name) for name in versions if versions[name])]
    if not scenario.delay:
        instead = FAILS_LIKE if scenario.fails else None
        return [replace(row, contender=answered(row.contender, instead)) for row in rows]
    extra = EXTRA[scenario.lag > 0.0]
    return [
        one
        for row in rows
        for one in (
            replace(row, name=f"{row.name}, held", contender=waiting(scenario, row.contender, extra)),
            replace(row, name=f"{row.name}, as if at once"),
        )
    ]


def answered(on: OnMap, instead: float | None) -> OnMap:
    return lambda field: held(on(field), instead=instead)


def main() -> None:
    options = arguments(__doc__.splitlines()[0], seeds=100, bayes_seeds=3)
    still = Row("stays at the start", at_rest)
    chosen = [(one.map(), [still, *ours(one), *peers(one)]) for one in scenarios()]
    print_tables(options, chosen, set(), PACKAGES)


if __name__ == "__main__":
    main()
