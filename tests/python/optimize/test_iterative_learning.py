"""Iterative learning: the acceptance facts, theory against simulation, an engine that learns, refusals, resuming."""

from __future__ import annotations

import json
import pickle
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg, signal

from mgdd.engine import Cylinder, OperatingPoint, simulate
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.optimize import IterativeLearning
from mgdd.optimize.iterative_learning import ConvergenceReport
from mgdd.results.labels import check_labels


def lifted(h, n):
    column = np.zeros(n)
    column[: len(h[:n])] = h[:n]
    return linalg.toeplitz(column, np.zeros(n))


def run(learner, h, wanted, trials):
    errors = []
    for _ in range(trials):
        error = wanted - np.convolve(h, learner.ask())[: wanted.size]
        learner.tell(error)
        errors.append(error)
    return np.array(errors)


# --- laws --------------------------------------------------------------------------------------------------
def test_p_type_of_two_markov_parameters():
    wanted = np.ones(5)
    learner = IterativeLearning(np.zeros(5), impulse_response=[1.0, 0.5], k_p=1.9, guard=False)
    assert learner.convergence().spectral_radius == pytest.approx(0.9, abs=1e-10)
    norms = np.linalg.norm(run(learner, [1.0, 0.5], wanted, 600), axis=1) / np.linalg.norm(wanted)
    assert norms.max() == pytest.approx(840.1355881, abs=1e-4)
    assert norms[-1] < 1e-10
    with pytest.warns(UserWarning, match=r"law 'p' diverges: spectral radius 1\.1 must be < 1"):
        learner = IterativeLearning(np.zeros(5), impulse_response=[1.0, 0.5], k_p=2.1, guard=False)
    assert np.linalg.norm(run(learner, [1.0, 0.5], wanted, 300)[-1]) > 1e12


# The unit circle gives 4/3 for every length; finite trials are monotone a little beyond.
@pytest.mark.parametrize(
    ("n", "bound"), [(2, 1.5), (4, 1.375), (5, 1.3602291942), (10, 1.3402657569), (100, 1.33340597)]
)
def test_bound_of_monotone_trials(n, bound):
    reports = [
        IterativeLearning([0.0] * n, impulse_response=[1, 0.5], k_p=bound + d).convergence() for d in (-1e-7, 1e-7)
    ]
    assert [r.monotone for r in reports] == [True, False]
    assert bound > 4 / 3
    assert all(r.asymptotic and r.frequency_gain == pytest.approx(1.5 * bound - 1, abs=1e-6) for r in reports)


def test_norm_optimal_factor_of_each_singular_direction():
    left, s, _ = np.linalg.svd(lifted([1.0, 0.5], 7))
    for direction, sigma in zip(left.T, s, strict=True):
        for error, own in ((3.0, 0.2), (1.0, 0.0)):
            weights = {"change_weight": 0.4, "error_weight": error, "input_weight": own}
            learner = IterativeLearning(np.zeros(7), law="norm_optimal", impulse_response=[1.0, 0.5], **weights)
            errors = run(learner, [1.0, 0.5], direction, 3)
            np.testing.assert_allclose(errors[1], (own + 0.4) / (error * sigma**2 + own + 0.4) * direction, atol=1e-14)
    report = learner.convergence()
    assert report.spectral_radius == pytest.approx(0.4 / (s[-1] ** 2 + 0.4), abs=1e-10)
    assert report.monotone
    assert report.limit_error_gain == 0.0


LAWS = {
    "p": {"k_p": 0.4},
    "d": {"law": "d"},
    "pd": {"law": "pd", "k_d": 0.15},
    "p filtered": {"cutoff": 0.5},
    "q_filter": {"law": "q_filter"},
    "taps": {"law": "q_filter", "learning_function": [0.1, 0.5, 0.1], "lead": 1, "cutoff": 0.3},
    "norm_optimal": {"law": "norm_optimal"},
    "weighted": {"law": "norm_optimal", "input_weight": 0.1, "error_weight": 2.0},
}
RESPONSE = np.array([1e-17, 0.8, 0.3, -0.1])  # the first acts on nothing


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=10)
@given(wanted=st.lists(st.floats(-5, 5), min_size=10, max_size=10))
def test_simulation_reaches_the_predicted_limit(name, wanted):
    learner = IterativeLearning(np.zeros(10), impulse_response=RESPONSE, guard=False, **LAWS[name])
    report = learner.convergence()
    assert report.asymptotic
    assert learner.relative_degree == 1
    wanted = np.array(wanted)
    errors = run(learner, RESPONSE, wanted, 300)[:, 1:]
    limit = report.limit_error_map @ wanted[1:]
    np.testing.assert_allclose(errors[-1], limit, atol=1e-8)
    assert np.linalg.norm(limit) <= report.limit_error_gain * np.linalg.norm(wanted[1:]) + 1e-12
    if report.monotone:
        distance = np.linalg.norm(errors - limit, axis=1)
        assert np.all(distance[1:] <= report.sigma_max * distance[:-1] + 1e-10)


def test_filter_is_scipys_on_a_reflected_column():
    u = np.random.default_rng(2).normal(size=40)
    for cutoff in (0.05, 0.2, 0.8):
        learner = IterativeLearning(u, k_p=0.0, cutoff=cutoff)
        learner.ask()
        learner.tell(np.zeros(40))
        b, a = signal.butter(2, cutoff)
        expected = signal.filtfilt(b, a, np.pad(u, 800, mode="symmetric"), padtype=None)[800:-800]
        np.testing.assert_allclose(learner.ask(), expected, atol=1e-12)


# Unweighted eigenvalues give 1.7 to 2.0 here, and would call a converging law divergent.
def test_radius_of_a_long_trial_is_the_rate_of_its_simulation():
    n = 300
    h = 0.1 * 0.95 ** np.arange(n)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = IterativeLearning(np.zeros(n), law="q_filter", impulse_response=h).convergence()
    learner = IterativeLearning(np.zeros(n), k_p=5.0, cutoff=0.2, guard=False)
    change, rates = np.random.default_rng(0).normal(size=n), []
    for _ in range(3000):
        # The law is linear: from the input `change` and the error that it causes, one trial is one application.
        step = {**learner.state, "input": (change / np.linalg.norm(change)).tolist(), "asked": [1.0]}
        learner.state = step
        learner.tell(-np.convolve(h, step["input"])[:n])
        change = learner.ask()
        rates.append(np.linalg.norm(change))
    rate = np.exp(np.mean(np.log(rates[-1000:])))
    assert report.spectral_radius == pytest.approx(rate, rel=1e-3)
    assert not report.radius_is_exact


def test_frequency_test_finds_the_worst_frequency():
    h, k_p = np.array([1.0, -0.4, 0.3]), 1.2
    report = IterativeLearning(np.zeros(20), impulse_response=h, k_p=k_p, cutoff=0.6).convergence()
    f = np.linspace(0.0, 1.0, 200001)
    z = np.exp(-1j * np.pi * f)
    q = 1.0 / (1.0 + (np.tan(np.pi * f / 2) / np.tan(np.pi * 0.3)) ** 4)
    gain = q * abs(1.0 - k_p * (h[0] + h[1] * z + h[2] * z**2))
    assert report.frequency_gain == pytest.approx(gain.max(), abs=1e-9)
    assert report.worst_frequency == pytest.approx(f[gain.argmax()], abs=1e-4)


# --- an engine that learns ---------------------------------------------------------------------------------
CYCLES = np.arange(40)
FUEL_MG = np.where(CYCLES < 15, 12.0, 28.0)


def ca50_error(command_cad):
    soc = -4.0 + np.convolve(0.6 * 0.4**CYCLES, command_cad + 4.0)[: CYCLES.size]
    points = zip(FUEL_MG, soc, strict=True)
    return 9.0 - np.array(
        [float(simulate(Cylinder(), OperatingPoint(fuel_mg=f), soc_cad=s)["ca50_cad"]) for f, s in points]
    )


@pytest.mark.parametrize(
    ("law", "remaining"),
    [({"k_p": 0.8}, 1e-3), ({"law": "norm_optimal"}, 1e-3), ({"law": "q_filter", "k_p": 0.8, "cutoff": 0.6}, 0.2)],
)
def test_load_step_is_learned_with_a_rough_model(law, remaining):
    rough = 0.5 * 0.5**CYCLES
    learner = IterativeLearning(np.full(40, -4.0), impulse_response=rough, bounds=(-20.0, 5.0), rate=15.0, **law)
    for _ in range(12):
        learner.tell(ca50_error(learner.ask()))
    norms = learner.history["error_norm"].values
    assert not learner.frozen or learner.convergence().limit_error_gain > 0.0, "there the norm need not fall to the end"
    assert norms[0] > 10.0, "the load step disturbs CA50"
    assert np.all(np.diff(norms[:5]) < 0)
    assert norms[-1] < remaining * norms[0]


def test_history_is_labelled():
    learner = IterativeLearning([0.0, 0.0], k_p=0.5, relative_degree=1)
    assert learner.best_trial is None
    run(learner, [0.0, 1.0], np.array([9.0, 2.0]), 3)
    check_labels(learner.history)
    assert learner.history["trial"].values.tolist() == [0, 1, 2]
    assert learner.history["error_norm"].values.tolist() == [2.0, 1.0, 0.5]
    assert learner.best_trial == 2
    assert learner.best_input.tolist() == [1.5, 1.5]
    assert repr(learner) == "<IterativeLearning law='p', 2 samples, trial 3>"


# --- refusals ----------------------------------------------------------------------------------------------
def test_wrong_then_right():
    learner, twin = (IterativeLearning([0.0, 0.0, 0.0], k_p=0.5) for _ in range(2))
    good = np.array([1.0, 2.0, 3.0])
    before = learner.state
    with pytest.raises(ParameterError, match=r"trial 0 has not been asked for: call ask\(\)"):
        learner.tell(good)
    assert learner.state == before
    learner.ask()
    before = learner.state
    with pytest.raises(ShapeError, match="error of trial 0 has 2 samples: must have 3"):
        learner.tell([1.0, 2.0])
    with pytest.raises(ShapeError, match="2 dimensions"):
        learner.tell([[1.0, 2.0, 3.0]])
    with pytest.raises(ParameterError, match="one column of numbers"):
        learner.tell(["a", "b", "c"])
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(DataError, match=r"error of trial 0, sample 1 = -?(nan|inf): must be finite"):
            learner.tell([1.0, bad, 3.0])
    with pytest.raises(DataError, match=r"sample 0 = 1\.7e\+308: must be finite and at most 1e\+30 in magnitude"):
        learner.tell([1.7e308] * 3)
    steep = IterativeLearning([0.0, 0.0, 0.0], k_p=1e300)
    steep.ask()
    with pytest.raises(DataError, match="the trials diverge, lower the gain"):
        steep.tell([1e20] * 3)
    assert learner.state == before
    learner.tell(good)
    assert good.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(ParameterError, match="trial 1 has not been asked for"):
        learner.tell(good)
    twin.ask()
    twin.tell(good)
    assert learner.state == twin.state
    learner.ask()[:] = 7.0
    assert np.array_equal(learner.ask(), twin.ask()), "what ask gives is a copy"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "k_p is missing: give it, or impulse_response"),
        ({"law": "i"}, "law = 'i': must be one of p, d, pd, q_filter, norm_optimal"),
        ({"k_p": 1.0, "k_d": 1.0}, "k_d does nothing for law 'p'"),
        ({"k_p": 1.0, "lead": 1}, "lead does nothing"),
        ({"k_p": 1.0, "learning_function": [1.0]}, "learning_function does nothing"),
        ({"k_p": 1.0, "law": "pd"}, "k_d is missing"),
        ({"k_p": np.nan}, "k_p = nan"),
        ({"k_p": 1.0, "bounds": 3.0}, "bounds = 3: must be a pair"),
        ({"k_p": 1.0, "bounds": (0.0, 0.0)}, "lower = 0: must be < upper"),
        ({"k_p": 1.0, "relative_degree": 3}, "relative_degree = 3"),
        ({"k_p": 1.0, "initial": [0.0, np.inf, 0.0]}, r"initial\[1\] = inf"),
        ({"k_p": 1.0, "initial": [0.0, 1.0, 1.0], "rate": 0.5}, r"initial\[1\] = 1: differs .* rate = 0.5"),
        ({"impulse_response": [1.0], "initial": np.zeros(1001)}, "initial has 1001 samples"),
        ({"k_p": 1.0, "cutoff": 1.0}, "cutoff = 1: must be in"),
        ({"k_p": 1.0, "bounds": (0.5, None)}, r"initial\[0\] = 0: must be in \[0.5, inf\]"),
        ({"k_p": 1.0, "rate": -1.0}, "rate = -1: must be > 0"),
        ({"law": "norm_optimal"}, "impulse_response is missing"),
        ({"law": "norm_optimal", "impulse_response": [1.0], "error_weight": 0.0}, "error_weight = 0: must be > 0"),
        ({"law": "norm_optimal", "impulse_response": [1.0], "input_weight": np.nan}, "input_weight = nan"),
        ({"law": "norm_optimal", "impulse_response": [1.0], "cutoff": 0.2}, "cutoff does nothing"),
        ({"impulse_response": [0.0, 1.0], "relative_degree": 0}, "first acts after 1 samples"),
        ({"impulse_response": [0.0, 0.0]}, "the input would never act"),
        ({"impulse_response": [0.0, np.nan]}, r"impulse_response\[1\] = nan: must be finite"),
        (
            {"law": "norm_optimal", "impulse_response": [1e-9, 1.0], "change_weight": 0.0},
            "change_weight = 0: too small",
        ),
    ],
)
def test_bad_settings_are_named(arguments, message):
    with pytest.raises(ParameterError, match=message):
        IterativeLearning(**{"initial": [0.0, 0.0, 0.0], **arguments})


def test_no_model_no_report():
    learner = IterativeLearning([0.0], k_p=0.5)
    with pytest.raises(ParameterError, match="the convergence test needs a model"):
        learner.convergence()
    with pytest.raises(ShapeError, match="initial is empty"):
        IterativeLearning([], k_p=0.5)


def test_a_diverging_report_has_no_limit():
    with pytest.warns(UserWarning, match="spectral radius 1.5"):
        learner = IterativeLearning([0.0] * 3, impulse_response=[1.0], k_p=-0.5)
    report = learner.convergence()
    assert isinstance(report, ConvergenceReport)
    assert report.limit_error_map is None
    assert np.isnan(report.limit_error_gain)
    assert not report.monotone
    assert repr(report).startswith("<ConvergenceReport diverges")


# --- saved and resumed -------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", LAWS)
def test_state_and_pickle_go_on_bit_for_bit(name):
    wanted = np.sin(np.arange(10.0))
    learner, fresh = (IterativeLearning(np.zeros(10), impulse_response=RESPONSE, **LAWS[name]) for _ in range(2))
    run(learner, RESPONSE, wanted, 4)
    fresh.state = json.loads(json.dumps(learner.state, allow_nan=False))
    others = [fresh, pickle.loads(pickle.dumps(learner))]
    for one in (learner, *others):
        run(one, RESPONSE, wanted, 20)
    assert [one.state for one in others] == [learner.state] * 2


def test_bad_states_change_nothing():
    learner = IterativeLearning([0.0, 0.0], k_p=0.5, bounds=(-np.inf, 9.0))
    run(learner, [1.0], np.ones(2), 2)
    good = learner.state
    for change, error, message in (
        ({"input": [0.0]}, ParameterError, "'input' has 1 entries: must have 2"),
        ({"input": [0.0, np.nan]}, ParameterError, "'input' holds nan: must be finite"),
        ({"mood": [1.0]}, ParameterError, "9 columns, 8 are known here"),
        ({"input": [0.0, 9.5]}, ParameterError, "'input' = 9.5"),
        ({"best_input": [0.0] * 3}, ParameterError, "'best_input' has 3 entries"),
        ({"trial": [2.5]}, ParameterError, "whole number"),
        ({"trial": [-1.0]}, ParameterError, "trial"),
        ({"trial": [1.0]}, ParameterError, "trial"),
        ({"trial": []}, ParameterError, "trial"),
        ({"asked": [2.0]}, ParameterError, "asked"),
        ({"best_trial": [2.0]}, ParameterError, "best_trial"),
        ({"best_norm": []}, ParameterError, "best_norm"),
        ({"error_norms": [-1.0, 1.0]}, ParameterError, "error_norms"),
        ({"trial": ["two"]}, ParameterError, "numbers"),
    ):
        with pytest.raises(error, match=message):
            learner.state = good | change
        assert learner.state == good
    with pytest.raises(ParameterError, match="'frozen' is missing"):
        learner.state = {name: column for name, column in good.items() if name != "frozen"}
    with pytest.raises(ParameterError, match="mapping"):
        learner.state = [1.0]
    learner.state = good
    assert learner.state == good
