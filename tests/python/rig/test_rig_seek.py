"""A seeker on a rig: the loop of the core bit for bit, restarts, misfires, interruption and errors."""

import copy
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.engine import OperatingPoint, Performance
from mgdd.errors import DataError, ParameterError, RigError
from mgdd.loop import LoopCriteria, Measurement, VirtualEngine, run_seeker
from mgdd.loop.plant import AnnouncingPlant
from mgdd.optimize import (
    ComponentLag,
    ExtremumSeeking,
    Limit,
    Spsa,
)
from mgdd.results.labels import check_labels
from mgdd.rig import SimulatedRig
from mgdd.rig.base import Rig

CYCLES = 700
NAMES = ["p_max_bar", "dp_max_bar_per_cad", "cov_imep_percent"]
SPACE: dict[str, Any] = {
    "start": -18.0,
    "bounds": (-30.0, 10.0),
    "limits": [Limit("p_max_bar", 120.0), Limit("dp_max_bar_per_cad", 9.0, method="penalty"), Limit(NAMES[2], 40.0)],
}
LATE = {"components": [ComponentLag(), ComponentLag(delay_cycles=38, lag_cycles=25.0)], "period": 60}
SEEKERS = stepped(**SPACE)
SEEKERS["component-wise"] = lambda: ExtremumSeeking(gain=0.15, **LATE, **SPACE)
BATCH = "ExtremumSeeking batch"


def rough_bench(sensor: str = "analyser") -> VirtualEngine:
    """A bench on which everything happens: misfires, limits, a late sensor, drift and two new operating points."""
    point = OperatingPoint()
    return VirtualEngine(
        schedule=[(0, point), (251, point.replace(speed_rpm=1900.0)), (500, point.replace(fuel_mg=12.0))],
        performance=Performance.efficiency_and_nox(),
        nox_sensor=sensor,
        limits=NAMES,
        misfire_probability=0.05,
        soc_drift_cad_per_kcycle=1.0,
        seed=9,
    )


class ScriptedRig:
    """Gives back what a function says of a timing; announces nothing."""

    def __init__(self, answer: Callable[[int, float], Measurement]) -> None:
        self.answer, self.applied = answer, list[float]()

    input_names = ("soc_cad",)
    limit_names = ()

    def apply(self, inputs: Mapping[str, float]) -> None:
        self.applied.append(inputs["soc_cad"])

    def measure(self) -> Measurement:
        return self.answer(len(self.applied) - 1, self.applied[-1])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def hill(_: int, soc: float) -> Measurement:
    return Measurement(components=(56.0 - 0.0255 * (soc + 5.6) ** 2,))


def seeker() -> ExtremumSeeking:
    return ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0), gain=0.98)


@pytest.mark.parametrize(("name", "sensor"), [*((name, "analyser") for name in SEEKERS), (BATCH, "soft_corrected")])
def test_the_simulated_rig_is_the_loop_of_the_core(name: str, sensor: str) -> None:
    in_core, on_rig = SEEKERS[name](), SEEKERS[name]()
    goal = LoopCriteria(optimum=-1.0, arrival=2.0, exceed_from=300, exceed_above={"p_max_bar": 121.0})
    core = run_seeker(rough_bench(sensor), in_core, CYCLES, criteria=goal)
    with SimulatedRig(rough_bench(sensor)) as rig:
        run = run_seeker(rig, on_rig, CYCLES, criteria=goal)
    check_labels(run.dataset)
    assert 10 < int(run.dataset["misfire"].sum()) < 70
    assert list(np.flatnonzero(run.dataset["operating_point_changed"])) == [251, 500]
    assert set(core.dataset.variables) | {"void"} == set(run.dataset.variables)
    for column in core.dataset.variables:
        if column != "component":
            np.testing.assert_array_equal(run.dataset[column], core.dataset[column], err_msg=str(column))
            assert run.dataset[column].dtype == core.dataset[column].dtype, column
            assert run.dataset[column].attrs == core.dataset[column].attrs, column
    assert on_rig.state == in_core.state
    np.testing.assert_array_equal(on_rig.history["objective"], in_core.history["objective"])
    for figure, value in core.summary.items():
        assert run.summary[figure] == pytest.approx(value, rel=1e-12, nan_ok=True), figure
    assert not run.interrupted


def test_the_restart_comes_before_the_cycle() -> None:
    """Deaf to the announcement, the trajectory differs."""
    core = run_seeker(rough_bench(), SEEKERS[BATCH](), CYCLES)

    class Deaf(SimulatedRig):
        @property
        def operating_point_changes(self) -> bool:
            return False

    deaf = Deaf(rough_bench())
    run = run_seeker(deaf, SEEKERS[BATCH](), CYCLES)
    same = run.dataset["estimate"][:, 0].to_numpy() == core.dataset["estimate"][:, 0].to_numpy()
    assert same[:252].all()
    assert not same[252:].all()


def test_a_change_that_is_only_measured_costs_one_cycle() -> None:
    def answer(cycle: int, soc: float) -> Measurement:
        best = -5.6 if cycle < 305 else 0.0
        changed = {"operating_point_changed": float(cycle == 305)}
        return Measurement(components=(56.0 - 0.0255 * (soc - best) ** 2 - 3.0 * (cycle >= 305),), values=changed)

    rig, own = ScriptedRig(answer), seeker()
    assert isinstance(rig, Rig)
    assert not isinstance(rig, AnnouncingPlant)
    run = run_seeker(rig, own, 1200)
    assert list(np.flatnonzero(run.dataset["void"])) == [305]
    assert not run.dataset["misfire"].any()
    assert np.isnan(own.history["objective"][305])
    assert run.summary["final_soc_cad"] == pytest.approx(0.0, abs=0.05)

    by_hand = seeker()
    for cycle in range(1200):
        told = answer(cycle, float(by_hand.ask()[0]))
        by_hand.tell(told.performance, misfire=cycle == 305)
        if cycle == 305:
            by_hand.restart()
    np.testing.assert_array_equal(own.history["estimate"], by_hand.history["estimate"])


def test_a_plain_rig_gives_what_it_measures() -> None:
    def answer(cycle: int, soc: float) -> Measurement:
        values = {"boost_kpa": 150.0} if cycle % 2 else {}
        return Measurement(components=hill(cycle, soc).components, misfire=cycle == 4, values=values)

    run = run_seeker(ScriptedRig(answer), seeker(), 200, criteria=LoopCriteria(optimum=-5.6))
    check_labels(run.dataset)
    assert run.dataset["boost_kpa"].attrs["long_name"] == "boost_kpa, not given by the plant"
    assert np.isnan(run.dataset["boost_kpa"][::2]).all()
    assert (run.dataset["boost_kpa"][1::2] == 150.0).all()
    assert run.summary["misfires"] == 1.0
    assert np.isnan(run.summary["mean_efficiency_percent"])
    assert run.summary["cycles_to"] > 10
    assert "limits" not in run.dataset


def test_errors_name_the_remedy_and_change_nothing() -> None:
    own = seeker()
    before = copy.deepcopy(own.state)
    rig = ScriptedRig(hill)
    with pytest.raises(ParameterError, match="cycles = 0: must be >= 1"):
        run_seeker(rig, own, 0)
    with pytest.raises(ParameterError, match="2 entries: the plant takes 1, soc_cad"):
        run_seeker(rig, Spsa(start=[0.0, 1.0]), 5)
    assert rig.applied == []
    assert own.state == before
    limited = ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0), limits=[Limit("p_max_bar", 95.0)])
    with pytest.raises(ParameterError, match=r"limits of the seeker \['p_max_bar'\] are not all measured by the plant"):
        run_seeker(rig, limited, 5)
    split = ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0), components=[ComponentLag()] * 3)
    with pytest.raises(ParameterError, match="components has 3 entries: the plant measures 1"):
        run_seeker(rig, split, 5)
    assert limited.cycle == split.cycle == 0
    closed = SimulatedRig(VirtualEngine())
    closed.close()
    with pytest.raises(RigError, match="rig is closed"):
        run_seeker(closed, own, 5)
    broken = ScriptedRig(lambda cycle, _: Measurement(components=(np.nan if cycle == 7 else 50.0,)))
    with pytest.raises(DataError):
        run_seeker(broken, own, 20)
    assert own.cycle == 7
    assert own.history.sizes["cycle"] == 7
    assert run_seeker(ScriptedRig(hill), own, 300).summary["final_soc_cad"] == pytest.approx(-5.6, abs=0.1)


def test_the_bench_says_what_it_applied_and_the_core_tells_it_as_well() -> None:
    """Bounds wider than the window of the bench: the loop of the core and the one from Python stay one."""
    wide = {"start": -20.0, "bounds": (-80.0, 60.0)}
    ends = []
    for make in (lambda: ExtremumSeeking(**wide, gain=3.0, maximize=False), lambda: Spsa(**wide, maximize=False)):
        in_core, on_rig = make(), make()
        core = run_seeker(VirtualEngine(seed=2), in_core, 900)
        with SimulatedRig(VirtualEngine(seed=2)) as rig:
            run = run_seeker(rig, on_rig, 900)
        low, high = VirtualEngine().window_cad
        assert core.dataset["clamped"].to_numpy().any()
        for key in ("applied", "asked", "estimate"):
            np.testing.assert_array_equal(core.dataset[key].to_numpy(), run.dataset[key].to_numpy(), err_msg=key)
        np.testing.assert_array_equal(in_core.history["applied"], on_rig.history["applied"])
        assert in_core.state == on_rig.state
        applied = in_core.history["applied"].to_numpy()
        assert applied.min() >= low
        assert applied.max() <= high
        ends.append(float(core.dataset["estimate"][-1, 0]))
    assert all(low - 0.2 <= end <= high + 0.2 for end in ends)  # the worst efficiency lies at an end of the window


def test_an_applied_input_that_the_plant_does_not_have_is_named() -> None:
    rig = ScriptedRig(lambda *_: Measurement(components=(1.0,), applied={"rail_bar": 900.0}))
    with pytest.raises(ParameterError, match=r"applied = rail_bar: must be among the inputs soc_cad"):
        run_seeker(rig, seeker(), 3)
