"""One question: how much J do seekers of two and three inputs of unlike units lose beside peers.

    python benchmarks/seeking_several_inputs.py [--seeds 200] [--bayes-seeds 20] [--only REGEX] [--json FILE]

J lost by what was applied, without its noise, against the best input [points per cycle], over 300 cycles and over the
first 40: mean over seeds, for the first with its 95 % interval (Student's t). Beside it the cycles until the estimate
first loses less than 0.03 per input (median), the share of runs in which it never does, the share of runs whose last
estimate loses more than that, and the mean J lost by the last estimate.

Maps: formulas of the distance from the best input, each input counted in fortieths of its bounds (-20 to 20, 0 to 0.4,
100 to 250), the optimum 4 to 5 to either side of the middle of each, the start 12 away in a drawn direction, noise 0.3.
"Scaled" is by hand, to bounds that are 40 wide in every input. SPSA by tune is given noise and curvature, tuned
Bayesian optimisation the noise; other settings of tuned peers were found by trying on these maps. What is called 40
stays at its estimate after 40 cycles.

Before anything is counted, whoever is given the noise and goes on must find the optimum of the maps "coupled" and
"three" without noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from peers import peer_bayes, peer_seekers
from peers.peer_seekers import Contender, Plant, Point, installed, scaled, stay
from support.seeking_report import arguments, print_tables
from support.seeking_rows import OnMap, Row, driven, tuned, untouched

from mgdd import optimize
from mgdd_studies.several_maps import WIDTH, Guide, SeekingMap, of_no_use, off_by_a_fifth, several_maps

PACKAGES = {"noisyopt": "noisyopt", "scipy": "scipy", **peer_bayes.PACKAGES}
KAPPA = 1.0  # of the confidence bound


def by_hand(on: OnMap) -> OnMap:
    """Let a contender see inputs that are alike, as its user would scale them."""

    def on_alike(field: SeekingMap) -> Contender:
        half = np.full(np.size(field.lower), WIDTH / 2)
        return scaled(on(replace(field, lower=-half, upper=half)), field.lower, field.upper, WIDTH)

    return on_alike


def at_rest(field: SeekingMap) -> Contender:  # noqa: ARG001 - it does nothing anywhere
    def run(plant: Plant, start: Point, seed: int) -> None:  # noqa: ARG001
        stay(plant)

    return run


def guided(guide: Callable[[SeekingMap, int], Guide]) -> OnMap:
    def make(field: SeekingMap, start: Point, seed: int) -> optimize.Seeker:
        return optimize.GaussianProcessSeeking(start=start, bounds=(field.lower, field.upper), guide=guide(field, seed))

    return driven(make)


def ours() -> list[Row]:
    """Seekers of the package; those under test are set beside the best of the others."""
    return [
        Row("SPSA, scaled", by_hand(untouched(optimize.Spsa))),
        Row("Gaussian process seeking", untouched(optimize.GaussianProcessSeeking), must_arrive=True, is_tested=True),
        Row("Gaussian process seeking, guide off by a fifth", guided(off_by_a_fifth)),
        Row("Gaussian process seeking, guide of no use", guided(of_no_use)),
        Row("SPSA by tune, scaled", by_hand(tuned("spsa")), must_arrive=True),
    ]


def noisyopt(*settings: float) -> OnMap:
    return by_hand(lambda field: peer_seekers.noisyopt(*settings, bounds=(field.lower, field.upper)))


def cobyqa(**settings: object) -> OnMap:
    return by_hand(lambda field: peer_seekers.cobyqa(field.lower, field.upper, **settings))


def bayes_opt(*, goes_on: bool) -> OnMap:
    settings = {"goes_on": goes_on, "kappa": KAPPA, "scale": (12.0, 80.0), "searches": 1}
    return by_hand(lambda field: peer_bayes.bayes_opt_by_hand(field.lower, field.upper, field.noise_sd, **settings))


def skopt(acquisition: str, **settings: float) -> OnMap:
    settings = {"goes_on": True, "acquisition": acquisition, **settings}
    return lambda field: peer_bayes.skopt_by_hand(field.lower, field.upper, field.noise_sd, **settings)


def peers() -> list[Row]:
    rows = [
        ("noisyopt", Row("SPSA, scaled", noisyopt())),
        ("noisyopt", Row("SPSA, scaled, tuned", noisyopt(20.0, 2.0, 1000))),
        ("scipy", Row("COBYQA, scaled, stays", cobyqa())),
        ("scipy", Row("COBYQA, scaled, tuned, stays", cobyqa(initial_tr_radius=6.0, final_tr_radius=4.0))),
        (
            "scipy",
            Row("COBYQA, scaled, tuned, goes on", cobyqa(goes_on=True, initial_tr_radius=4.0, final_tr_radius=3.0)),
        ),
        ("bayes_opt", Row("as it comes, 40", lambda m: peer_bayes.bayes_opt(m.lower, m.upper), is_bayes=True)),
        ("bayes_opt", Row("scaled, tuned, 40", bayes_opt(goes_on=False), is_bayes=True)),
        ("bayes_opt", Row("scaled, tuned, goes on", bayes_opt(goes_on=True), is_bayes=True, must_arrive=True)),
        ("skopt", Row("as it comes, 40", lambda m: peer_bayes.skopt(m.lower, m.upper), is_bayes=True)),
        ("skopt", Row("EI, tuned, goes on", skopt("EI"), is_bayes=True, must_arrive=True)),
        ("skopt", Row("LCB, tuned, goes on", skopt("LCB", kappa=KAPPA), is_bayes=True, must_arrive=True)),
    ]
    versions = installed(PACKAGES)
    return [
        replace(row, name=f"{PACKAGES[module]}, {row.name}")
        for module, row in rows
        if versions[PACKAGES[module]] is not None
    ]


def main() -> None:
    options = arguments(__doc__.splitlines()[0])
    rows = [Row("stays at the start", at_rest), *ours(), *peers()]
    print_tables(options, [(field, rows) for field in several_maps()], {"coupled", "three"}, PACKAGES)


if __name__ == "__main__":
    main()
