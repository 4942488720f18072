"""One call of `seek`: which seeker it takes, what it returns, what it doubts, and what it refuses."""

import copy
import math
import pickle
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, Performance
from mgdd.errors import DataError, Error, Interrupted, ParameterError, ShapeError
from mgdd.guide import Curve, TimingMap
from mgdd.loop import EngineGuide, Measurement, VirtualEngine, run_seeker, seek
from mgdd.loop.seek_result import SeekResult
from mgdd.maps import CalibrationMap
from mgdd.optimize import GaussianProcessSeeking, Input

TWO = {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}
ONE = {"soc_cad": (-25.0, 15.0)}
BEST = {"soc_cad": -4.0, "egr": 0.15}


def engine(noise: float = 0.3, seed: int = 1, best: dict[str, float] = BEST) -> Callable[[dict[str, float]], float]:
    """Efficiency with a coupling of its inputs; what it does not take is held at its best."""
    rng = np.random.default_rng(seed)

    def measured(x: dict[str, float]) -> float:
        timing, egr = x["soc_cad"] - best["soc_cad"], x.get("egr", best["egr"]) - best["egr"]
        return 56.0 - 0.03 * timing**2 - 300.0 * egr**2 - 1.5 * timing * egr + noise * rng.standard_normal()

    return measured


def limited(x: dict[str, float]) -> tuple[float, dict[str, float]]:
    return engine(0.0)(x), {"p_max_bar": 100.0 - 2.0 * x["soc_cad"] - 20.0 * x.get("egr", 0.15)}


def codes(found: SeekResult) -> list[str]:
    return [finding.code for finding in found.findings]


@pytest.mark.parametrize(
    ("inputs", "settings", "kind", "said"),
    [
        (ONE, {}, "CurveSeeking", "a parabola serves as the guide"),
        (ONE, {"guide": Curve.parabola(curvature=-0.05, best=2.0, reach=60.0)}, "CurveSeeking", "curve of a guide"),
        (ONE, {"delay_cycles": 3}, "CurveSeeking", "one input"),
        (TWO, {}, "GaussianProcessSeeking", "2 inputs"),
        (TWO, {"lag_cycles": 2.0}, "GaussianProcessSeeking", "2 inputs"),
        (
            TWO,
            {"guide": lambda x: -((x["soc_cad"] + 6.0) ** 2) / 40.0},
            "GaussianProcessSeeking",
            "2 inputs and a guide",
        ),
    ],
)
def test_the_choice_and_its_reason(inputs: Any, settings: dict[str, Any], kind: str, said: str) -> None:
    found = seek(engine(), inputs, **{"cycles": 60, **settings})
    assert found.seeker.kind == kind
    assert said in found.reason
    assert found.summary().startswith(f"{kind}: {found.reason}")


@pytest.mark.parametrize("inputs", [ONE, TWO])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_finds_the_best_inputs_and_says_how_well(inputs: Any, sign: float) -> None:
    start = {"soc_cad": 6.0, "egr": 0.28}
    start = {name: start[name] for name in inputs}
    covered = []
    for seed in range(6):
        measured = engine(seed=seed)
        found = seek(lambda x, f=measured: sign * f(x), inputs, start=start, cycles=150, maximize=sign > 0.0, seed=seed)
        exact = engine(0.0)
        assert exact(BEST) - exact(found.inputs) < 0.15
        assert found.start == start
        assert found.gain == pytest.approx(exact(BEST) - exact(start), abs=1.5)
        assert found.gain_sd == pytest.approx(0.3, rel=0.4)
        covered.append(abs(sign * found.value - exact(found.inputs)) < 4.0 * found.value_sd)
        assert found.run.dataset.sizes["cycle"] == 150
    assert sum(covered) >= 5


def test_the_same_seed_gives_the_same_run() -> None:
    first, again = (seek(engine(), TWO, cycles=40, seed=5) for _ in range(2))
    assert first.inputs == again.inputs


def test_a_bench_is_a_plant_and_limits_are_kept() -> None:
    bench = VirtualEngine(seed=4, limits=["dp_max_bar_per_cad", "p_max_bar"])
    found = seek(bench, {"soc_cad": (-25.0, 10.0)}, start=2.0, limits={"p_max_bar": 95.0}, cycles=300)
    assert bench.cycle == 300
    best = bench.find_optimum({"p_max_bar": 95.0})
    assert found.inputs["soc_cad"] == pytest.approx(best["soc_cad"], abs=1.0)
    assert list(found.limits) == ["p_max_bar"]
    assert 91.0 < found.limits["p_max_bar"] < 96.0
    assert "limit_broken" not in codes(found)


SIDES: dict[str, tuple[Any, float, float]] = {  # limit, its slope over the timing, where it is safest
    "p_max_bar": (95.0, -3.0, 10.0), "nox_ppm": (95.0, -3.0, 10.0), "t_evo_k": (55.0, 3.0, -30.0),
    "ca50_cad": ((95.0, None), 3.0, 10.0),
}  # fmt: skip


@pytest.mark.parametrize("name", SIDES)
def test_without_a_start_a_search_begins_where_engines_keep_the_limit(name: str) -> None:
    bound, slope, first = SIDES[name]
    side = -1.0 if isinstance(bound, tuple) else 1.0
    upper = -95.0 if side < 0.0 else bound
    for seed in range(4):
        rng = np.random.default_rng(seed)

        def plant(x: float, rng: Any = rng) -> Any:
            return 56.0 - 0.03 * (x + 6.0) ** 2 + 0.25 * rng.normal(), {name: 85.0 + slope * x + rng.normal()}

        found = seek(plant, {"soc_cad": (-30.0, 10.0)}, limits={name: bound}, cycles=100, seed=seed)
        applied = found.dataset["applied"].to_numpy()[:, 0]
        assert (applied[0], found.start["soc_cad"]) == (first, first)
        assert (side * (85.0 + slope * applied) > upper + 1.0).mean() <= 0.01
        away = (found.inputs["soc_cad"] - (bound if side > 0.0 else 95.0) / slope + 85.0 / slope) * slope * side
        assert -4.5 < away < 0.5
        assert "start_unknown" not in codes(found)


def test_of_a_quantity_kept_between_two_values_the_upper_one_says_where_to_begin() -> None:
    bench = VirtualEngine(seed=1, limits=["p_max_bar"])
    found = seek(bench, {"soc_cad": (-30.0, 10.0)}, limits={"p_max_bar": (60.0, 95.0)}, cycles=40)
    assert found.start["soc_cad"] == 10.0
    assert float(found.dataset["noise_free_limits"].sel(limit="p_max_bar").max()) < 96.0
    assert "start_above_limit" not in codes(found)


def test_a_limit_that_bends_is_read_before_it_is_reached() -> None:
    """Late, the pressure is that of compression, and flat; a stride that it allows there ends far above the limit."""
    for seed in range(4):
        bench = VirtualEngine(seed=seed, limits=["p_max_bar"])
        found = seek(bench, {"soc_cad": (-30.0, 10.0)}, limits={"p_max_bar": 95.0}, cycles=40, seed=seed)
        assert 90.0 < float(found.dataset["noise_free_limits"].max()) < 96.0


def test_limits_of_the_engine_alone_are_measured_and_not_kept() -> None:
    """Values given to the engine do not limit a search, and those of the search count where both have some."""
    early, capped = {"soc_cad": (-30.0, 10.0)}, {"p_max_bar": 95.0}
    alone = seek(VirtualEngine(seed=1, limits=capped), early, cycles=40)
    assert "limit_not_kept" in codes(alone)
    both = seek(VirtualEngine(seed=1, limits={"p_max_bar": 300.0}), early, limits=capped, cycles=40)
    assert "limit_not_kept" not in codes(both)
    assert both.limits["p_max_bar"] < 96.0 < float(alone.dataset["limits"][-1, 0])


def test_a_guide_that_is_the_model_of_the_plant_is_a_finding() -> None:
    for wall_heat, own in ((0.5, True), (1.0, False)):
        guide = EngineGuide(cylinder=Cylinder(wall_heat_scale=wall_heat))
        assert ("own_model" in codes(seek(VirtualEngine(), ONE, guide=guide, cycles=12))) is own


@pytest.mark.parametrize(
    ("performance", "name"),
    [(None, "efficiency"), (Performance.efficiency_and_nox(0.004), "efficiency_percent -0.004 nox_ppm")],
)
def test_j_has_the_name_and_the_unit_of_the_objective(performance: Performance | None, name: str) -> None:
    found = seek(VirtualEngine(performance=performance), ONE, cycles=12)
    assert re.search(rf"\n +{name} [\d.]+ ± [\d.]+ %\n +gain", found.summary())
    assert found.dataset["gain"].attrs == {"units": "percent", "long_name": f"gain of {name} over the start"}
    assert [panel.get_ylabel().replace("\n−", " -") for panel in found.plot().figure.axes][1] == f"{name} [%]"


def test_a_start_that_nobody_knows_to_be_safe_is_a_finding() -> None:
    def bowl(x: float) -> Any:
        return -((x - 3.0) ** 2), {"noise_db": 10.0 * x}

    for more, said in (({}, True), ({"start": 1.0}, False)):
        found = seek(bowl, {"x": (0.0, 10.0)}, limits={"noise_db": 20.0}, cycles=20, **more)
        assert ("start_unknown" in codes(found)) is said
    again = seek(bowl, seeker=found.seeker, cycles=20)
    known = seek(bowl, {"x": (0.0, 10.0)}, limits={"noise_db": 20.0}, cycles=20, known=found.dataset)
    assert "start_unknown" not in {*codes(again), *codes(known)}


def test_a_late_sensor_is_compensated() -> None:
    best, late = {"soc_cad": -6.0, "egr": 0.1}, 6
    path: list[dict[str, float]] = []
    exact = engine(0.1, best=best)

    def behind(x: dict[str, float]) -> float:
        path.append(x)
        return exact(path[max(len(path) - 1 - late, 0)])

    found = seek(behind, TWO, start={"soc_cad": 6.0, "egr": 0.28}, cycles=200, delay_cycles=late)
    assert engine(0.0, best=best)(best) - engine(0.0, best=best)(found.inputs) < 0.2
    assert "no_gain" not in codes(found)


class Drifting:
    """An engine whose best timing becomes later from cycle to cycle."""

    def __init__(self, rate: float) -> None:
        self.rate, self.cycles = rate, 0

    def __call__(self, x: dict[str, float]) -> float:
        self.cycles += 1
        return engine(0.1, seed=self.cycles, best={"soc_cad": -15.0 + self.rate * self.cycles, "egr": 0.15})(x)


@pytest.mark.parametrize(
    ("code", "settings", "plant"),
    [
        ("few_cycles", {"cycles": 12}, engine()),
        ("not_settled", {"cycles": 100}, Drifting(0.4)),
        ("at_bound", {"cycles": 80}, engine(best={"soc_cad": -40.0, "egr": 0.15})),
        ("no_gain", {"cycles": 60, "start": BEST}, engine()),
        ("no_reading", {"cycles": 20}, lambda _: None),
        ("failing_everywhere", {"cycles": 20}, lambda _: None),
        ("unexplained", {"cycles": 100}, Drifting(0.25)),
        ("start_above_limit", {"cycles": 40, "limits": {"p_max_bar": 80.0}, "start": BEST}, limited),
        ("limit_broken", {"cycles": 40, "limits": {"p_max_bar": 50.0}}, limited),
    ],
)
def test_a_doubtful_result_is_doubted_aloud(code: str, settings: dict[str, Any], plant: Any) -> None:
    found = seek(plant, TWO, **settings)
    assert code in codes(found)
    doubted = next(finding for finding in found.findings if finding.code == code)
    assert str(doubted) in found.to_dict()["findings"][codes(found).index(code)]["text"] + "; " + doubted.remedy
    assert doubted.text[:30] in found._repr_html_()
    assert doubted.text in found.dataset.attrs["findings"]


def moving(seeker: str, seed: int, velocity: float = 0.0, jump: float = 0.0, top: float = 5.0) -> list[str]:
    """Give what is said of a moving best by a search of -0.03 (u - best)^2 on bounds of 40, noise 0.3."""
    noise, cycle = np.random.default_rng(seed), iter(range(240))

    def plant(x: dict[str, float]) -> float:
        k = next(cycle)
        best = top - 120.0 * velocity + velocity * k + (jump if k >= 130 else 0.0)
        return float(-0.03 * (x["u"] - best) ** 2 + 0.3 * noise.normal())

    found = seek(plant, {"u": (-20.0, 20.0)}, seeker=seeker, cycles=240, start={"u": -10.0})
    return [each.text for each in found.findings if each.code == "moving"]


@pytest.mark.parametrize("seeker", ["curve_seeking", "spsa", "gradient_descent"])
def test_a_best_that_moves_all_the_time_is_said_with_its_velocity(seeker: str) -> None:
    for velocity in (0.06, -0.06):
        said = [text for seed in range(4) for text in moving(seeker, seed, velocity)]
        assert len(said) >= 2
        speeds = [float(text.split("by ")[1].split(" ±")[0]) for text in said]
        assert np.median(speeds) == pytest.approx(100.0 * velocity, rel=0.5)
    still = [moving(seeker, 0), moving(seeker, 1, top=14.0), moving(seeker, 2, jump=6.0), moving(seeker, 3, jump=-6.0)]
    assert still == [[]] * 4


def test_a_good_result_is_not_doubted() -> None:
    doubted = [seek(engine(seed=s), TWO, start={"soc_cad": 8.0, "egr": 0.3}, seed=s).findings for s in range(8)]
    assert sum(not each for each in doubted) >= 7


def test_a_curve_that_does_not_fit_is_doubted() -> None:
    guide = Curve.parabola(curvature=-0.05, best=2.0, reach=60.0)
    spike = lambda x: -2.0 * abs(math.tanh(3.0 * (x + 6.0))) - 0.3 * abs(x + 6.0)  # noqa: E731
    assert {"untrusted_guide", "handed_over"} & set(codes(seek(lambda x: spike(x["soc_cad"]), ONE, guide=guide)))
    assert "frozen" in codes(seek(lambda _: 0.0, ONE, guide=guide))
    of_no_use = lambda x: math.sin(0.4 * x["soc_cad"]) + math.sin(40.0 * x["egr"])  # noqa: E731
    moved = lambda x: 0.6 * engine(0.0)({"soc_cad": x["soc_cad"] + 5.0, "egr": x["egr"] + 0.05})  # noqa: E731
    start = {"soc_cad": 8.0, "egr": 0.3}
    for seed in range(4):
        searched = [codes(seek(engine(seed=seed), TWO, start=start, guide=g, cycles=60)) for g in (of_no_use, moved)]
        assert ["untrusted_guide" in each for each in searched] == [True, False], seed
    path: list[float] = []

    def late(x: dict[str, float]) -> float:
        path.append(x["soc_cad"])
        return engine(0.05)({"soc_cad": path[max(len(path) - 5, 0)]})

    assert "delay" in codes(seek(late, ONE, guide=guide, delay_cycles=2))


def test_a_map_guides_by_what_it_is_over() -> None:
    """Over operating points it is the best timing; over the input it is J, as any function."""
    table = CalibrationMap({"speed_rpm": [900.0, 3000.0], "fuel_mg": [6.0, 40.0]}, -9.0, name="soc_cad")
    found, same = (
        seek(VirtualEngine(seed=1), {"soc_cad": (-20.0, 5.0)}, guide=guide, cycles=40)
        for guide in (table, TimingMap(table))
    )
    assert found.to_dict() == same.to_dict()
    assert found.start == {"soc_cad": -9.0}
    curve = CalibrationMap({"soc_cad": [-20.0, -6.0, 10.0]}, [50.0, 56.0, 51.0], name="efficiency_percent")
    assert seek(engine(0.05), ONE, guide=curve, cycles=20).to_dict()["seeker"] == "GaussianProcessSeeking"
    with pytest.raises(DataError, match="rail_bar has unit 'bar': a timing map needs"):
        seek(VirtualEngine(), {"soc_cad": (-20.0, 5.0)}, guide=CalibrationMap(table.axes, 400.0, name="rail_bar"))


def test_a_result_is_pickled_tabulated_and_plain() -> None:
    found = seek(limited, TWO, start={"soc_cad": 8.0, "egr": 0.3}, limits={"p_max_bar": 101.0}, cycles=50)
    again = pickle.loads(pickle.dumps(found))
    assert again.to_dict() == found.to_dict()
    data = found.dataset
    assert data["best"].sel(input="egr") == found.inputs["egr"]
    assert data["limits_at_best"].sel(limit="p_max_bar") == found.limits["p_max_bar"]
    assert data.attrs["seeker"] == "GaussianProcessSeeking"
    assert found.to_dict()["cycles"] == 50


class Rig:
    """A plant of two inputs that counts its cycles."""

    input_names, limit_names = ("soc_cad", "egr"), ("p_max_bar",)

    def __init__(self, fails_at: int = 10**9) -> None:
        self.cycles, self.fails_at = 0, fails_at

    def apply(self, inputs: dict[str, float]) -> None:
        self.inputs = inputs

    def measure(self) -> Measurement:
        if self.cycles == self.fails_at:
            raise OSError("the bus is gone")
        self.cycles += 1
        j, limits = limited(self.inputs)
        return Measurement(components=(j,), limits=limits)


@pytest.mark.parametrize(
    ("inputs", "settings", "error", "message"),
    [
        ({}, {}, ParameterError, "inputs: none given"),
        ({"soc_cad": (-25.0, 15.0)}, {}, ParameterError, "inputs = soc_cad: the plant takes soc_cad, egr"),
        ({"soc": (-25.0, 15.0), "egr": (0, 1)}, {}, ParameterError, "inputs = soc, egr: the plant takes soc_cad, egr"),
        ({"soc_cad": (-25.0, math.inf), "egr": (0, 1)}, {}, ParameterError, "soc_cad = .*inf.*: give finite bounds"),
        ([Input("soc_cad"), Input("egr")], {}, ParameterError, "soc_cad = .*: give finite bounds"),
        ({"soc_cad": 3.0, "egr": (0, 1)}, {}, ParameterError, r"soc_cad = 3.0: must be \(lower, upper\)"),
        (
            TWO,
            {"start": {"soc_cad": -30.0, "egr": 0.1}},
            ParameterError,
            r"soc_cad = -30: must be in \[-25, 15\]",
        ),
        (TWO, {"start": {"soc_cad": -3.0}}, ShapeError, "start has soc_cad: must have one number for each"),
        (TWO, {"start": [1.0]}, ShapeError, "start has 1 entries"),
        (TWO, {"start": [1.0, math.nan]}, ParameterError, "start: egr = nan"),
        (TWO, {"limits": {"p_max": 95.0}}, ParameterError, "'p_max' is not measured.*did you mean 'p_max_bar'"),
        (TWO, {"limits": {"p_max_bar": math.nan}}, ParameterError, "p_max_bar = nan: must be a finite number"),
        (TWO, {"cycles": 2}, ParameterError, "cycles = 2: must be >= 3, one reading"),
        (TWO, {"cycles": 9, "delay_cycles": 8}, ParameterError, "cycles = 9: must be >= 11"),
        (TWO, {"cycles": 20.0}, ParameterError, "cycles = 20: must be a whole number"),
        (TWO, {"noise_sd": 0.0}, ParameterError, "noise_sd"),
        (TWO, {"guide": Curve.parabola(curvature=-1.0, best=0.0, reach=9.0)}, ParameterError, "a Curve has one input"),
    ],
)
def test_a_refused_call_moves_nothing(inputs: Any, settings: dict[str, Any], error: type, message: str) -> None:
    rig = Rig()
    with pytest.raises(error, match=message):
        seek(rig, inputs, **settings)
    assert rig.cycles == 0


def test_more_than_eight_inputs_and_no_plant_are_refused() -> None:
    with pytest.raises(Error, match="at most 8 inputs"):
        seek(lambda _: 0.0, {f"x{i}": (0.0, 1.0) for i in range(9)})
    with pytest.raises(ParameterError, match="must be a Plant, as VirtualEngine"):
        seek(3.0, TWO)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (math.nan, "J = nan at soc_cad = .*, egr = .*: must be a finite number; return J"),
        ("56", "J = '56' at"),
        ([56.0], "J = .56.0. at"),
        ((56.0, 3.0), "limits = 3.0 at"),
        ((56.0, {"other": 1.0}), "limits = other at .*: must name p_max_bar"),
        (56.0, "limits = none at .*: must name p_max_bar"),
        ((56.0, {"p_max_bar": math.inf}), "p_max_bar = inf at"),
    ],
)
def test_a_wrong_answer_keeps_what_was_found(answer: Any, message: str) -> None:
    calls = 0

    def plant(x: dict[str, float]) -> Any:
        nonlocal calls
        calls += 1
        return answer if calls == 26 else limited(x)

    with pytest.raises(DataError, match=message) as info:
        seek(plant, TWO, limits={"p_max_bar": 120.0})
    part = info.value.partial  # type: ignore[attr-defined]
    assert isinstance(part, SeekResult)
    assert part.run.dataset.sizes["cycle"] == part.seeker.cycle == 25


@pytest.mark.parametrize("fails_at", [0, 1, 31])
def test_an_error_of_the_plant_passes_through_with_what_was_found(fails_at: int) -> None:
    rig = Rig(fails_at)
    with pytest.raises(OSError, match="the bus is gone") as info:
        seek(rig, TWO)
    part = info.value.partial  # type: ignore[attr-defined]
    assert part.run.dataset.sizes["cycle"] == fails_at
    assert ("no_reading" in codes(part)) is (fails_at == 0)
    assert part.summary()
    if fails_at == 1:
        assert part.value == limited({"soc_cad": -5.0, "egr": 0.2})[0]
        assert math.isnan(part.value_sd)
    if fails_at == 31:
        assert part.inputs == seek(Rig(), TWO, cycles=31).inputs
        rig.fails_at = 10**9
        assert run_seeker(rig, part.seeker, 9).dataset["cycle"].to_numpy().tolist() == list(range(31, 40))


def test_ctrl_c_keeps_what_was_found() -> None:
    calls = 0

    def stopped(x: dict[str, float]) -> float:
        nonlocal calls
        calls += 1
        if calls == 20:
            raise KeyboardInterrupt
        return engine(0.0)(x)

    with pytest.raises(Interrupted) as info:
        seek(stopped, TWO)
    assert isinstance(info.value.partial, SeekResult)
    assert info.value.partial.interrupted
    assert "interrupted" in codes(info.value.partial)


def test_it_is_the_seeker_of_that_name_and_nothing_else() -> None:
    start = {"soc_cad": 6.0, "egr": 0.3}
    found = seek(Rig(), TWO, start=start, cycles=40, noise_sd=0.2, seed=3)
    own = GaussianProcessSeeking(inputs=TWO, start=start, noise_sd=0.2, seed=3)
    run = run_seeker(Rig(), own, 40)
    np.testing.assert_array_equal(found.run.dataset["applied"], run.dataset["applied"])
    copied = copy.deepcopy(found)
    assert copied.inputs == found.inputs
