"""Two objectives: the front that is found beside one that is known in closed form, or from a steady map."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mgdd.errors import DataError, Interrupted, ParameterError
from mgdd.loop import Measurement, VirtualEngine, seek_front
from mgdd.loop.front_result import FrontResult, fit_of, undominated

TWO = {"soc_cad": (-20.0, 20.0), "egr": (0.0, 0.4)}
WAYS = {"efficiency": "max", "nox_ppm": "min"}
UNIT = np.array([1.0, 0.01])
BEST = np.array([-6.0, 0.15])  # of the efficiency
LEAST = np.array([8.0, 0.26])  # of NOx
NOISE = np.random.default_rng(0)
FIRST, SECOND = np.array([[0.06, 0.03], [0.03, 0.06]]), np.array([[4.0, -1.2], [-1.2, 2.4]])


def true(x: np.ndarray) -> np.ndarray:
    """Efficiency and NOx, quadratic with other axes each."""
    one, other = ((np.atleast_2d(x) - at) / UNIT for at in (BEST, LEAST))
    drop, rise = (0.5 * np.einsum("ij,jk,ik->i", d, bend, d) for d, bend in ((one, FIRST), (other, SECOND)))
    return np.stack([50.0 - drop, 300.0 + rise], axis=1)


def known_front(n: int = 500) -> np.ndarray:
    """Inputs at which a weighted sum is best, in closed form; both objectives are concave, so this is the front."""
    shares = 1.0 / (1.0 + 10.0 ** np.linspace(-4.0, 6.0, n))
    pairs = [(w * FIRST, (1.0 - w) * SECOND) for w in shares]
    return np.array([np.linalg.solve(a + b, a @ (BEST / UNIT) + b @ (LEAST / UNIT)) * UNIT for a, b in pairs])


def engine(noise: float = 1.0, seed: int = 1) -> Callable[[dict[str, float]], dict[str, float]]:
    rng = np.random.default_rng(seed)

    def measured(x: dict[str, float]) -> dict[str, float]:
        read = true(np.array([x["soc_cad"], x["egr"]]))[0] + noise * np.array([0.3, 15.0]) * rng.standard_normal(2)
        return {"nox_ppm": read[1], "efficiency": read[0], "p_max_bar": 100.0 - 2.0 * x["soc_cad"]}

    return measured


def away(front: np.ndarray, known: np.ndarray) -> np.ndarray:
    """How far each row is from the nearest of a front, in shares of its ranges."""
    span = np.ptp(known, axis=0)
    return np.min(np.linalg.norm((front[:, None] - known[None]) / span, axis=2), axis=1)


def codes(front: FrontResult) -> list[str]:
    return [finding.code for finding in front.findings]


def test_undominated_rows_are_those_of_the_definition() -> None:
    rng = np.random.default_rng(5)
    values = np.round(rng.standard_normal((300, 2)), 1)
    values = np.unique(values, axis=0)
    rng.shuffle(values)
    slow = [not any(np.all(o >= v) and np.any(o > v) for o in values) for v in values]
    assert undominated(values).tolist() == slow
    assert 3 < sum(slow) < 40


def test_few_readings_get_no_high_degree() -> None:
    degrees = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        columns = {name: rng.uniform(*bounds, 19) for name, bounds in TWO.items()}
        fit = fit_of(columns, columns["egr"] + rng.normal(0.0, 0.3, 19))
        degrees.append(max(term.count("^3") + term.count("^4") for term in fit.model.terms))
    assert degrees == [0] * 12


@pytest.mark.parametrize("seed", range(3))
def test_the_front_of_two_quadratics_is_found(seed: int) -> None:
    start = {"soc_cad": 10.0, "egr": 0.1}
    front = seek_front(engine(seed=seed), TWO, WAYS, start=start, cycles=120, seed=seed)
    data = front.dataset
    found, known = true(data["inputs"].to_numpy()), true(known_front())
    assert np.median(away(found, known)) < 0.02
    assert away(found, known).max() < 0.12  # at the ends, where J is flat along the front
    assert away(known, found).max() < 0.15  # from end to end
    assert undominated(found * [1.0, -1.0]).mean() > 0.7
    sure = np.abs(data["objectives"].to_numpy() - found) < 3.5 * data["objectives_sd"].to_numpy()
    assert sure.mean() > 0.9
    assert np.all(np.diff(data["objectives"].sel(objective="efficiency")) < 0.0)
    assert np.all(np.diff(data["objectives"].sel(objective="nox_ppm")) < 0.0)
    assert data.sizes["point"] == 21
    assert codes(front) == []
    assert set(np.unique(data["weight"])) == {0.0, 0.25, 0.5, 0.75, 1.0}
    applied = data["applied"].to_numpy()
    assert np.median(away(true(applied[36:]), known)) < 0.1


def test_a_front_of_the_bench_is_that_of_its_steady_map() -> None:
    bench = VirtualEngine(seed=3)
    ways = {"efficiency_gross": "max", "nox_soft_ppm": "min"}
    front = seek_front(bench, {"soc_cad": (-25.0, 5.0)}, ways, start=-18.0, cycles=100, n_weights=4, n_points=9)
    assert bench.cycle == 100
    at = np.linspace(-25.0, 5.0, 601)
    steady = bench.steady_map(at)
    table = np.stack([steady["efficiency_gross"].to_numpy(), -steady["nox_soft_ppm"].to_numpy()], axis=1)
    best = at[undominated(table)]
    assert best[0] == pytest.approx(-5.6, abs=0.1)
    found = front.dataset["inputs"].sel(input="soc_cad").to_numpy()
    assert found.size == 9
    assert found[0] == pytest.approx(best[0], abs=1.0)
    assert found[-1] == pytest.approx(best[-1], abs=0.5)
    predicted = front.dataset["objectives"].to_numpy()
    exact = np.stack([np.interp(found, at, column) for column in table.T], axis=1) * [1.0, -1.0]
    assert np.max(np.abs(predicted - exact) / np.ptp(exact, axis=0)) < 0.08


@pytest.mark.parametrize("seed", range(3))
def test_a_front_bent_inwards_is_found_between_its_ends(seed: int) -> None:
    """No weighted sum is best there: the seekers stay at the ends, and the models say what lies between."""
    rng = np.random.default_rng(seed)

    def plant(x: dict[str, float]) -> dict[str, float]:
        first, second = x["share"], (1.0 - x["share"]) ** 3
        return dict(zip(("first", "second"), (rng.normal([first, second], 0.02)).tolist(), strict=True))

    front = seek_front(plant, {"share": (0.0, 1.0)}, {"first": "max", "second": "max"}, cycles=100, seed=seed)
    at = front.dataset["inputs"].to_numpy()[:, 0]
    assert np.abs(front.dataset["objectives"].sel(objective="second") - (1.0 - at) ** 3).max() < 0.06
    assert np.sum((at > 0.1) & (at < 0.9)) >= 8


def test_minimising_what_is_negated_is_the_same_search() -> None:
    plain = engine(seed=4)
    one = seek_front(plain, TWO, WAYS, cycles=60)
    again = engine(seed=4)
    negated: Any = lambda x: {name: -value for name, value in again(x).items()}  # noqa: E731
    other = seek_front(negated, TWO, {"efficiency": "min", "nox_ppm": "max"}, cycles=60)
    np.testing.assert_allclose(other.dataset["applied"], one.dataset["applied"], rtol=1e-12)
    np.testing.assert_allclose(other.dataset["objectives"], -one.dataset["objectives"], rtol=1e-6)


def test_a_limit_cuts_the_front() -> None:
    held = seek_front(engine(), TWO, WAYS, limits={"p_max_bar": 100.0}, start={"soc_cad": 8.0, "egr": 0.2}, cycles=120)
    found = held.dataset["inputs"].sel(input="soc_cad").to_numpy()
    assert found.min() > -0.3  # without it -6
    assert found.min() == pytest.approx(0.0, abs=1.0)
    assert np.all(held.dataset["limits"].sel(limit="p_max_bar") <= 100.0)
    applied = held.dataset["applied"].sel(input="soc_cad").to_numpy()
    assert np.mean(100.0 - 2.0 * applied > 101.0) < 0.03
    over = seek_front(engine(), TWO, WAYS, limits={"p_max_bar": 100.0}, start={"soc_cad": -6.0, "egr": 0.2}, cycles=100)
    assert over.dataset["applied"].sel(input="soc_cad").min() == -6.0
    assert over.dataset["inputs"].sel(input="soc_cad").min() > -0.3
    broken = seek_front(engine(), TWO, WAYS, limits={"p_max_bar": 30.0}, cycles=60)
    assert "above_limit" in codes(broken)


def test_a_delay_is_taken_off() -> None:
    exact, path = engine(seed=2), list[dict[str, float]]()

    def late(x: dict[str, float]) -> dict[str, float]:
        path.append(x)
        return exact(path[max(len(path) - 6, 0)])

    front = seek_front(late, TWO, WAYS, start={"soc_cad": 10.0, "egr": 0.1}, cycles=150, delay_cycles=5)
    assert away(true(front.dataset["inputs"].to_numpy()), true(known_front())).max() < 0.1
    assert np.median(away(true(front.dataset["applied"].to_numpy()[45:]), true(known_front()))) < 0.02


def test_failed_cycles_are_left_out() -> None:
    calls, exact = 0, engine()

    def plant(x: dict[str, float]) -> Any:
        nonlocal calls
        calls += 1
        return None if calls % 7 == 0 else exact(x)

    front = seek_front(plant, TWO, WAYS, cycles=120)
    assert front.dataset["void"].to_numpy().sum() == 17
    assert away(true(front.dataset["inputs"].to_numpy()), true(known_front())).max() < 0.1


def at_random(_: Any) -> dict[str, float]:
    return dict(zip(WAYS, NOISE.standard_normal(2).tolist(), strict=True))


@pytest.mark.parametrize(
    ("code", "plant", "settings"),
    [
        ("few_cycles", engine(), {"cycles": 12}),  # the least, fewer than terms of the fourth degree
        (
            "one_best",
            lambda x: {
                "efficiency": -((x["soc_cad"] - 2.0) ** 2),
                "nox_ppm": 3.0 * (x["soc_cad"] - 2.0) ** 2 + x["egr"],
            },
            {"cycles": 120},
        ),
        ("uncertain", engine(20.0), {"cycles": 60}),
        (
            "poor_prediction",
            at_random,
            {"cycles": 60},
        ),
    ],
)
def test_a_doubtful_front_is_doubted_aloud(code: str, plant: Any, settings: dict[str, Any]) -> None:
    front = seek_front(plant, TWO, WAYS, **settings)
    assert code in codes(front)
    doubted = next(finding for finding in front.findings if finding.code == code)
    assert doubted.text in front.dataset.attrs["findings"]
    assert doubted.text[:20] in front.summary()


class Rig:
    """A plant of two inputs that counts its cycles."""

    input_names, limit_names = ("egr", "soc_cad"), ("p_max_bar",)

    def __init__(self, fails_at: int = 10**9, error: type[BaseException] = OSError) -> None:
        self.cycles, self.fails_at, self.error, self.engine = 0, fails_at, error, engine()

    def apply(self, inputs: dict[str, float]) -> None:
        self.inputs = inputs

    def measure(self) -> Measurement:
        if self.cycles == self.fails_at:
            raise self.error("the bus is gone")
        self.cycles += 1
        values = self.engine(self.inputs)
        return Measurement(values=values, limits={"p_max_bar": values["p_max_bar"]})


@pytest.mark.parametrize(
    ("ways", "settings", "message"),
    [
        ({"efficiency": "max"}, {}, "objectives = .*: must name two"),
        (("efficiency", "nox_ppm"), {}, "objectives = .*: must name two"),
        ({"efficiency": "max", "nox_ppm": "less"}, {}, "nox_ppm = 'less': must be 'max' or 'min'"),
        (WAYS, {"cycles": 11}, "cycles = 11: must be a whole number >= 12"),
        (WAYS, {"cycles": 16, "delay_cycles": 5}, "cycles = 16: must be a whole number >= 17"),
        (WAYS, {"delay_cycles": 1.5}, "delay_cycles = 1.5: must be a whole number"),
        (WAYS, {"n_weights": 2}, "n_weights = 2: must be a whole number >= 3 and <= 20"),
        (WAYS, {"n_points": 1}, "n_points = 1: must be"),
        (WAYS, {"start": {"soc_cad": 30.0, "egr": 0.1}}, "soc_cad = 30: must be in"),
        (WAYS, {"limits": {"p_max": 90.0}}, "'p_max' is not measured by the plant"),
    ],
)
def test_a_refused_call_moves_nothing(ways: Any, settings: dict[str, Any], message: str) -> None:
    rig = Rig()
    with pytest.raises(ParameterError, match=message):
        seek_front(rig, TWO, ways, **settings)
    assert rig.cycles == 0


def test_what_a_plant_or_a_function_does_not_measure_is_named() -> None:
    with pytest.raises(DataError, match=r"objectives: 'soot' is not measured by the plant at .*it measures nox_ppm"):
        seek_front(Rig(), TWO, {"efficiency": "max", "soot": "min"})
    with pytest.raises(DataError, match=r"function gave .* at soc_cad = .*: must map efficiency, soot to numbers"):
        seek_front(engine(), TWO, {"efficiency": "max", "soot": "min"})
    with pytest.raises(DataError, match="nox_ppm = nan at soc_cad"):
        seek_front(lambda _: {"efficiency": 1.0, "nox_ppm": math.nan}, TWO, WAYS)
    with pytest.raises(ParameterError, match="must be a Plant, as VirtualEngine"):
        seek_front(3.0, TWO, WAYS)  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_what_was_found_is_kept(error: type[BaseException]) -> None:
    with pytest.raises(Interrupted if error is KeyboardInterrupt else error) as info:
        seek_front(Rig(60, error), TWO, WAYS, cycles=120)
    part = info.value.partial  # type: ignore[attr-defined]
    assert isinstance(part, FrontResult)
    assert part.dataset.sizes["cycle"] == 60
    assert ("interrupted" in codes(part)) == (error is KeyboardInterrupt)
    with pytest.raises(Interrupted if error is KeyboardInterrupt else error) as info:
        seek_front(Rig(2, error), TWO, WAYS)
    assert getattr(info.value, "partial", None) is None
