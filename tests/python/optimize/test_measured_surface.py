"""`measure_map`: the quadratic surface of a noisy map, its doubts, and what it refuses."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mgdd.errors import DataError, ShapeError
from mgdd.optimize import measure_map

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BEST = np.array([-4.0, 0.15, 900.0])  # timing, EGR, rail pressure
BEND = np.array([[-0.06, -1.5, 1e-4], [-1.5, -600.0, -0.02], [1e-4, -0.02, -2e-6]])
LOW, HIGH = np.array([-15.0, 0.0, 500.0]), np.array([4.0, 0.32, 1200.0])
NOISE = 0.25


def spread(n: int, inputs: int, seed: int) -> Array:
    return LOW[:inputs] + (HIGH - LOW)[:inputs] * np.random.default_rng(seed).random((n, inputs))


def quadratic(x: Array) -> Array:
    away = x - BEST[: x.shape[1]]
    return 56.0 + 0.5 * np.einsum("ni,ij,nj->n", away, BEND[: x.shape[1], : x.shape[1]], away)


@pytest.mark.parametrize("inputs", [1, 2, 3])
@pytest.mark.parametrize("maximize", [True, False])
def test_an_exact_quadratic_comes_back(inputs: int, maximize: bool) -> None:
    x = spread(15, inputs, 1)
    sign = 1.0 if maximize else -1.0
    found = measure_map(x, sign * quadratic(x), maximize=maximize)
    np.testing.assert_allclose(np.atleast_2d(found.curvature), sign * BEND[:inputs, :inputs], rtol=1e-6)
    np.testing.assert_allclose(np.atleast_1d(found.optimum), BEST[:inputs], rtol=1e-6)
    assert found.noise_sd < 1e-10
    assert (found.points, found.findings, found.inputs) == (15, (), ())
    if inputs == 1:
        assert isinstance(found.optimum, float)
        assert found.bends is None
        return
    along = found.directions @ found.curvature @ found.directions.T
    np.testing.assert_allclose(along, np.diag(found.bends), atol=1e-9)
    assert (np.diff(np.abs(found.bends)) < 0.0).all()


@pytest.mark.parametrize("inputs", [1, 2])
def test_standard_errors_are_those_of_the_scatter_over_many_repetitions(inputs: int) -> None:
    x = spread(40, inputs, 3)
    rng = np.random.default_rng(4)
    maps = [measure_map(x, quadratic(x) + rng.normal(0.0, NOISE, 40)) for _ in range(400)]
    bend, best = BEND[:inputs, :inputs], BEST[:inputs]
    for name, truth in (("noise_sd", NOISE), ("curvature", np.squeeze(bend)), ("optimum", np.squeeze(best))):
        values = np.array([getattr(found, name) for found in maps])
        stated = np.mean([getattr(found, f"{name}_stderr") for found in maps], axis=0)
        assert (np.abs(values.mean(axis=0) - truth) < 0.25 * values.std(axis=0)).all()
        np.testing.assert_allclose(stated, values.std(axis=0), rtol=0.15)
    if inputs == 1:
        return
    of_all = np.cov(np.array([found.optimum for found in maps]).T)
    np.testing.assert_allclose(np.mean([found.optimum_covariance for found in maps], axis=0), of_all, rtol=0.3)
    assert np.mean([bool(found.findings) for found in maps]) < 0.025


def test_other_units_and_another_order_change_nothing_else() -> None:
    x = spread(30, 2, 5)
    j = quadratic(x) + np.random.default_rng(6).normal(0.0, NOISE, 30)
    plain, other = measure_map(x, j), measure_map(x[:, ::-1] * [100.0, 1.0], 1e-2 * j)
    np.testing.assert_allclose(other.optimum, plain.optimum[::-1] * [100.0, 1.0], rtol=1e-9)
    np.testing.assert_allclose(other.optimum_stderr, plain.optimum_stderr[::-1] * [100.0, 1.0], rtol=1e-9)
    units = np.array([[1e-4, 1e-2], [1e-2, 1.0]])
    np.testing.assert_allclose(other.curvature, 1e-2 * plain.curvature[::-1, ::-1] * units, rtol=1e-9)


def test_columns_by_name_keep_their_names() -> None:
    x = spread(30, 2, 5)
    j = quadratic(x) + np.random.default_rng(6).normal(0.0, NOISE, 30)
    columns = {"soc_cad": x[:, 0], "egr": x[:, 1]}
    plain, named = measure_map(x, j), measure_map(columns, j)
    assert named.inputs == ("soc_cad", "egr")
    assert np.array_equal(named.optimum, plain.optimum)
    assert named != plain
    tables: tuple[Any, ...] = (
        xr.Dataset({name: ("cycle", values) for name, values in columns.items()}),
        pd.DataFrame(columns),
    )
    for table in tables:
        assert measure_map(table, j) == named
    assert pickle.loads(pickle.dumps(named)) == named
    assert float(named.dataset["optimum"].sel(input="egr")) == named.optimum[1]
    assert "soc_cad, egr" in named.summary()
    one = measure_map({"soc_cad": x[:, 0]}, -((x[:, 0] + 4.0) ** 2))
    assert one.inputs == ("soc_cad",)
    assert isinstance(one.optimum, float)
    assert one.optimum == measure_map(x[:, 0], -((x[:, 0] + 4.0) ** 2)).optimum == measure_map(
        x[:, :1], -((x[:, 0] + 4.0) ** 2)
    ).optimum  # fmt: skip


def skewed(x: Array) -> Array:
    u, w = x[:, 0] + 4.0, 100.0 * (x[:, 1] - 0.15)
    return 50.0 - 2.0 * (np.exp(0.1 * u) - 0.1 * u) - 2.0 * (np.exp(0.1 * w) - 0.1 * w) - 0.005 * u * w


GRID = np.array([[a, b] for a in np.linspace(-20.0, 12.0, 7) for b in np.linspace(0.0, 0.3, 7)])
SKEWED: dict[str, Callable[[int], Array]] = {
    "repeats": lambda _: np.repeat(GRID, 4, axis=0),
    "none": lambda seed: [-20.0, 0.0] + [32.0, 0.3] * np.random.default_rng(seed).random((120, 2)),
}


@pytest.mark.parametrize("points", SKEWED.values(), ids=SKEWED)
def test_a_skewed_map_is_no_noise(points: Callable[[int], Array]) -> None:
    maps = []
    for seed in range(40):
        x = points(seed)
        maps.append(measure_map(x, skewed(x) + np.random.default_rng(100 + seed).normal(0.0, 0.2, len(x))))
    assert np.mean([[finding.code for finding in found.findings] == ["lack_of_fit"] for found in maps]) > 0.95
    assert np.mean([found.noise_sd for found in maps]) == pytest.approx(0.2, rel=0.1)
    median = np.median([np.diag(found.curvature) for found in maps], axis=0)
    np.testing.assert_allclose(median, [-0.02, -200.0], rtol=0.35)
    inside = [np.abs(found.optimum - [-4.0, 0.15]) < 1.96 * found.optimum_stderr for found in maps]
    assert (np.mean(inside, axis=0) > 0.8).all()
    assert max(found.points for found in maps) < len(points(0))


SKEWED_LINES: dict[str, Callable[[Array], Array]] = {  # J'' = -0.045 at the optimum 0
    "exponential": lambda u: 50.0 - 2.0 * (np.exp(0.15 * u) - 0.15 * u - 1.0),
    "cubic": lambda u: 50.0 - 0.0225 * u**2 - 0.0008 * u**3,
}


@pytest.mark.parametrize(("distinct", "repeats"), [(9, 8), (5, 8), (11, 4), (41, 1)])
@pytest.mark.parametrize("name", SKEWED_LINES)
def test_a_skewed_line_is_no_noise(name: str, distinct: int, repeats: int) -> None:
    j = SKEWED_LINES[name]
    theta = np.repeat(np.linspace(-20.0, 20.0, distinct), repeats)
    maps = [measure_map(theta, j(theta) + np.random.default_rng(k).normal(0.0, 0.3, theta.size)) for k in range(100)]
    assert np.mean(["lack_of_fit" in [finding.code for finding in found.findings] for found in maps]) > 0.95
    assert np.mean([found.noise_sd for found in maps]) == pytest.approx(0.3, rel=0.1 if repeats > 1 else 0.4)
    assert np.median([found.curvature for found in maps]) == pytest.approx(-0.045, rel=0.45)
    assert np.mean([abs(found.optimum) < 1.96 * found.optimum_stderr for found in maps]) > 0.9


@pytest.mark.parametrize("repeats", [1, 4])
def test_a_parabola_fits_at_the_rate_of_the_test(repeats: int) -> None:
    theta = np.repeat(np.linspace(-20.0, 20.0, 11), repeats)
    rng = np.random.default_rng(8)
    maps = [measure_map(theta, -0.0255 * theta**2 + rng.normal(0.0, NOISE, theta.size)) for _ in range(400)]
    assert np.mean([bool(found.findings) for found in maps]) < 0.025
    narrow = next((found for found in maps if found.findings), None)
    assert narrow is None or narrow.points < theta.size


def test_a_line_has_no_optimum_and_says_so() -> None:
    said = refused = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        theta = np.repeat(np.linspace(-10.0, 10.0, 7), 6)
        try:
            found = measure_map(theta, 0.3 * theta + rng.normal(0.0, 0.3, theta.size))
        except DataError:
            refused += 1
            continue
        codes = [finding.code for finding in found.findings]
        said += "no_bend" in codes
        assert ("beyond_range" in codes) == (abs(found.optimum) > 10.0)
    assert said + refused >= 38  # two standard errors
    assert 10 <= said <= 30  # as often as the noise bends it down

    rng = np.random.default_rng(1)
    several = {name: rng.uniform(-1.0, 1.0, 80) for name in ("x", "y")}
    j = 2.0 * several["x"] - 5.0 * several["y"] ** 2 - 0.01 * several["x"] ** 2 + rng.normal(0.0, 0.01, 80)
    found = measure_map(several, j)
    assert {(finding.code, finding.names) for finding in found.findings} >= {("beyond_range", ("x",))}
    assert "y" not in {name for finding in found.findings for name in finding.names}


def test_a_peak_off_which_no_parabola_can_be_read_is_refused() -> None:
    theta = np.repeat([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 3)
    noise = np.tile([-0.01, 0.0, 0.01], 6)
    with pytest.raises(DataError, match=r"bends up over theta in \[2, 5\], over the whole of it J is not a parabola"):
        measure_map(theta, np.repeat([0.0, 8.0, 9.0, 9.5, 9.6, 10.5], 3) + noise)


def bowl(x: Array, first: float, second: float, both: float = 0.0) -> Array:
    return first * x[:, 0] ** 2 + second * x[:, 1] ** 2 + both * x[:, 0] * x[:, 1]


CLOUD = np.random.default_rng(7).uniform(-1.0, 1.0, (30, 2))
LINE = np.outer(np.arange(9.0), [1.0, 2.0])
CROSS = np.array([[0, 0], [1, 0], [2, 0], [-1, 0], [0, 1], [0, 2], [0, -1], [0, 3]], dtype=float)


@pytest.mark.parametrize(
    ("theta", "j", "error", "message"),
    [
        (CLOUD, bowl(CLOUD, -1.0, 0.5), DataError, r"J bends up along a [+]0, b [+]0.985 [(]curvature 0.971"),
        (CLOUD, bowl(CLOUD, -1.0, -1.0, 6.0), DataError, r"J bends up along a [+]0.\d+, b [+]0.\d+ .*no maximum"),
        (CLOUD, bowl(CLOUD, -1.0, 0.01) + 0.02 * np.cos(np.arange(30.0)), DataError, "J is flat along a"),
        (LINE, -(LINE[:, 0] ** 2), DataError, r"lie on a line or plane, nothing varies along a"),
        (CROSS, bowl(CROSS, -1.0, -1.0), DataError, "do not show how a and b act together"),
        (CLOUD * [1.0, 0.0], bowl(CLOUD, -1.0, 0.0), DataError, "theta: b has one value only"),
        (CLOUD[:7], bowl(CLOUD[:7], -1.0, -1.0), DataError, "7 points at 7 distinct points of 2.*least 8 at 6"),
        (np.tile(CLOUD[:5], (3, 1)), np.zeros(15), DataError, "15 points at 5 distinct points"),
        (CLOUD, np.full(30, np.nan), DataError, "must be finite"),
        (CLOUD, np.zeros(29), ShapeError, r"theta has shape \(30, 2\), J \(29,\)"),
        ([0, 1, 2, 3], [0, 1, 1, 0], DataError, "4 points at 4 distinct inputs: must be at least 5 at 3"),
        ([0, 1, 0, 1, 0, 1], [0, 1, 0, 1, 0, 1], DataError, "6 points at 2 distinct inputs"),
        ([0, 1, 2, 3, 4], [4, 1, 0, 1, 4], DataError, "bends up over theta .*no maximum; widen"),
        ([0, 1, 2, 3, 4], [1e-9, 1, 2, 3, 4], DataError, "bends up|no maximum"),
        ([0, 1, 2, 3, np.nan], [4, 1, 0, 1, 4], DataError, "must be finite; leave misfired cycles out"),
        ([0, 1, 2, 3, 4], [4, 1, 0, 1, np.inf], DataError, "must be finite"),
        ([0, 1, 1 + 1e-15, 0, 1], [0, 1, 1, 0, 1], DataError, "do not show the curvature of theta; spread them"),
        ([0, 1, 2], [0, 1], ShapeError, r"theta has shape \(3,\), J \(2,\)"),
        ([[0, 1, 2]], [[0, 1, 2]], ShapeError, "in one dimension"),
    ],
)  # fmt: skip
def test_measurements_without_an_optimum_are_refused(theta: Any, j: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        measure_map({"a": theta[:, 0], "b": theta[:, 1]} if isinstance(theta, np.ndarray) else theta, j)


def test_columns_of_unlike_length_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"columns of shape .*a.*\(3,\).*must be columns of one length"):
        measure_map({"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0]}, [1.0, 2.0, 3.0])


def test_a_minimum_is_refused_as_a_maximum_and_taken_as_a_minimum() -> None:
    with pytest.raises(DataError, match="no minimum"):
        measure_map([-2, -1, 0, 1, 2], [-4, -1, 0, -1, -4], maximize=False)
    assert measure_map([-2, -1, 0, 1, 2], [4, 1, 0, 1, 4], maximize=False).curvature == pytest.approx(2.0)
