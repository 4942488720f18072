"""A search for a map, on a spark engine of its own: other physics, other signs and names than the package's engine."""

import copy
import dataclasses
import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, Interrupted, ParameterError, ShapeError
from mgdd.loop import VirtualEngine, VirtualTestBed, run_seeker, seek, seek_map
from mgdd.maps import CalibrationMap
from mgdd.optimize import MapSeeking

AXES = {"speed_rpm": [1000.0, 2000.0, 3000.0, 4000.0], "load": [0.3, 0.6, 0.9]}
SPARK = {"spark_cad": (-45.0, 10.0)}  # negative is before dead centre
KNOCK = 1.0


def torque(x: dict[str, float], *, shift: float = 0.0, scale: float = 1.0) -> float:
    best = -14.0 - 0.006 * (x["speed_rpm"] - 1000.0) + 9.0 * x["load"] + shift
    off = x["spark_cad"] - best
    return scale * x["load"] * (200.0 - 0.11 * off**2 + 0.0012 * off**3)


def knock(x: dict[str, float], *, octane: float = 0.0) -> float:
    late = x["spark_cad"] + 20.0 + octane - 22.0 * (x["load"] - 0.5) + 0.002 * (x["speed_rpm"] - 2000.0)
    return float(0.25 * math.exp(-late / 7.0))


class SparkEngine:
    """A function of point and spark that reads with noise, and remembers where it was asked."""

    def __init__(
        self, seed: int, *, fails: Any = None, ends_after: int | None = None, lies: Mapping[int, float] | None = None
    ) -> None:
        self.draw, self.fails, self.ends_after, self.lies = np.random.default_rng(seed), fails, ends_after, lies or {}
        self.asked = list[dict[str, float]]()

    def __call__(self, x: dict[str, float]) -> Any:
        if len(self.asked) == self.ends_after:
            raise KeyboardInterrupt
        self.asked.append(dict(x))
        noise = self.draw.standard_normal(2)
        if self.fails is not None and self.fails(x):
            return None
        lie = self.lies.get(len(self.asked) - 1, 0.0)
        return torque(x) + 0.2 * noise[0] + lie, {"knock": knock(x) + 0.01 * noise[1]}


def rough(x: dict[str, float]) -> float:
    return torque(x, shift=-5.0, scale=0.8)


def rough_knock(x: dict[str, float]) -> float:
    return knock(x, octane=-4.0)


GUIDED: dict[str, Any] = {"guide": rough, "limit_guides": {"knock": rough_knock}, "limits": {"knock": KNOCK}}


def losses(found: Any) -> np.ndarray[Any, Any]:
    """What each cell loses against the best spark that keeps the limit [N m]; NaN where it breaks it."""
    sparks = np.linspace(-45.0, 10.0, 2201)
    out = []
    for at in itertools.product(*AXES.values()):
        point = dict(zip(AXES, at, strict=True))
        kept = [torque({**point, "spark_cad": s}) for s in sparks if knock({**point, "spark_cad": s}) <= KNOCK]
        own = {**point, "spark_cad": float(found.map(point))}
        out.append(max(kept) - torque(own) if knock(own) <= 1.01 * KNOCK else math.nan)
    return np.array(out)


def test_a_rough_model_and_ten_visits_make_the_map() -> None:
    for seed in range(4):
        engine = SparkEngine(seed)
        found = seek_map(engine, SPARK, AXES, visits=10, seed=seed, **GUIDED)
        assert len(engine.asked) == len(found.visits) == 10
        assert losses(found).max() < 1.5  # of 60 to 180 N m; the largest where knock holds it back
        assert max(map(knock, engine.asked)) < 1.05 * KNOCK
        assert found.findings == ()
        assert isinstance(found.map, CalibrationMap)
        assert found.map.cells["support"].sum() == 10


@pytest.mark.parametrize(("visit", "lie"), [(3, -20.0), (7, -20.0), (8, 20.0), (13, -20.0), (15, 20.0)])
def test_one_wrong_reading_is_taken_again_and_costs_a_visit(visit: int, lie: float) -> None:
    engine = SparkEngine(visit, lies={visit: lie})
    found = seek_map(engine, SPARK, AXES, visits=16, seed=visit, **GUIDED)
    assert losses(found).max() < 0.5
    assert max(map(knock, engine.asked)) < 1.05 * KNOCK
    assert found.findings == ()
    if 3 < visit < 15:
        assert engine.asked[visit + 1] == engine.asked[visit]


def test_without_the_model_more_visits_do() -> None:
    plain = seek_map(SparkEngine(1), SPARK, AXES, limits={"knock": KNOCK}, start={"spark_cad": -2.0}, visits=40, seed=1)
    assert losses(plain).max() < 3.0


def test_two_inputs_and_a_lower_limit() -> None:
    def engine(x: dict[str, float]) -> Any:
        off = x["cam_deg"] - (10.0 + 0.005 * (x["speed_rpm"] - 1000.0) - 12.0 * x["load"])
        j = torque({**x, "spark_cad": x["spark_cad"] + 0.1 * off}) - 0.04 * off**2
        return j, {"knock": knock(x), "burn_share": 0.9 + 0.003 * x["cam_deg"] - 0.002 * abs(x["spark_cad"])}

    inputs = {**SPARK, "cam_deg": (-20.0, 30.0)}
    found = seek_map(engine, inputs, AXES, visits=60, limits={"knock": KNOCK, "burn_share": (0.8, None)}, seed=2)
    assert set(found.maps) == set(inputs)
    with pytest.raises(ParameterError, match="several, spark_cad, cam_deg"):
        _ = found.map
    at = {"speed_rpm": 2000.0, "load": 0.3}
    own = {**at, **{name: float(table(at)) for name, table in found.maps.items()}}
    best = max(
        engine({**at, "spark_cad": s, "cam_deg": c})[0]
        for s, c in itertools.product(np.linspace(-45, 10, 111), np.linspace(-20, 30, 101))
        if (limits := engine({**at, "spark_cad": s, "cam_deg": c})[1])["knock"] <= KNOCK and limits["burn_share"] >= 0.8
    )
    assert best - engine(own)[0] < 1.0
    assert engine(own)[1]["burn_share"] > 0.795


def test_a_record_goes_on_as_if_it_had_never_stopped(tmp_path: Path) -> None:
    whole = seek_map(SparkEngine(3), SPARK, AXES, visits=9, seed=3, **GUIDED)
    file, engine = tmp_path / "visits.csv", SparkEngine(3, ends_after=5)
    with pytest.raises(Interrupted) as stop:
        seek_map(engine, SPARK, AXES, visits=9, seed=3, record=file, **GUIDED)
    assert len(stop.value.partial.visits) == 5
    engine.ends_after = None
    with file.open("a", encoding="utf-8") as out:
        out.write("1000.0,0.3,-2")  # killed as it wrote
    again = seek_map(engine, SPARK, AXES, visits=9, seed=3, record=file, **GUIDED)
    assert again.visits == whole.visits
    assert again.cells.identical(whole.cells)
    replayed = seek_map(SparkEngine(99, ends_after=0), SPARK, AXES, visits=9, seed=3, record=file, **GUIDED)
    assert replayed.cells.identical(whole.cells)
    for other in ({"seed": 4}, {"limits": {}, "limit_guides": None}, {"guide": torque}):
        with pytest.raises(DataError, match="another search"):
            seek_map(SparkEngine(3), SPARK, AXES, visits=12, record=file, **{**GUIDED, "seed": 3, **other})
    rows = file.read_text(encoding="utf-8").splitlines()
    unread = rows[4].split(",")
    unread[rows[1].split(",").index("j")] = "nan"
    for edited, what in (
        ("9" + rows[4][1:], "another point"), (rows[4] + ",1.0", "must be 9 numbers"),
        (",".join(unread), "row 3: J = nan: must be finite.*mend or delete it"),
    ):  # fmt: skip
        file.write_text("\n".join([*rows[:4], edited, ""]), encoding="utf-8")
        with pytest.raises(DataError, match=what):
            seek_map(SparkEngine(3), SPARK, AXES, visits=12, record=file, seed=3, **GUIDED)


def test_a_saved_search_goes_on(tmp_path: Path) -> None:
    engine = SparkEngine(5)
    first = seek_map(engine, SPARK, AXES, visits=4, seed=5, **GUIDED)
    first.seeker.save(tmp_path / "search.json")
    alone = MapSeeking.load(tmp_path / "search.json")
    both = seek_map(SparkEngine(9), SPARK, AXES, visits=6, seeker=dataclasses.replace(first, seeker=MapSeeking.load(
        tmp_path / "search.json")))  # fmt: skip
    assert both.visits[:4] == first.visits
    assert both.map.cells["support"].sum() == len(both.visits) == 6
    more = seek_map(engine, SPARK, AXES, visits=7, seeker=alone)
    assert more.seeker.readings == 7
    assert more.cells.identical(seek_map(SparkEngine(5), SPARK, AXES, visits=7, seed=5, **GUIDED).cells)


def test_it_stops_at_a_tolerance_and_reports_progress() -> None:
    seen = list[Any]()
    found = seek_map(SparkEngine(6), SPARK, AXES, visits=40, tolerance=1.0, on_visit=seen.append, seed=6, **GUIDED)
    assert 9 <= len(found.visits) < 25
    assert float(found.cells["regret"].max()) <= 1.0
    assert [one.visit for one in seen] == list(range(1, len(found.visits) + 1))
    short = seek_map(SparkEngine(6), SPARK, AXES, visits=3, tolerance=1e-6, seed=6, **GUIDED)
    assert "not_converged" in {finding.code for finding in short.findings}


def test_reasons_to_doubt_a_map() -> None:
    def codes(engine: Any, visits: int = 16, **more: Any) -> set[str]:
        return {one.code for one in seek_map(engine, SPARK, AXES, visits=visits, **{**GUIDED, **more}).findings}

    assert "no_safe_input" in codes(SparkEngine(7), limits={"knock": 0.001})
    assert "limit_everywhere" in codes(SparkEngine(7), limits={"knock": 0.05})
    assert "failed_visits" in codes(SparkEngine(7, fails=lambda x: x["speed_rpm"] > 3500.0 and x["load"] < 0.4))
    assert "no_reading" in codes(SparkEngine(7, fails=lambda _: True), visits=3)
    nonsense = {"guide": lambda x: math.sin(0.9 * x["spark_cad"]) * x["load"]}
    assert "guide_explains_nothing" in codes(SparkEngine(7), visits=30, **nonsense)


def test_the_virtual_engine_is_driven_over_its_map() -> None:
    axes = {"speed_rpm": [1200.0, 1800.0, 2400.0], "fuel_mg": [10.0, 20.0, 30.0]}
    engine = VirtualEngine("puma_single", seed=2)
    limits = {"p_max_bar": 120.0}
    found = seek_map(
        engine, {"soc_cad": (-20.0, 8.0)}, axes, limits=limits, guide=Cylinder(wall_heat_scale=1.0), visits=8
    )
    for at in itertools.product(*axes.values()):
        point = dict(zip(axes, at, strict=True))
        there = VirtualEngine("puma_single", point)
        best = there.find_optimum(limits, bounds={"soc_cad": (-20.0, 8.0)})
        own = float(there.steady_map([float(found.map(point))])["j"][0])
        assert best.value - own < 0.1  # points of efficiency
    schedule = [(30 * k, OperatingPoint(speed_rpm=1200.0 + 400.0 * k, fuel_mg=14.0 + 4.0 * k)) for k in range(4)]
    drive = VirtualEngine("puma_single", schedule=schedule, limits=["p_max_bar"], seed=8)
    before = found.seeker.readings
    driver = found.seeker.driver()
    alone = copy.deepcopy(found.seeker).driver()
    plain = run_seeker(VirtualEngine("puma_single", schedule=schedule, limits=["p_max_bar"], seed=8), alone, 120)
    run = seek(drive, seeker=driver, cycles=120)
    assert run.run.dataset["applied"].identical(plain.dataset["applied"])
    assert run.start["soc_cad"] == pytest.approx(float(found.map({"speed_rpm": 1200.0, "fuel_mg": 14.0})), abs=1.0)
    with pytest.raises(ParameterError, match="leave them out"):
        seek(drive, {"soc_cad": (-20.0, 10.0)}, seeker=driver, cycles=5)
    assert found.seeker.readings == before + 120
    assert found.seeker.doubts == 0  # single cycles scatter as those of the visits did
    scatter = found.dataset["visit_p_max_bar_sd"]
    assert scatter.attrs["units"] == "bar"
    assert 0.2 < float(scatter.min()) < float(scatter.max()) < 5.0
    after = found.driven(driver).map
    assert after.provenance["driven"] == "120 cycles"
    assert set(after.cells["source"][driver.readings > 0.0]) == {"learned"}
    assert after.cells["support"].sum() == 128
    assert np.argwhere(driver.readings > 0.0).tolist() == [[0, 0], [1, 1], [2, 2]]
    for k in range(4):
        best = drive.find_optimum(limits, cycle=30 * k, bounds={"soc_cad": (-20.0, 8.0)})
        timings = run.run.dataset["applied"].to_numpy()[30 * k : 30 * k + 30, 0]
        lost = best.value - drive.steady_map(np.clip(timings, -20.0, 8.0), cycle=30 * k)["j"].to_numpy()
        assert lost.mean() < 0.1


def test_a_test_bed_steers_the_point_and_says_what_is_steady() -> None:
    bed = VirtualTestBed("puma_single", limits=["p_max_bar"], seed=4)
    points = {"speed_rpm": [1500.0, 2500.0], "fuel_mg": [15.0, 25.0], "soc_cad": [-4.0, -9.0]}
    steady = bed.steady(points)
    for k in range(2):
        at = {name: column[k] for name, column in points.items()}
        quiet = VirtualEngine("puma_single", {"speed_rpm": at["speed_rpm"], "fuel_mg": at["fuel_mg"]})
        want = quiet.steady_map([at["soc_cad"]])
        assert steady["j"][k] == pytest.approx(float(want["j"][0]), abs=1e-9)
        assert steady["p_max_bar"][k] == pytest.approx(float(want["p_max_bar"][0]), abs=1e-9)
        bed.apply(at)
        assert bed.operating_point_changes
        read = [bed.measure().performance for _ in range(30)]
        assert not bed.operating_point_changes
        assert np.mean(read) == pytest.approx(steady["j"][k], abs=0.3)
        assert len(set(read)) == 30
    with pytest.raises(ParameterError, match="fuel_mg"):
        VirtualTestBed(axes=["fuel"])


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"axes": {"speed_rpm": [1000.0], "load": [0.3, 0.9]}}, ParameterError, "axes of speed_rpm"),
        ({"axes": {"speed_rpm": [1000.0, 1000.0], "load": [0.3, 0.9]}}, ParameterError, "axes of speed_rpm"),
        ({"axes": {}}, ParameterError, "axes"),
        ({"inputs": {"spark_cad": (-45.0, math.inf)}}, ParameterError, "spark_cad"),
        ({"inputs": {"load": (0.0, 1.0)}}, ParameterError, "load is an axis too"),
        ({"visits": 0}, ParameterError, "visits"),
        ({"tolerance": -1.0}, ParameterError, "tolerance"),
        ({"averaged": (20, 10)}, ParameterError, "averaged"),
        ({"settling": -1}, ParameterError, "settling"),
        ({"start": {"cam_deg": 3.0}, "guide": None, "limit_guides": None}, ShapeError, "start has cam_deg"),
        ({"limit_guides": {"knocks": rough_knock}}, ParameterError, "limit_guides names knocks"),
        ({"guide": None}, ParameterError, "limit_guides"),
        ({"guide": lambda x: 1.0 / (x["speed_rpm"] - 2000.0)}, ParameterError, "speed_rpm = 2000"),
        ({"guide": lambda x: math.nan if x["load"] > 0.8 else 1.0}, ParameterError, "load = 0.9"),
        ({"settings": {"reach": 7.0}}, ParameterError, "settings: reach"),
        ({"settings": {"seed": 7}}, ParameterError, "settings: 'seed': must be one of"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name_before_a_visit(changes: dict[str, Any], error: type, text: str) -> None:
    engine = SparkEngine(0)
    given: dict[str, Any] = {"inputs": SPARK, "axes": AXES, "visits": 3, **GUIDED, **changes}
    with pytest.raises(error, match=text):
        seek_map(engine, given.pop("inputs"), given.pop("axes"), **given)
    assert engine.asked == []


def test_a_reading_that_is_none_ends_the_search_with_its_part() -> None:
    answers = iter([100.0, 101.0, math.nan])
    with pytest.raises(DataError) as stop:
        seek_map(lambda _: next(answers), SPARK, AXES, visits=5)
    assert len(stop.value.partial.visits) == 2  # type: ignore[attr-defined]


def test_a_refused_reading_changes_nothing() -> None:
    search = seek_map(SparkEngine(8), SPARK, AXES, visits=4, seed=8, **GUIDED).seeker
    at, spark, before = {"speed_rpm": 1500.0, "load": 0.5}, {"spark_cad": -9.0}, search.state
    for given, text in (
        (({"speed_rpm": 1500.0}, spark, 100.0, [0.4]), "at has speed_rpm"),
        (({**at, "load": 2.0}, spark, 100.0, [0.4]), "load = 2"),
        ((at, {"spark": -9.0}, 100.0, [0.4]), "inputs has spark"),
        ((at, spark, math.nan, [0.4]), "J"),
        ((at, spark, 100.0, []), "limits has 0"),
        ((at, spark, 100.0, {"nox": 3.0}), "limits has nox"),
        ((at, spark, 1e31, [0.4]), "J"),
    ):
        with pytest.raises((ParameterError, DataError, ShapeError), match=text):
            search.tell(*given)
    with pytest.raises(ParameterError, match="readings"):
        search.tell(at, spark, 100.0, [0.4], readings=0.0)
    assert all(np.array_equal(before[name], column) for name, column in search.state.items())
