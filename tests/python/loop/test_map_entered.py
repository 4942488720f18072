"""No cell of a map is left alone for ever: engines of a few lines, without a guide."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from mgdd.errors import ParameterError
from mgdd.loop import VirtualEngine, seek_map
from mgdd.maps import CalibrationMap
from mgdd.optimize import MapSeeking

SOC = {"soc": (-20.0, 10.0)}
SPEEDS = {"rpm": [1000, 2000, 3000]}


def noisy(values: Callable[[Mapping[str, float]], Any], seed: int, noise: float = 0.1) -> Callable[..., Any]:
    """Add noise to J and, five times as much, to the limits of an engine."""
    draw = np.random.default_rng(seed)

    def engine(x: Mapping[str, float]) -> Any:
        found = values(x)
        if not isinstance(found, tuple):
            return None if found is None else found + noise * draw.standard_normal()
        j, limits = found
        return j + noise * draw.standard_normal(), {
            name: value + 5.0 * noise * draw.standard_normal() for name, value in limits.items()
        }

    return engine


def visits_of(found: Any, axis: str) -> Counter[float]:
    return Counter(visit.at[axis] for visit in found.visits)


@pytest.mark.parametrize("seed", range(3))
def test_a_window_between_two_limits_is_entered_in_every_cell(seed: int) -> None:
    def engine(x: Mapping[str, float]) -> Any:
        j = 40.0 - 0.05 * (x["soc"] + 2.0 + 0.003 * (x["rpm"] - 1000.0)) ** 2
        return j, {"p": 100.0 - 3.0 * x["soc"], "t": 500.0 + 5.0 * x["soc"]}

    limits = {"p": 112.0, "t": 520.0}
    found = seek_map(noisy(engine, seed), SOC, SPEEDS, limits=limits, start={"soc": 0.0}, visits=40, seed=seed)
    assert min(visits_of(found, "rpm")[rpm] for rpm in SPEEDS["rpm"]) >= 3
    np.testing.assert_allclose(found.map.values[1:], -3.95, atol=0.4)  # as p allows; true best -5 and -8
    assert max(visit.limits["p"] for visit in found.visits) < 115.0
    assert max(visit.limits["t"] for visit in found.visits) < 521.0


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_whose_first_reading_breaks_a_limit_is_entered_on_the_safe_side(seed: int) -> None:
    def engine(x: Mapping[str, float]) -> Any:
        return 45.0 - 0.04 * (x["soc"] + 3.0) ** 2, {"p": 60.0 + 3.0 * (x["fuel"] - 10.0) - 3.0 * x["soc"]}

    found = seek_map(
        noisy(engine, 50 + seed), SOC, {"fuel": [10, 30]}, limits={"p": 112.0}, start={"soc": 0.0}, visits=30, seed=seed
    )
    assert next(visit for visit in found.visits if visit.at["fuel"] == 30).limits["p"] > 118.0
    np.testing.assert_allclose(found.map.values, [-3.0, 2.8], atol=0.6)
    assert sum(visit.limits["p"] > 114.0 for visit in found.visits) == 1


@pytest.mark.parametrize("first", [1000, 2000])
def test_a_chance_misfire_at_the_first_visit_of_a_cell_does_not_close_it(first: int) -> None:
    seen: Counter[float] = Counter()

    def engine(x: Mapping[str, float]) -> Any:
        seen[x["rpm"]] += 1
        if x["rpm"] == first and seen[first] == 1:
            return None
        return 40.0 - 0.05 * (x["soc"] + 2.0 + 0.003 * (x["rpm"] - 1000.0)) ** 2

    found = seek_map(noisy(engine, 1), SOC, SPEEDS, start={"soc": -3.0}, visits=30)
    np.testing.assert_allclose(found.map.values, [-2.0, -5.0, -8.0], atol=0.3)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_unlike_the_others_is_read_though_it_seems_known(seed: int) -> None:
    def engine(x: Mapping[str, float]) -> float:
        return 40.0 - 0.05 * (x["soc"] - (-6.0 if x["rpm"] == 2000 else -2.0)) ** 2

    found = seek_map(noisy(engine, seed), SOC, SPEEDS, start={"soc": -3.0}, visits=40, seed=seed)
    np.testing.assert_allclose(found.map.values, [-2.0, -6.0, -2.0], atol=0.6)


def test_what_is_known_to_rounding_has_no_regret() -> None:
    found = seek_map(
        lambda x: 40.0 - 0.05 * (x["soc"] + 2.0 + 0.003 * (x["rpm"] - 1000.0)) ** 2, SOC, SPEEDS, visits=50
    )
    assert (found.cells["regret"] < 1e-3).all()
    assert (found.cells["soc_sd"] < 0.1).all()
    np.testing.assert_allclose(found.map.values, [-2.0, -5.0, -8.0], atol=0.02)


def test_a_limit_that_is_kept_nowhere_leaves_the_input_that_breaks_it_least() -> None:
    def engine(x: Mapping[str, float]) -> Any:
        return 40.0 - 0.05 * (x["soc"] + 2.0) ** 2, {"p": 100.0 - 3.0 * x["soc"]}

    found = seek_map(noisy(engine, 0), SOC, SPEEDS, limits={"p": 60.0}, start={"soc": -3.0}, visits=40)
    assert (found.map.values > 9.0).all()
    assert [finding.code for finding in found.findings][:1] == ["no_safe_input"]


def test_a_map_is_no_model_and_a_search_that_goes_on_heeds_its_own_terms() -> None:
    def engine(x: Mapping[str, float]) -> float:
        return -((x["soc"] + 3.0) ** 2)

    found = seek_map(engine, SOC, SPEEDS, visits=6)
    with pytest.raises(ParameterError, match="this map says where the best input lies"):
        seek_map(engine, SOC, SPEEDS, visits=6, guide=found.map)
    surface = CalibrationMap(
        {"rpm": [1000.0, 3000.0], "soc": [-20.0, -3.0, 10.0]}, [[-289.0, 0.0, -169.0]] * 2, name="efficiency_percent"
    )
    assert seek_map(engine, SOC, SPEEDS, visits=6, guide=surface).seeker.trust > 0.5  # over the input it is J
    for name, value in (("limits", {"p": 1.0}), ("guide", engine), ("start", {"soc": 0.0}), ("settings", {"kept": 50})):
        with pytest.raises(ParameterError, match=f"{name} .*left out beside seeker"):
            seek_map(engine, SOC, SPEEDS, visits=8, seeker=found, **{name: value})
    for axes in ({"rpm": ["a", "b"]}, {"rpm": [[1.0, 2.0], [3.0, 4.0]]}, {"rpm": [5.0]}):
        with pytest.raises(ParameterError, match=r"axes of rpm .*two entries at least"):
            seek_map(engine, SOC, axes, visits=6)
    with pytest.raises(ParameterError, match="seeker = 3: must be a MapSearch"):
        seek_map(engine, SOC, SPEEDS, visits=6, seeker=3)
    with pytest.raises(ParameterError, match=r"context .*left out: the axes are"):
        MapSeeking(SOC, SPEEDS, context=[])
    with pytest.raises(ParameterError, match=r"inputs .*those of the seeker"):
        seek_map(engine, {"soc": (-20.0, 5.0)}, SPEEDS, visits=8, seeker=found)
    with pytest.raises(ParameterError, match=r"axes .*those of the seeker"):
        seek_map(engine, SOC, {"rpm": [1000, 2000]}, visits=8, seeker=found)
    assert len(seek_map(engine, SOC, SPEEDS, visits=8, seeker=found).visits) == 8


@pytest.mark.parametrize(
    ("inputs", "axes", "limits", "text"),
    [
        (SOC, {"j": [0.0, 1.0]}, (), "axes: name = 'j': must be another one: a number of every cell"),
        ({"regret": (0.0, 1.0)}, SPEEDS, (), "inputs: name = 'regret'"),
        (SOC, {"soc_sd": [0.0, 1.0]}, (), "axes: name = 'soc_sd'"),
        (SOC, SPEEDS, {"rpm": 1.0}, "limits: name = 'rpm': must be another one: an axis or an input"),
        (SOC, SPEEDS, {"soc": 1.0}, "limits: name = 'soc'"),
        (SOC, SPEEDS, {"j_sd": 1.0}, "limits: name = 'j_sd'"),
    ],
)
def test_a_name_that_the_map_has_is_refused(inputs: Any, axes: Any, limits: Any, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        MapSeeking(inputs, axes, limits=limits)


def test_a_search_without_a_start_begins_where_the_limits_hold_and_one_above_them_says_so() -> None:
    axes, limits = {"speed_rpm": [1000, 2000], "fuel_mg": [12, 24]}, {"p_max_bar": 110.0, "dp_max_bar_per_cad": 5.0}
    found, early = (
        seek_map(VirtualEngine("puma_single", seed=4), {"soc_cad": (-30.0, 10.0)}, axes, limits=limits, start=start,
                 visits=12)
        for start in (None, {"soc_cad": -14.0})
    )  # fmt: skip
    assert found.visits[0].inputs["soc_cad"] == 10.0
    assert all(visit.limits[name] <= 1.01 * most for visit in found.visits for name, most in limits.items())
    assert "start_above_limit" not in [finding.code for finding in found.findings]
    (told,) = (
        finding for finding in early.findings if finding.code == "start_above_limit" and finding.names == ("p_max_bar",)
    )
    assert "the first reading of p_max_bar, 1" in str(told)
    assert "above its limit, 110" in str(told)
    lower = seek_map(
        lambda x: (-(x["x"] ** 2), {"y": x["x"]}), {"x": (-1.0, 1.0)}, {"rpm": [1.0, 2.0]}, visits=4,
        start={"x": 0.1}, limits={"y": (0.2, None)},
    )  # fmt: skip
    assert any(
        str(one).startswith("the first reading of y, 0.1, is below its lower limit, 0.2;") for one in lower.findings
    )
    rough = seek_map(
        lambda x: (x["x"], {"y": 2.0 + x["x"]}), {"x": (-1.0, 1.0)}, {"rpm": [1.0, 2.0]}, visits=2,
        limits={"y": 2.5}, guide=lambda x: x["x"], limit_guides={"y": lambda x: 1.0 + x["x"]},
    )  # fmt: skip
    (above,) = (one for one in rough.findings if one.code == "start_above_limit")
    assert "the guide says too little of it there" in above.remedy  # a guide leaves no start to give
