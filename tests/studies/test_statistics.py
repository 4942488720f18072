"""Means over seeds and the curves of them: intervals cover as they say, what never arrived is left out."""

import math

import numpy as np
import pytest

from mgdd.errors import DataError
from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import ExtremumSeeking, Spsa
from mgdd.results.labels import labelled_dataset
from mgdd_studies.curves import convergence
from mgdd_studies.statistics import (
    band_variables,
    estimates,
    loops,
    mean_interval,
    rms,
    run_with_slope,
    with_interval,
    with_quantiles,
)


def test_interval_by_hand() -> None:
    mean, low, high = mean_interval([1.0, 2.0, 3.0, 4.0])
    half = 3.182446305 * math.sqrt(5.0 / 3.0) / 2.0  # t(0.975, 3), standard deviation of the sample, root of 4
    assert (mean, low, high) == pytest.approx((2.5, 2.5 - half, 2.5 + half), rel=1e-9)


def test_interval_covers_the_mean_in_95_of_100_cases() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(4000):
        _, low, high = mean_interval(rng.normal(3.0, 2.0, 6))
        inside += low <= 3.0 <= high
    assert inside / 4000 == pytest.approx(0.95, abs=0.01)  # three standard errors


def test_what_never_arrived_is_left_out() -> None:
    assert mean_interval([1.0, math.nan, 3.0]) == mean_interval([1.0, 3.0])
    assert mean_interval([5.0])[0] == 5.0
    assert np.isnan(mean_interval([5.0])[1:]).all()
    assert np.isnan(mean_interval([math.nan, math.nan])).all()
    assert list(with_interval("x", [1.0, 2.0])) == ["x", "x_low", "x_high"]


def test_rms_and_bands() -> None:
    assert rms([3.0, 4.0]) == pytest.approx(math.sqrt(12.5))

    def make(seed: int) -> tuple[VirtualEngine, ExtremumSeeking]:
        return VirtualEngine(seed=seed), ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0))

    found = estimates(make, range(11), 120)
    variables = band_variables("x_{}_cad", ("run", "cycle"), [found], "°CA", with_quantiles("x"))
    assert list(variables) == ["x_median_cad", "x_low_cad", "x_high_cad"]
    (middle,), (low,), (high,) = (values for _, values, *_ in variables.values())
    runs = np.stack([run_seeker(*make(seed), 120).dataset["estimate"][:, 0].to_numpy() for seed in range(11)])
    np.testing.assert_array_equal(middle, np.median(runs, axis=0))
    np.testing.assert_array_equal(low, np.sort(runs, axis=0)[1])
    np.testing.assert_array_equal(high, np.sort(runs, axis=0)[9])


@pytest.mark.parametrize("form", ["batch", "moving_average"])
def test_slope_belongs_to_the_same_trajectory(form: str) -> None:
    def seeker() -> ExtremumSeeking:
        return ExtremumSeeking(start=-15.0, bounds=(-30.0, 10.0), form=form, hold_cycles=400)

    quiet = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
    bench, mine = VirtualEngine(**quiet), seeker()
    run = run_with_slope(bench, mine, 300)
    same = run_seeker(VirtualEngine(**quiet), seeker(), 300).dataset
    np.testing.assert_array_equal(run["j"], same["j"])
    assert (bench.cycle, mine.cycle) == (300, 300)
    model = VirtualEngine(**quiet)
    rise = 0.5 * (model.step(-14.0)["j"] - model.step(-16.0)["j"])  # held at -15: the slope is that of the map
    assert float(run["gradient_per_cad"][-1]) == pytest.approx(rise, rel=0.02)


def test_loops_are_those_of_the_monte_carlo_over_seeds_alone() -> None:
    seeker = Spsa(start=-12.0, bounds=(-30.0, 10.0))
    table = loops(VirtualEngine(), seeker, range(3), cycles=50)
    assert dict(table.sizes) == {"seed": 3}
    whole = monte_carlo(VirtualEngine(), seeker, range(3), cycles=50)
    np.testing.assert_array_equal(table["mean_soc_cad"], whole["mean_soc_cad"][0, 0])


CYCLE = np.arange(300)


def tracks():
    cases, dims = ["slow", "fast"], ("case", "cycle")
    curves = np.stack([-6.0 - 9.0 * np.exp(-CYCLE / t) for t in (80.0, 20.0)])
    cad = "°CA aTDC"
    return labelled_dataset({
        "cycle": ("cycle", CYCLE), "case": ("case", cases, "-", "case"),
        "estimate_median_cad": (dims, curves, cad, "estimate"), "optimum_cad": ((), -6.0, cad, "optimum"),
        "estimate_low_cad": (dims, curves - 0.5, cad, "low"), "estimate_high_cad": (dims, curves + 0.7, cad, "high"),
    })  # fmt: skip


def test_convergence_bands_and_refusals():
    ax = convergence(tracks())
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), tracks()["estimate_median_cad"][1])
    assert len(ax.collections) == 2
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    low, high = tracks()["estimate_low_cad"][0], tracks()["estimate_high_cad"][0]
    assert (band.min(), band.max()) == pytest.approx((float(low.min()), float(high.max())))
    assert len(convergence(tracks().drop_vars("estimate_low_cad")).collections) == 0
    with pytest.raises(DataError, match="must be cycle and one more"):
        convergence(tracks().isel(case=0, drop=True))
    many = tracks().isel(case=[0, 1] * 6).assign_coords(case=("case", list("abcdefghijkl"), tracks()["case"].attrs))
    with pytest.raises(DataError, match="case has 12 entries: at most 9"):
        convergence(many)
