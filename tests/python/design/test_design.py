"""Designs of experiments: laws of each method, known optimal designs, feasible regions, and what is refused."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay
from scipy.stats import qmc

from mgdd.design import FeasibleRegion, design_points
from mgdd.design.choice import d_optimal, least_distance
from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.optimize import Limit
from mgdd.results.labels import check_labels
from mgdd.surrogate.polynomial import PolynomialBasis

TWO = {"soi_cad": (-20.0, 4.0), "fuel_mg": (5.0, 45.0)}
LOW, SPAN = np.array([-20.0, 5.0]), np.array([24.0, 40.0])


def matrix(plan: xr.Dataset) -> np.ndarray:
    return np.column_stack([plan[name] for name in plan.data_vars])


def shares(plan: xr.Dataset) -> np.ndarray:
    return (matrix(plan) - LOW) / SPAN


def band(columns):
    """A slanted strip that holds 5/16 of the box."""
    s, f = (columns["soi_cad"] + 20.0) / 24.0, (columns["fuel_mg"] - 5.0) / 40.0
    return (f - s > -0.25) & (f - s < 0.08)


def log_det(plans: list[np.ndarray], model: str = "quadratic") -> float:
    m = plans[0].shape[1]
    terms = PolynomialBasis.of(model, centre=np.zeros(m), scale=np.ones(m))(np.vstack(plans))
    return float(np.linalg.slogdet(terms.T @ terms)[1])


# --- methods that fill space --------------------------------------------------------------------------------
def test_sobol_is_that_of_scipy():
    plan = design_points(TWO, 32, seed=5)
    own = qmc.Sobol(2, seed=np.random.default_rng(5)).random_base2(5)
    np.testing.assert_allclose(shares(plan), own, atol=1e-12)
    with pytest.warns(UserWarning, match="n = 20.* 16 and 32"):
        part = design_points(TWO, 20, seed=5)
    np.testing.assert_allclose(shares(part), own[:20], atol=1e-12)
    halton = design_points(TWO, 20, method="halton", seed=5)
    np.testing.assert_allclose(shares(halton), qmc.Halton(2, seed=np.random.default_rng(5)).random(20), atol=1e-12)


@given(n=st.integers(1, 40), seed=st.integers(0, 99))
def test_a_latin_hypercube_has_one_point_in_each_stratum(n, seed):
    plan = design_points(TWO, n, method="lhs", seed=seed, n_starts=2)
    for column in shares(plan).T:
        assert sorted((column * n).astype(int)) == list(range(n))


@given(k=st.integers(1, 12), n=st.integers(1, 12), seed=st.integers(0, 99))
def test_an_extended_hypercube_fills_the_free_strata(k, n, seed):
    old = design_points(TWO, k, method="lhs", seed=seed, n_starts=1)
    new = design_points(TWO, n, method="lhs", existing=old, seed=seed + 1, n_starts=2)
    for before, column in zip(shares(old).T, shares(new).T, strict=True):
        taken, placed = set((before * (k + n)).astype(int)), (column * (k + n)).astype(int)
        assert len(set(placed)) == n
        assert not taken & set(placed)
    assert new["point"].values.tolist() == list(range(k, k + n))


@pytest.mark.parametrize("method", ["sobol", "halton", "maximin"])
def test_points_added_by_distance_are_farther_from_the_old_ones(method):
    old = design_points(TWO, 16, seed=3)
    new = design_points(TWO, 8, method=method, existing=old, seed=4)
    random = np.random.default_rng(0).random((50, 8, 2))
    usual = np.median([least_distance(np.vstack([shares(old), draw])) for draw in random])
    assert new.attrs["least_distance"] > 2.0 * usual
    assert new.attrs["least_distance"] == least_distance(np.vstack([shares(old), shares(new)]))


def test_maximin_without_old_points_is_wider_than_sobol():
    assert (
        design_points(TWO, 16, method="maximin").attrs["least_distance"]
        > 1.3 * design_points(TWO, 16).attrs["least_distance"]
    )


def test_levels_are_drawn_in_equal_shares_and_two_numbers_are_a_range():
    factors = {"gear": [1, 2, 3, 5], "egr": {1, 0}, "fuel_mg": (5, 45)}
    plan = design_points(factors, 64, seed=1)
    assert np.unique(plan["gear"], return_counts=True)[1].tolist() == [16] * 4
    assert np.unique(plan["egr"], return_counts=True)[0].tolist() == [0.0, 1.0]
    assert np.unique(plan["fuel_mg"]).size == 64
    whole = design_points(factors, method="factorial", levels={"fuel_mg": 5})
    assert whole.sizes["point"] == 4 * 2 * 5
    assert np.unique(matrix(whole), axis=0).shape == (40, 3)
    assert np.unique(whole["fuel_mg"]).tolist() == [5.0, 15.0, 25.0, 35.0, 45.0]


@pytest.mark.parametrize("method", ["sobol", "halton", "lhs", "maximin", "d_optimal", "factorial"])
def test_the_same_seed_gives_the_same_points_with_units(method):
    n = None if method == "factorial" else 16
    one, two = (design_points(TWO, n, method=method, seed=7, feasible=band, levels=17) for _ in range(2))
    assert one.identical(two)
    check_labels(one)
    assert one["soi_cad"].attrs["long_name"] == "start of injection, °CA aTDC"
    assert one["fuel_mg"].attrs["units"] == "mg"
    assert band(one).all()
    assert 0.2 < one.attrs["feasible_share"] < 0.45
    assert method in ("factorial", "d_optimal") or not one.identical(
        design_points(TWO, n, method=method, seed=8, feasible=band, levels=17)
    )


# --- D-optimal ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("k", [1, 2, 5])
def test_a_quadratic_in_one_factor_wants_both_ends_and_the_middle(k):
    plan = design_points({"x": (-1.0, 1.0)}, 3 * k, method="d_optimal", levels=41)
    assert sorted(plan["x"].values.tolist()) == [-1.0] * k + [0.0] * k + [1.0] * k
    assert plan.attrs["log_det"] == pytest.approx(3.0 * np.log(3.0 * k) + np.log(4.0 / 27.0))
    assert plan.attrs["d_efficiency_percent"] == pytest.approx(100.0 * (4.0 / 27.0) ** (1.0 / 3.0))


def test_a_cubic_in_one_factor_wants_the_roots_of_a_legendre_slope():
    plan = design_points({"x": (10.0, 30.0)}, 8, method="d_optimal", model="cubic", levels=401)
    root = 10.0 / np.sqrt(5.0)
    np.testing.assert_allclose(sorted(plan["x"].values), np.repeat([10, 20 - root, 20 + root, 30], 2), atol=0.05)


# Largest determinants of a ±1 matrix of order n, squared: Hadamard's problem, known for centuries.
@pytest.mark.parametrize(("n", "largest"), [(3, 4), (4, 16), (5, 48), (6, 160), (7, 576), (8, 4096)])
def test_weighing_designs_reach_the_largest_determinant_there_is(n, largest):
    factors = {f"x{k}": {-1.0, 1.0} for k in range(n - 1)}
    plan = design_points(factors, n, method="d_optimal", model="linear", n_starts=20)
    assert np.exp(plan.attrs["log_det"]) == pytest.approx(largest**2)


def test_six_points_of_a_quadratic_in_two_factors_meet_the_published_design():
    delta = (4.0 - np.sqrt(13.0)) / 3.0
    published = np.array([[-1, -1], [1, -1], [-1, 1], [-delta, -delta], [1, 3 * delta], [3 * delta, 1]])
    plan = design_points({"a": (-1, 1), "b": (-1, 1)}, 6, method="d_optimal", levels=21, n_starts=20)
    assert plan.attrs["log_det"] == pytest.approx(log_det([matrix(plan)]))
    assert log_det([published]) - 0.02 < plan.attrs["log_det"] <= log_det([published]) + 1e-9


def test_nowhere_is_the_prediction_worse_than_the_equivalence_theorem_allows():
    """Kiefer and Wolfowitz: the largest n x'(X'X)^-1 x of a D-optimal design is p, nearly so with many points."""
    plan = design_points({"a": (-1, 1), "b": (-1, 1)}, 120, method="d_optimal", n_starts=3)
    basis = PolynomialBasis.of("quadratic", centre=np.zeros(2), scale=np.ones(2))
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 2), axis=-1).reshape(-1, 2)
    spread = np.linalg.inv(basis(matrix(plan)).T @ basis(matrix(plan)))
    worst = 120.0 * np.max(np.sum((basis(grid) @ spread) * basis(grid), axis=1))
    assert 6.0 - 1e-9 <= worst < 6.2


@given(seed=st.integers(0, 200), n=st.integers(4, 20), p=st.integers(2, 4))
def test_the_determinant_never_falls_during_exchange(seed, n, p):
    generator = np.random.default_rng(seed)
    candidates, fixed = generator.normal(size=(60, p)), generator.normal(size=(seed % 3, p))
    found = d_optimal(candidates, n, fixed=fixed, n_starts=2, generator=generator)
    assert np.all(np.diff(found.history) > 0.0)
    rows = np.vstack([fixed, candidates[found.rows]])
    assert found.log_det == pytest.approx(float(np.linalg.slogdet(rows.T @ rows)[1]))
    assert found.log_det == max(found.log_det_starts)


def test_augmentation_never_lowers_the_determinant_and_beats_points_at_random():
    old = design_points(TWO, 8, seed=2)
    before = log_det([2.0 * shares(old) - 1.0])
    new = design_points(TWO, 4, method="d_optimal", existing=old, levels=9)
    after = log_det([2.0 * shares(old) - 1.0, 2.0 * shares(new) - 1.0])
    assert new.attrs["log_det"] == pytest.approx(after)
    assert new.sizes["point"] == 4
    random = np.random.default_rng(0).uniform(-1.0, 1.0, (300, 4, 2))
    assert after > max(log_det([2.0 * shares(old) - 1.0, draw]) for draw in random) > before
    alone = design_points(TWO, 1, method="d_optimal", existing=old, levels=9)
    assert alone.attrs["log_det"] > before


def test_d_optimal_reaches_the_exhaustive_optimum_of_a_small_set():
    from itertools import combinations_with_replacement

    plan = design_points({"a": (-1, 1), "b": (-1, 1)}, 5, method="d_optimal", model="interactions", levels=3)
    grid = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    best = max(log_det([np.array(rows)], "interactions") for rows in combinations_with_replacement(grid, 5))
    assert plan.attrs["log_det"] == pytest.approx(best)


def test_a_grid_too_large_gets_fewer_levels_and_keeps_the_middle():
    plan = design_points(dict.fromkeys("abcdefg", (-1, 1)), 40, method="d_optimal", n_starts=1)
    assert plan.attrs["n_candidates"] == 3**7
    assert np.unique(matrix(plan)).tolist() == [-1.0, 0.0, 1.0]
    drawn = design_points(dict.fromkeys("abcdefghi", (-1, 1)), 12, method="d_optimal", model="linear", n_starts=1)
    assert drawn.attrs["n_candidates"] == 2**9


# --- feasible regions ---------------------------------------------------------------------------------------
def indicators(columns):
    sweep = timing_sweep(Cylinder(), OperatingPoint(), soc_cad=columns["soc_cad"])
    return {"p_max_bar": sweep["p_max_bar"], "dp_max_bar_per_cad": sweep["dp_max_bar_per_cad"]}


def test_a_region_of_the_cycle_model_keeps_its_limits():
    limits = [Limit("p_max_bar", 100.0, margin=5.0), Limit("dp_max_bar_per_cad", 5.0)]
    region = FeasibleRegion.of_model(indicators, limits)
    plan = design_points({"soc_cad": (-20.0, 10.0)}, 16, feasible=region)
    found = indicators(plan)
    assert (found["p_max_bar"] <= 95.0).all()
    assert (found["dp_max_bar_per_cad"] <= 5.0).all()
    every = region.evaluate({"soc_cad": np.linspace(-20.0, 10.0, 31)})
    check_labels(every)
    value = {limit.name: every[limit.name].values for limit in limits}
    room = np.stack([(95.0 - value["p_max_bar"]) / 100.0, (5.0 - value["dp_max_bar_per_cad"]) / 5.0])
    np.testing.assert_allclose(every["distance"], room.min(axis=0))
    names = np.array([limit.name for limit in limits])
    assert (every["active_limit"].values == names[room.argmin(axis=0)]).all()
    assert (every["feasible"].values == (room.min(axis=0) >= 0.0)).all()
    assert set(every["active_limit"].values) == set(names)
    assert not every["extrapolated"].any()


def test_a_model_that_fails_at_a_point_does_not_make_it_feasible():
    region = FeasibleRegion.of_model(lambda c: {"t_max_k": np.where(c["x"] > 1.0, np.nan, 900.0)}, {"t_max_k": 1000.0})
    assert region.contains({"x": [0.0, 2.0]}).tolist() == [True, False]
    assert region.evaluate({"x": [0.0, 2.0]})["distance"].values.tolist() == [pytest.approx(0.1), -np.inf]


def test_a_limit_of_zero_and_a_scale_are_kept():
    region = FeasibleRegion.of_model(lambda c: {"slope": c["x"]}, [Limit("slope", 0.0)])
    assert region.evaluate({"x": [-2.0, 3.0]})["distance"].values.tolist() == [2.0, -3.0]
    scaled = FeasibleRegion.of_model(lambda c: {"slope": c["x"]}, [Limit("slope", 1.0, scale=4.0)])
    assert scaled.evaluate({"x": [-1.0]})["distance"].item() == 0.5


def test_the_hull_of_measured_points_is_that_of_scipy():
    generator = np.random.default_rng(4)
    driven = generator.normal(size=(60, 3)) * [1.0, 20.0, 500.0] + [0.0, 30.0, 2000.0]
    names = ("a", "fuel_mg", "speed_rpm")
    region = FeasibleRegion.of_points(dict(zip(names, driven.T, strict=True)))
    asked = generator.uniform(driven.min(axis=0) - 1.0, driven.max(axis=0) + 1.0, (4000, 3))
    inside = Delaunay(driven[ConvexHull(driven).vertices]).find_simplex(asked) >= 0
    table = dict(zip(names, asked.T, strict=True))
    assert (region.contains(table) == inside).all()
    assert region.contains(dict(zip(names, driven.T, strict=True))).all()
    found = region.evaluate(table)
    assert (found["extrapolated"].values == ~inside).all()
    assert (found["feasible"].values == (found["distance"].values >= -1e-12)).all()


def test_distance_and_side_of_a_measured_box():
    driven = {"speed_rpm": [1000.0, 1000.0, 3000.0, 3000.0], "fuel_mg": [5.0, 45.0, 5.0, 45.0]}
    asked = {"speed_rpm": [1100.0, 2000.0, 3200.0], "fuel_mg": [25.0, 41.0, 25.0]}
    found = FeasibleRegion.of_points(driven).evaluate(asked)
    np.testing.assert_allclose(found["distance"], [0.05, 0.1, -0.1])
    assert found["active_limit"].values.tolist() == ["speed_rpm low", "fuel_mg high", "speed_rpm high"]
    assert found["extrapolated"].values.tolist() == [False, False, True]
    tight = FeasibleRegion.of_points(driven, margin=0.06)
    assert tight.contains(asked).tolist() == [False, True, False]
    np.testing.assert_allclose(tight.evaluate(asked)["distance"], [-0.01, 0.04, -0.16])


def test_known_infeasible_points_cut_the_hull_halfway():
    driven = {"x": [0.0, 0.0, 10.0, 4.0], "y": [0.0, 10.0, 0.0, 4.0]}
    region = FeasibleRegion.of_points(driven, infeasible={"x": [8.0], "y": [1.0]})
    # Nearest driven point (10, 0): the plane halfway to (8, 1), in ranges.
    asked = {"x": [8.6, 9.2], "y": [0.7, 0.4]}
    assert region.contains(asked).tolist() == [False, True]
    found = region.evaluate(asked)
    middle, normal = np.array([0.9, 0.05]), np.array([0.2, -0.1]) / np.hypot(0.2, 0.1)
    wanted = [(np.array([x, y]) / 10.0 - middle) @ normal for x, y in zip(*asked.values(), strict=True)]
    assert found["distance"].values[0] == pytest.approx(wanted[0])
    assert found["active_limit"].values[0] == "infeasible point"
    plan = design_points({"x": (0.0, 10.0), "y": (0.0, 10.0)}, 64, feasible=region)
    assert region.contains(plan).all()


def test_one_factor_has_a_hull_and_the_region_says_what_it_is():
    region = FeasibleRegion.of_points({"fuel_mg": [5.0, 30.0, 12.0]})
    assert region.contains({"fuel_mg": [4.9, 5.0, 30.0, 30.1]}).tolist() == [False, True, True, False]
    assert "measured points" in repr(region)
    assert "<table>" in region._repr_html_()


# --- bad input ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("factors", "text"),
    [
        ({}, "factors = "),
        ([("x", (0, 1))], "factors = "),
        ({"x": (1.0, 0.0)}, r"factors: x = \(1.0, 0.0\): must be \(low, high\) with low < high"),
        ({"x": (1.0, 1.0)}, "low < high"),
        ({"x": (0.0, float("nan"))}, "finite"),
        ({"x": (0.0, float("inf"))}, "finite"),
        ({"x": 3.0}, r"\(low, high\)"),
        ({"x": "ab"}, r"\(low, high\)"),
        ({"x": [1.0]}, "leave a constant out"),
        ({"x": [1.0, 2.0, 2.0]}, "without repeats"),
        ({"x": [1.0, 2.0, "three"]}, "levels"),
        ({"point": (0, 1)}, "none of them 'point'"),
        ({"x": (0, 1), "X ": (0, 1)}, "differ in more than case"),
        ({3: (0, 1)}, "as text"),
    ],
)
def test_bad_factors_are_named(factors, text):
    with pytest.raises(ParameterError, match=text):
        design_points(factors, 8)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"n": None}, "n = None: must be a whole number"),
        ({"n": 0}, "n = 0"),
        ({"n": 4.5}, "n = 4.5"),
        ({"method": "box"}, "method = .*one of sobol, halton"),
        ({"method": "factorial"}, "n = 8: must be None"),
        ({"model": "quartic", "method": "d_optimal"}, "model = "),
        ({"method": "d_optimal", "n": 5}, "n = 5: must be >= 6: the quadratic model has 6 terms"),
        ({"seed": -1}, "seed = -1"),
        ({"n_starts": 0}, "n_starts = 0"),
        ({"levels": {"speed": 3}}, "names of factors: soi_cad, fuel_mg"),
        ({"levels": 1}, "levels: soi_cad = 1"),
        ({"feasible": 3.0}, "feasible = 3: "),
    ],
)
def test_bad_requests_are_named(options, text):
    with pytest.raises(ParameterError, match=text):
        design_points(TWO, **{"n": 8, **options})


def test_infeasible_sets_are_named_with_their_share():
    def nowhere(columns):
        return columns["soi_cad"] > 100.0

    with pytest.raises(DataError, match=r"0 of \d+ points drawn by sobol are feasible \(0 %\), 8 are needed"):
        design_points(TWO, 8, feasible=nowhere)
    for method, n in (("factorial", None), ("d_optimal", 8)):
        with pytest.raises(DataError, match=r"none of .*feasible \(0 %\)"):
            design_points(TWO, n, method=method, feasible=nowhere)
    with pytest.raises(DataError, match="determine 3 of the 6 terms"):
        design_points(TWO, 8, method="d_optimal", feasible=lambda c: c["soi_cad"] == -20.0)
    old = {"soi_cad": [-20.0, 4.0], "fuel_mg": [5.0, 6.0]}
    with pytest.raises(DataError, match=r"existing: 1 of 2 points are feasible \(50 %\), point 1 is not"):
        design_points(TWO, 8, existing=old, feasible=lambda c: c["soi_cad"] < 0.0)
    with pytest.raises(DataError, match=r"existing: fuel_mg = 50 of point 1: must be in \[5, 45\]; 1 of 2"):
        design_points(TWO, 8, existing={"soi_cad": [0.0, 0.0], "fuel_mg": [10.0, 50.0]})
    with pytest.raises(DataError, match="existing have no fuel_mg"):
        design_points(TWO, 8, existing={"soi_cad": [0.0]})
    with pytest.raises(DataError, match="not a finite number"):
        design_points(TWO, 8, existing={"soi_cad": [0.0, np.nan], "fuel_mg": [10.0, 20.0]})


def test_answers_of_another_form_are_refused():
    with pytest.raises(ShapeError, match="feasible returned bool of shape"):
        design_points(TWO, 8, feasible=lambda columns: True)  # noqa: ARG005
    with pytest.raises(ShapeError, match="feasible returned float64"):
        design_points(TWO, 8, feasible=lambda columns: 1.0 * (columns["fuel_mg"] > 0.0))
    missing = FeasibleRegion.of_model(lambda c: {"t_max_k": c["x"]}, {"p_max_bar": 100.0})
    with pytest.raises(DataError, match="gives no p_max_bar: it gives t_max_k"):
        missing.contains({"x": [1.0]})
    short = FeasibleRegion.of_model(lambda _: {"p_max_bar": [1.0]}, {"p_max_bar": 100.0})
    with pytest.raises(ShapeError, match=r"p_max_bar of the model has shape \(1,\)"):
        short.contains({"x": [1.0, 2.0]})


def test_regions_that_enclose_nothing_are_refused():
    square = {"x": [0.0, 0.0, 1.0, 1.0], "y": [0.0, 1.0, 0.0, 1.0]}
    for points, text in (
        ({"x": [0.0, 1.0], "y": [0.0, 1.0]}, "2 points of 2 factors enclose nothing"),
        ({"x": [0.0, 1.0, 2.0], "y": [0.0, 2.0, 4.0]}, "lie in a plane"),
        ({"x": [0.0, 1.0, 2.0], "y": [1.0, 1.0, 1.0]}, "y does not vary"),
        ({name: np.random.default_rng(0).random(20) for name in "abcdefg"}, "7 factors"),
    ):
        with pytest.raises(DataError, match=text):
            FeasibleRegion.of_points(points)
    for margin in (-0.1, 0.5, float("nan")):
        with pytest.raises(ParameterError, match="margin"):
            FeasibleRegion.of_points(square, margin=margin)
    with pytest.raises(DataError, match="the point x 0, y 1 is also among"):
        FeasibleRegion.of_points(square, infeasible={"x": [0.0], "y": [1.0]})
    for limits in ({}, None):
        with pytest.raises(ParameterError, match="at least one upper limit"):
            FeasibleRegion.of_model(indicators, limits)
    with pytest.raises(ParameterError, match="must be a finite number"):
        FeasibleRegion.of_model(indicators, {"p_max_bar": float("nan")})
    with pytest.raises(ParameterError, match="indicators"):
        FeasibleRegion.of_model({"p_max_bar": 3.0}, {"p_max_bar": 100.0})
    with pytest.raises(ParameterError, match="points = "):
        FeasibleRegion.of_points(square).contains([[0.0, 0.0]])


def test_nothing_else_warns():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        design_points(TWO, 16)
        design_points(TWO, 20, feasible=band)
        design_points(TWO, 5, existing=design_points(TWO, 4))
