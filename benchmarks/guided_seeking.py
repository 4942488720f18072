"""One question: how much J do guided seeking, plain seekers and Bayesian optimisation lose.

    python benchmarks/guided_seeking.py [--seeds 200] [--bayes-seeds 20] [--only REGEX] [--json FILE]

J lost over 300 cycles by what was applied, without its noise, against the best input [points per cycle]: mean over
seeds with its 95 % interval (Student's t), and over the first 40. Beside it the cycles until the estimate first is
within 1 (median), the share of runs in which it never is, the share of runs that end farther away than that, and the
J lost by the last estimate.

Maps: efficiency of the virtual bench over the start of combustion (noise 0.25 points, scatter 0.3 CAD, from -20 and 0
by turns, bounds -30 to 10), and five formulas between bounds 40 wide, optimum 4 to 5 to either side of the middle, 12
away from the start, noise 0.3: curvature 0.06 at the top of each. Untouched seekers and the curve are told no noise;
on the formulas the curve is a parabola of curvature 0.05 at the middle of the bounds. Tuned ones are told noise and
curvature, golden section and Bayesian optimisation by hand the noise.

Before anything is counted, whoever is told the noise and every curve must end within 1 of the optimum of the engine
and of the quadratic without noise.
"""

from __future__ import annotations

from collections.abc import Callable

from peers import peer_bayes
from peers.peer_seekers import Contender, installed
from support.seeking_maps import all_maps
from support.seeking_report import arguments, print_tables
from support.seeking_rows import Row, driven, tuned, untouched

from mgdd import guide, optimize
from mgdd_studies.several_maps import SeekingMap


def golden(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:  # noqa: ARG001 - no chance in it
    return optimize.GoldenSection(start=start, bounds=(field.lower, field.upper), noise_sd=field.noise_sd)


def curve(name: str) -> Callable[[SeekingMap], Contender]:
    def make(field: SeekingMap, start: float, seed: int) -> optimize.Seeker:  # noqa: ARG001 - no chance in it
        return guide.CurveSeeking(
            start=start, bounds=(field.lower, field.upper), curve=field.guides[name], prior_sd=field.prior_sd
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
        *(Row(f"curve: {name}", curve(name), is_tested=True, must_arrive=True) for name in field.guides),
        *(
            Row(f"extremum seeking, {form.replace('_', ' ')}", untouched(optimize.ExtremumSeeking, form=form))
            for form in ("batch", "moving_average", "washout")
        ),
        Row("SPSA", untouched(optimize.Spsa)),
        Row("gradient descent", untouched(optimize.GradientDescent)),
        *(
            Row(f"tuned: {method.replace('_', ' ')}", tuned(method), must_arrive=True)
            for method in ("batch", "moving_average", "spsa")
        ),
        Row("Gaussian process seeking", untouched(optimize.GaussianProcessSeeking)),
        Row("golden section, noise given", driven(golden), must_arrive=True),
        *found,
    ]


def main() -> None:
    options = arguments(__doc__.splitlines()[0])
    chosen = [(field, rows_for(field)) for field in all_maps()]
    print_tables(options, chosen, {"engine", "quadratic"}, peer_bayes.PACKAGES)


if __name__ == "__main__":
    main()
