"""mgdd.optimize: laws, certified problems, SciPy as a second opinion, and refusals that change nothing."""

from __future__ import annotations

import inspect
import json
import pickle

import numpy as np
import pytest
from scipy import optimize as scipy_optimize

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize import least_squares

OPTIONS = ("max_iterations", "cost_tolerance", "correlation_limit")


def linear(a, b):
    return lambda x: (a @ x - b, a)


def rosenbrock(x):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


def decay(t, y):
    def fun(p):
        e = np.exp(-p[1] * t)
        return p[0] * e + p[2] - y, np.column_stack([e, -p[0] * t * e, np.ones_like(t)])

    return fun


def test_linear_problem_equals_lstsq_and_its_covariance():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(30, 4)), rng.normal(size=30)
    fit = least_squares(linear(a, b), np.zeros(4), data=b)
    expected = np.linalg.lstsq(a, b, rcond=None)[0]
    residual = a @ expected - b
    covariance = residual @ residual / 26 * np.linalg.inv(a.T @ a)
    assert fit.success
    np.testing.assert_allclose(fit.values, expected, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(fit.stderr, np.sqrt(np.diag(covariance)), rtol=1e-9)
    np.testing.assert_allclose(fit.residual, residual, atol=1e-9)
    assert fit.rmse == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert fit.nrmse_fit_percent == pytest.approx(100 * (1 - np.linalg.norm(residual) / np.linalg.norm(b - b.mean())))
    assert fit.x is fit.values
    assert fit.fun is fit.residual


# NIST Statistical Reference Datasets, Misra1a, from both starts.
@pytest.mark.parametrize("start", [(500.0, 1e-4), (250.0, 5e-4)])
def test_nist_misra1a(start):
    x = np.array([77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0])
    y = np.array([10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78])

    def fun(b):
        e = np.exp(-b[1] * x)
        return b[0] * (1 - e) - y, np.column_stack([1 - e, b[0] * x * e])

    fit = least_squares(fun, start, names=["b1", "b2"])
    assert fit.success
    np.testing.assert_allclose(fit.values, [2.3894212918e02, 5.5015643181e-04], rtol=1e-7)
    np.testing.assert_allclose(fit.stderr, [2.7070075241e00, 7.2668688436e-06], rtol=1e-7)
    assert 2 * fit.cost == pytest.approx(1.2455138894e-01, rel=1e-9)
    assert fit.unidentifiable == ("b1", "b2"), "their correlation is -0.999"


@pytest.mark.parametrize("seed", range(12))
def test_bounded_problem_equals_scipy_trf(seed):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 4.0, 60)
    truth = rng.uniform([0.5, 0.3, -0.5], [3.0, 2.0, 0.5])
    y = truth[0] * np.exp(-truth[1] * t) + truth[2] + 0.05 * rng.normal(size=t.size)
    lower, upper = truth - rng.uniform(-0.2, 1.0, 3), truth + rng.uniform(0.25, 1.0, 3)
    start = rng.uniform(lower, upper)
    fun = decay(t, y)
    fit = least_squares(fun, start, bounds=(lower, upper))
    peer = scipy_optimize.least_squares(
        lambda p: fun(p)[0],
        start,
        lambda p: fun(p)[1],
        bounds=(lower, upper),
        ftol=1e-14,
        xtol=1e-14,
        gtol=1e-14,
    )
    assert fit.success
    assert np.all((fit.values >= lower) & (fit.values <= upper))
    assert fit.cost <= peer.cost * (1 + 1e-9)
    np.testing.assert_allclose(fit.values, peer.x, rtol=1e-4, atol=1e-4)


def test_optimum_beyond_a_bound_ends_on_it_and_says_so():
    t = np.linspace(0.0, 4.0, 60)
    y = 2.0 * np.exp(-0.8 * t) + 0.3
    fit = least_squares(decay(t, y), [1.0, 0.5, 0.0], names=["a", "rate", "offset"], bounds=(-np.inf, [1.5, 5.0, 1.0]))
    assert fit.bounds_active.tolist() == [1, 0, 0]
    assert fit.values[0] == 1.5
    assert np.isnan(fit.stderr[0])
    assert np.isnan(fit.covariance[0]).all()
    assert "a" in fit.unidentifiable
    assert (fit.findings[0].code, fit.findings[0].names) == ("at_bound", ("a",))
    assert str(fit.findings[0]) == "a stands at its upper bound 1.5"


def test_log_scaled_parameters_report_natural_units():
    t = np.linspace(0.0, 4.0, 50)
    y = 3e-6 * np.exp(-1.7 * t) + 1e-8 * np.random.default_rng(3).normal(size=t.size)

    def fun(p):
        e = np.exp(-p[1] * t)
        return p[0] * e - y, np.column_stack([e, -p[0] * t * e])

    fit = least_squares(fun, [1.0, 1e-3], bounds=([1e-12, 1e-6], np.inf), log_scaled=[True, True])
    near = least_squares(fun, [2.9e-6, 1.6])
    assert fit.success
    np.testing.assert_allclose(fit.values, near.values, rtol=1e-6)
    np.testing.assert_allclose(fit.stderr, near.stderr, rtol=1e-6)


def test_collinear_parameters_are_named_with_infinite_stderr():
    a = np.random.default_rng(4).normal(size=(20, 3))
    a[:, 2] = -a[:, 0]
    fit = least_squares(linear(a, a @ [1.0, 2.0, 3.0] + 0.1), np.zeros(3), names=["gain", "offset", "loss"])
    assert fit.unidentifiable == ("gain", "loss")
    assert np.isinf(fit.stderr).tolist() == [True, False, True]
    np.testing.assert_allclose(fit.null_directions[:, 0], [1.0, 0.0, 1.0], atol=1e-12)
    assert fit.correlation[0, 2] == pytest.approx(1.0)
    assert (fit.findings[0].code, set(fit.findings[0].names)) == ("null_direction", {"gain", "loss"})
    assert "(gain +1, loss +1)" in fit.findings[0].text


def test_correlation_limit_decides_who_is_named():
    rng = np.random.default_rng(5)
    a = rng.normal(size=(400, 2))
    a[:, 1] = a[:, 0] + 0.1 * a[:, 1]
    b = rng.normal(size=400)
    assert least_squares(linear(a, b), [0.0, 0.0]).unidentifiable == ("x0", "x1")
    assert least_squares(linear(a, b), [0.0, 0.0], correlation_limit=0.9999).unidentifiable == ()


@pytest.mark.parametrize("answer", [None, (np.array([np.nan, 1.0]), np.eye(2)), (np.ones(2), np.full((2, 2), np.inf))])
def test_start_that_cannot_be_evaluated_is_a_status(answer):
    calls = []
    fit = least_squares(lambda x: calls.append(x) or answer, [1.0, 2.0], data=[1.0, 2.0])
    assert fit.status == "evaluation_failed"
    assert not fit.success
    assert fit.values.tolist() == [1.0, 2.0]
    assert np.isnan(fit.rmse)
    assert fit.nrmse_fit_percent is None
    assert len(calls) == 1


def test_refused_point_shortens_the_step():
    refused = []

    def fun(x):
        if x[0] <= 0.0:
            refused.append(x[0])
            return None
        return [np.log(x[0]) + 3.0], [[1.0 / x[0]]]

    fit = least_squares(fun, [2.0])
    assert refused
    assert fit.success
    assert fit.values[0] == pytest.approx(np.exp(-3.0), rel=1e-9)


def test_exceptions_of_the_model_pass_through_and_the_next_call_works():
    class ModelError(Exception):
        pass

    calls = []

    def fails_later(x):
        calls.append(x)
        if len(calls) > 2:
            raise ModelError("third call")
        return rosenbrock(x)

    with pytest.raises(ModelError, match="third call"):
        least_squares(fails_later, [-1.2, 1.0])
    assert least_squares(rosenbrock, [-1.2, 1.0]).success


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ((np.ones(3), np.ones((3, 3))), "jacobian of 3 x 3 for 3 residuals and 2 parameters"),
        ((np.ones(3), np.ones((2, 2))), "jacobian of 2 x 2 for 3 residuals"),
        ((np.ones((3, 1)), np.ones((3, 2))), "residual with 2 dimensions, expected 1"),
        ((np.ones(1), np.ones((1, 2))), "n_residuals = 1: must be >= the 2 parameters"),
        (np.ones(3), "fun must return"),
    ],
)
def test_wrong_shapes_from_the_model_are_refused(answer, message):
    with pytest.raises(ShapeError, match=message):
        least_squares(lambda _: answer, [0.0, 0.0])


def test_a_model_that_changes_its_number_of_residuals_is_refused():
    def fun(x):
        m = 3 if x[0] == 0.0 else 4
        return np.ones(m) * (x[0] - 1.0), np.ones((m, 1))

    with pytest.raises(ShapeError, match="returned 4 residuals, expected 3"):
        least_squares(fun, [0.0])


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"x0": [np.nan, 1.0]}, ParameterError, "start of x0 = nan"),
        ({"x0": [-1.2, 9.0], "bounds": (None, 5.0)}, ParameterError, "start of x1 = 9: must be finite and in"),
        ({"bounds": "ab"}, ParameterError, "bounds = 'ab': must be a pair"),
        ({"bounds": ([1.0, 1.0], 0.0)}, ParameterError, "x0: lower = 1 must be < upper = 0"),
        ({"log_scaled": [False, True]}, ParameterError, "x1: lower = -inf must be > 0"),
        ({"names": ["a", "a"]}, ParameterError, "'a' appears twice"),
        ({"max_iterations": 0}, ParameterError, "max_iterations = 0"),
        *(({name: np.nan}, ParameterError, f"{name} = nan") for name in OPTIONS[1:]),
        ({"names": ["", "b"]}, ParameterError, "parameter 0 has no name"),
        ({"x0": [[0.0, 1.0]]}, ShapeError, "x0 has 2 dimensions"),
        ({"x0": ["low", "high"]}, ParameterError, "must be numbers"),
        ({"bounds": ([0.0, 0.0, 0.0], np.inf)}, ShapeError, "bounds.0. has 3 values for the 2"),
        ({"names": ["a"]}, ShapeError, "must be 2 names"),
        ({"names": "ab"}, ShapeError, "must be 2 names"),
    ],
)
def test_bad_input_is_refused_before_the_model_is_called(arguments, error, message):
    def never(_):
        raise AssertionError("evaluated")

    with pytest.raises(error, match=message):
        least_squares(never, **{"x0": [-1.2, 1.0], **arguments})


def test_data_of_another_length_is_refused():
    with pytest.raises(ShapeError, match="one value per residual"):
        least_squares(rosenbrock, [-1.2, 1.0], data=[1.0, 2.0, 3.0])


def test_arrays_of_the_caller_stay_as_they_were():
    x0, lower = np.array([-1.2, 1.0]), np.array([-2.0, -2.0])

    def spoils_its_argument(x):
        result = rosenbrock(x)
        x[:] = 99.0
        return result

    fit = least_squares(spoils_its_argument, x0, bounds=(lower, np.inf))
    assert x0.tolist() == [-1.2, 1.0]
    assert lower.tolist() == [-2.0, -2.0]
    np.testing.assert_allclose(fit.values, [1.0, 1.0], rtol=1e-9)


def test_reports_are_independent_and_read_only():
    first = least_squares(rosenbrock, [-1.2, 1.0])
    kept = first.values.copy()
    least_squares(rosenbrock, [5.0, -5.0], bounds=(-np.inf, 0.2 + np.array([5.0, 0.0])))
    np.testing.assert_array_equal(first.values, kept)
    with pytest.raises(ValueError, match="read-only"):
        first.values[0] = 0.0
    with pytest.raises(AttributeError):
        first.cost = 0.0
    with pytest.raises(ValueError, match="read-only"):
        first.history["cost"][0] = 0.0


def test_reports_survive_pickling():
    fit = least_squares(rosenbrock, [-1.2, 1.0], names=["a", "b"])
    assert pickle.loads(pickle.dumps(fit)).to_dict() == fit.to_dict()


def test_history_falls_and_counts():
    fit = least_squares(rosenbrock, [-1.2, 1.0])
    cost = fit.history["cost"]
    assert len(cost) == fit.nit + 1 == fit.nfev
    assert np.all(np.diff(cost) <= 0.0)
    np.testing.assert_array_equal(fit.history["accepted"][1:], np.diff(cost) < 0.0)
    assert cost[-1] == fit.cost
    limited = least_squares(rosenbrock, [-1.2, 1.0], max_iterations=2)
    assert (limited.status, limited.nit, limited.success) == ("iteration_limit", 2, False)


def test_summary_html_and_json_tell_the_same_story():
    a = np.random.default_rng(6).normal(size=(20, 3))
    a[:, 1] = 0.0
    fit = least_squares(
        linear(a, a @ [9.0, 0.0, 1.0] + 0.1),
        np.zeros(3),
        names=["<gain>", "idle", "k"],
        bounds=(-np.inf, [2.0, 5.0, 5.0]),
    )
    text, page, plain = fit.summary(), fit._repr_html_(), fit.to_dict()
    for line in ("at upper bound", "not identifiable", "idle: the residual does not depend on it"):
        assert line in text
        assert line in page
    assert "&lt;gain&gt;" in page
    assert "<gain>" not in page
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert plain["names"] == ["<gain>", "idle", "k"]
    assert plain["stderr"][:2] == [None, None]
    assert plain["unidentifiable"] == ["<gain>", "idle"]
    assert plain["history"]["accepted"][0] is True
    assert "residual" not in plain
    assert "unidentifiable=['<gain>', 'idle']" in repr(fit)


def test_defaults_are_those_of_the_core():
    options = _core.optimize.LeastSquaresOptions()
    for name in OPTIONS:
        assert inspect.signature(least_squares).parameters[name].default == getattr(options, name)


def test_intervals_hold_as_often_as_they_say_even_of_few_residuals() -> None:
    x = np.array([0.0, 1.0, 2.0, 4.0, 7.0])
    jacobian = np.column_stack([np.ones(x.size), x])
    rng = np.random.default_rng(11)
    held = {0.5: 0, 0.95: 0}
    for _ in range(1000):
        y = 2.0 - 3.0 * x + 0.4 * rng.standard_normal(x.size)
        report = least_squares(lambda p, y=y: (jacobian @ p - y, jacobian), [0.0, 0.0], names=["offset", "slope"])
        for level in held:
            low, high = report.interval(level)["slope"]
            held[level] += low <= -3.0 <= high
    assert held[0.5] == pytest.approx(500, abs=50)
    assert held[0.95] == pytest.approx(950, abs=21)  # 1.96 standard errors hold 855 times
    with pytest.raises(ParameterError, match=r"level = 1: must be between 0 and 1"):
        report.interval(1.0)
