"""One contract for every rig, whatever stands behind it: in this process, recorded, over a bus."""

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from mgdd.errors import ParameterError, RigError
from mgdd.loop import Measurement, Plant, VirtualEngine, VirtualThrottle
from mgdd.rig import CanRig, RecordingRig, ReplayRig, SimulatedRig
from mgdd.rig.base import Rig
from mgdd.rig.exchange import RigRecord
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant, fit_surrogate, random_step_records

SAMPLES = 40


@functools.cache
def surrogate() -> EngineSurrogate:
    return fit_surrogate(random_step_records(1500))


def throttle() -> Plant:
    return VirtualThrottle(sample_s=5e-3, seed=3)


def bus_throttle() -> Plant:
    return VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=3)


def bench() -> Plant:
    return VirtualEngine(limits=["p_max_bar", "dp_max_bar_per_cad"], misfire_probability=0.1, seed=3)


def surrogate_plant() -> Plant:
    return SurrogatePlant(surrogate(), "imep_bar", limits=["mprr"], seed=3)


PLANTS: dict[str, tuple[str, Callable[[], Plant], Callable[[], Plant], float, tuple[float, float]]] = {
    "throttle": ("etb", throttle, bus_throttle, 5e-4, (-1.0, 1.0)),
    "engine bench": ("engine", bench, bench, 5e-3, (-60.0, 20.0)),
    "surrogate": ("surrogate", surrogate_plant, surrogate_plant, 5e-3, (-60.0, 30.0)),
}
CENTRE = {"throttle": (0.25, 0.1), "engine bench": (-6.0, 3.0), "surrogate": (-1.0, 2.0)}


def asked(plant: str) -> list[float]:
    """Inputs on the grid of the signals, so that a bus does not round them."""
    centre, width = CENTRE[plant]
    grid = PLANTS[plant][3]
    return [round((centre + width * math.sin(0.7 * k)) / grid) * grid for k in range(SAMPLES)]


def live(plant: str) -> Rig:
    return SimulatedRig(PLANTS[plant][1]())


def over_a_bus(plant: str) -> Rig:
    name, _, make, _, _ = PLANTS[plant]
    return CanRig(name, plant=make())


def run(rig: Rig, plant: str) -> list[Measurement]:
    (name,) = rig.input_names
    out = []
    for value in asked(plant):
        rig.apply({name: value})
        out.append(rig.measure())
    return out


def recorded(plant: str) -> Rig:
    rows: list[Any] = []
    with RecordingRig(live(plant), rows.append) as rig:
        run(rig, plant)
    return ReplayRig(RigRecord.from_columns([*rows[0]], [[*row.values()] for row in rows]))


RIGS: dict[str, Callable[[str], Rig]] = {"simulated": live, "replayed": recorded, "bus": over_a_bus}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("kind", RIGS)
class TestContract:
    @pytest.fixture
    def rig(self, kind: str, plant: str) -> Iterator[Rig]:
        with RIGS[kind](plant) as rig:
            yield rig

    def test_it_is_a_rig(self, rig: Rig, plant: str) -> None:
        assert isinstance(rig, Rig)
        own = live(plant)
        assert rig.input_names == own.input_names
        assert rig.limit_names == own.limit_names

    def test_nothing_is_measured_before_an_input(self, rig: Rig) -> None:
        with pytest.raises(RigError, match=r"measure\(\) before apply\(\)"):
            rig.measure()

    def test_the_same_inputs_give_the_same_bits(self, rig: Rig, kind: str, plant: str) -> None:
        with RIGS[kind](plant) as again:
            np.testing.assert_equal(table(run(again, plant)), table(run(rig, plant)))

    def test_it_measures_what_the_plant_measures(self, rig: Rig, plant: str) -> None:
        """Within the resolution of the signals where there is a bus between."""
        with live(plant) as own:
            straight = run(own, plant)
        for k, (one, other) in enumerate(zip(straight, run(rig, plant), strict=True)):
            shared = set(one.values) & set(other.values)
            assert len(shared) >= 4
            for name in shared:
                step = STEPS.get(name, 0.0 if type(rig) is not CanRig else 2.6e-3)
                assert other.values[name] == pytest.approx(one.values[name], abs=step, nan_ok=True), (k, name)
            assert other.misfire == one.misfire
            for name, value in one.limits.items():
                assert other.limits[name] == pytest.approx(value, abs=2.6e-3)
            assert other.performance == pytest.approx(one.performance, abs=1.1e-3)

    def test_a_wrong_input_is_refused_and_changes_nothing(self, rig: Rig, kind: str, plant: str) -> None:
        (name,) = rig.input_names
        value = asked(plant)[0]
        for wrong in ({}, {"wrong": 1.0}, {name: math.nan}, {name: value, "more": 1.0}):
            with pytest.raises(ParameterError):
                rig.apply(wrong)
        rig.apply({name: value})
        first = rig.measure()
        for wrong in ({name: math.inf}, {}):
            with pytest.raises(ParameterError):
                rig.apply(wrong)
        with RIGS[kind](plant) as fresh:
            fresh.apply({name: value})
            np.testing.assert_equal(table([first]), table([fresh.measure()]))

    def test_a_closed_rig_refuses(self, kind: str, plant: str) -> None:
        with RIGS[kind](plant) as rig:
            (name,) = rig.input_names
            rig.apply({name: asked(plant)[0]})
            rig.measure()
        with pytest.raises(RigError):
            rig.apply({name: 0.0})
        with pytest.raises(RigError):
            rig.measure()

    def test_leaving_by_an_error_leaves_it_closed(self, kind: str, plant: str) -> None:
        rig = RIGS[kind](plant)
        with pytest.raises(ZeroDivisionError), rig:
            raise ZeroDivisionError
        with pytest.raises(RigError):
            rig.apply(dict.fromkeys(rig.input_names, 0.0))


STEPS = {
    "first_v": 6.3e-4, "second_v": 6.3e-4, "speed_deg_per_s": 0.051, "supply_v": 0.011, "t_max_k": 0.051,
    "heat_loss_j": 0.051, "nox_analyser_ppm": 0.11, "nox_fast_ppm": 0.11, "nox_soft_ppm": 0.11, "nox_ppm": 0.11,
    "nox_soft_corrected_ppm": 0.11, "sensed_angle_deg": 5.1e-3, "current_a": 5.1e-3,
}  # fmt: skip


def table(measured: list[Measurement]) -> list[dict[str, Any]]:
    return [
        {
            "components": one.components,
            "limits": dict(one.limits),
            "values": dict(one.values),
            "applied": dict(one.applied),
            "misfire": one.misfire,
        }
        for one in measured
    ]


@pytest.mark.parametrize("plant", PLANTS)
def test_a_bus_clamps_to_the_bounds_of_the_map_and_says_so(plant: str) -> None:
    lower, upper = PLANTS[plant][4]
    with over_a_bus(plant) as rig:
        (name,) = rig.input_names
        for value, applied in [(1e6, upper), (-1e6, lower)]:
            rig.apply({name: value})
            assert rig.measure().applied[name] == pytest.approx(applied)


def test_a_replay_says_where_an_input_differs() -> None:
    rig = recorded("engine bench")
    soc = asked("engine bench")
    with rig:
        rig.apply({"soc_cad": soc[0]})
        rig.measure()
        rig.apply({"soc_cad": soc[1] + 0.5})
        with pytest.raises(RigError, match=r"sample 1: soc_cad = .* was asked for, .* is recorded"):
            rig.measure()
        rig.apply({"soc_cad": soc[1]})  # refused, not lost
        rig.measure()
    assert isinstance(rig, ReplayRig)
    loose = ReplayRig(rig.record, strict=False, tolerance=0.4)
    with loose:
        for shift in (0.3, 0.5, -0.6):
            loose.apply({"soc_cad": soc[loose.sample] + shift})
            loose.measure()
        assert [(d.sample, d.name) for d in loose.differences] == [(1, "soc_cad"), (2, "soc_cad")]
        assert loose.differences[0].asked - loose.differences[0].recorded == pytest.approx(0.5)
        for k in range(3, SAMPLES):
            loose.apply({"soc_cad": soc[k]})
            loose.measure()
        loose.apply({"soc_cad": 0.0})
        with pytest.raises(RigError, match=f"ends after {SAMPLES} samples"):
            loose.measure()


def test_a_record_that_is_none() -> None:
    from mgdd.errors import DataError

    for names, rows, text in [
        (["input.duty"], [[1.0, 2.0]], r"shape \(1, 2\): must have a column for each of 1 names"),
        (["duty"], [[1.0]], "column 'duty': must be misfire, or begin with"),
        (["value.angle_deg"], [[1.0]], "no column input.NAME"),
    ]:
        with pytest.raises(DataError, match=text):
            RigRecord.from_columns(names, rows)
    with pytest.raises(ParameterError, match="tolerance = -1: must be >= 0"):
        ReplayRig(RigRecord(("duty",)), tolerance=-1.0)


def test_every_exchange_reaches_the_sink_as_it_happens() -> None:
    rows: list[Any] = []
    with RecordingRig(live("engine bench"), rows.append) as rig:
        for k, value in enumerate(asked("engine bench")[:5]):
            rig.apply({"soc_cad": value})
            assert len(rows) == k
            rig.measure()
            assert rows[-1]["input.soc_cad"] == value
    assert len(rig.record) == 5
    assert rig.record[3].measurement.values["imep_gross_bar"] == rows[3]["value.imep_gross_bar"]
