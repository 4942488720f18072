"""The guard between an optimiser and the actuators: what it rejects, what it applies instead, and what it says."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd.errors import ParameterError, RigError
from mgdd.loop import Measurement, Plant, VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit, Spsa
from mgdd.rig import ActuatorGuard, SimulatedRig
from mgdd.rig.base import GuardedAsk

START = {"soc_cad": 2.0, "rail_bar": 600.0}
BOUNDS = {"soc_cad": (-12.0, 10.0), "rail_bar": (300.0, 1400.0)}


class Engine:
    """Two inputs, a pressure that rises with early timing and rail, and a delay of its reading."""

    input_names = ("soc_cad", "rail_bar")
    limit_names = ("p_max_bar", "nox_ppm")

    def __init__(self, *, delay: int = 0, offset: float = 0.0, answer: Measurement | None = None) -> None:
        self.delay, self.offset, self.answer = delay, offset, answer
        self.applied: list[dict[str, float]] = []

    def pressure(self, inputs: Mapping[str, float]) -> float:
        return 100.0 - 3.0 * inputs["soc_cad"] + 0.02 * (inputs["rail_bar"] - 600.0) + self.offset

    def apply(self, inputs: Mapping[str, float]) -> None:
        self.applied.append(dict(inputs))

    def measure(self) -> Measurement:
        if self.answer is not None:
            return self.answer
        seen = self.applied[max(0, len(self.applied) - 1 - self.delay)]
        return Measurement(components=(1.0,), limits={"p_max_bar": self.pressure(seen), "nox_ppm": 300.0})


def guard_of(engine: Any = None, **options: Any) -> ActuatorGuard:
    options = {"start": START, "bounds": BOUNDS, "limits": [Limit("p_max_bar", 130.0)], **options}
    return ActuatorGuard(Engine() if engine is None else engine, **options)


def cycle(guard: ActuatorGuard, soc_cad: float, rail_bar: float = 600.0) -> Mapping[str, float]:
    guard.apply({"soc_cad": soc_cad, "rail_bar": rail_bar})
    return guard.measure().applied


def test_a_safe_ask_passes_unchanged_and_unlogged():
    guard = guard_of()
    assert isinstance(guard, Plant)
    for soc in (2.0, -5.0, 10.0, -7.9):
        assert cycle(guard, soc, 700.0) == {"soc_cad": soc, "rail_bar": 700.0}
    assert guard.log == []
    assert guard.good == {"soc_cad": -7.9, "rail_bar": 700.0}
    assert set(guard.counts.values()) == {0}


@pytest.mark.parametrize(
    ("soc", "rail", "reason", "name"),
    [
        (-12.1, 600.0, "bounds", "soc_cad"),
        (0.0, 1400.1, "bounds", "rail_bar"),
        (math.nan, 600.0, "not_finite", "soc_cad"),
        (-20.0, math.inf, "not_finite", "rail_bar"),
    ],
)
def test_an_unsafe_ask_is_rejected_logged_and_the_last_good_point_applied(soc, rail, reason, name):
    guard = guard_of()
    cycle(guard, -3.0, 650.0)
    assert cycle(guard, soc, rail) == {"soc_cad": -3.0, "rail_bar": 650.0}
    (entry,) = guard.log
    assert (entry.cycle, entry.reason, entry.name) == (1, reason, name)
    assert entry.applied == {"soc_cad": -3.0, "rail_bar": 650.0}
    assert guard.counts[reason] == 1
    assert cycle(guard, -4.0) == {"soc_cad": -4.0, "rail_bar": 600.0}


def test_before_any_good_point_the_start_is_applied():
    assert cycle(guard_of(), math.nan) == START


def test_a_fast_move_is_cut_to_the_rate_of_its_input():
    guard = guard_of(rates={"soc_cad": 0.5})
    assert cycle(guard, -3.0, 900.0) == {"soc_cad": 1.5, "rail_bar": 900.0}  # from the start
    assert cycle(guard, -3.0, 900.0) == {"soc_cad": 1.0, "rail_bar": 900.0}
    assert cycle(guard, 0.75, 300.0) == {"soc_cad": 0.75, "rail_bar": 300.0}
    assert [entry.reason for entry in guard.log] == ["rate", "rate"]
    assert guard.log[0] == GuardedAsk(
        0, "rate", "soc_cad", {"soc_cad": -3.0, "rail_bar": 900.0}, {"soc_cad": 1.5, "rail_bar": 900.0}
    )


def test_above_a_limit_it_steps_back_to_the_last_good_point_for_so_many_cycles():
    guard = guard_of(hold_cycles=2)
    cycle(guard, -6.0)
    cycle(guard, -9.0)
    assert cycle(guard, -11.0) == {"soc_cad": -11.0, "rail_bar": 600.0}  # 133 bar: nobody could know
    for _ in range(2):
        assert cycle(guard, -11.0)["soc_cad"] == -9.0
    assert cycle(guard, -8.0)["soc_cad"] == -8.0
    assert [(entry.reason, entry.name) for entry in guard.log] == [("limit", "p_max_bar")] * 2


def test_a_good_point_that_exceeds_the_limit_later_is_good_no_longer():
    engine = Engine()
    guard = guard_of(engine)
    for soc in (-3.0, -6.0, -9.0):
        cycle(guard, soc)
    engine.offset = 10.0  # another operating point: -6 now has 128 bar, -9 has 137
    assert cycle(guard, -9.0)["soc_cad"] == -9.0
    assert cycle(guard, -9.0)["soc_cad"] == -6.0
    engine.offset = 25.0
    assert cycle(guard, -6.0)["soc_cad"] == -6.0
    assert cycle(guard, -6.0)["soc_cad"] == -3.0
    assert cycle(guard, -6.0)["soc_cad"] == START["soc_cad"]
    for _ in range(5):
        assert cycle(guard, -6.0)["soc_cad"] in (START["soc_cad"], -6.0)


def test_a_late_reading_blames_the_input_that_caused_it():
    engine = Engine(delay=3)
    guard = guard_of(engine, limits=[Limit("p_max_bar", 130.0, delay_cycles=3.0)])
    for soc in (-4.0, -5.0, -6.0, -7.0, -8.0, -11.0):
        cycle(guard, soc)
    assert guard.good["soc_cad"] == -6.0  # the reading of -7 has not come yet
    for soc in (-9.0, -9.1, -9.2):
        cycle(guard, soc)
    assert guard.log == []
    assert cycle(guard, -9.3)["soc_cad"] == guard.good["soc_cad"] == -8.0
    for _ in range(3):
        assert cycle(guard, -9.3)["soc_cad"] == -8.0  # until what was applied meanwhile has been read


def test_of_two_proven_points_the_one_that_caused_a_late_excess_is_dropped():
    engine = Engine(delay=2)
    guard = guard_of(engine, limits=[Limit("p_max_bar", 130.0, delay_cycles=2.0)])
    for soc in (-3.0, -3.0, -3.0, -6.0, -6.0, -6.0, -3.0, -3.0, -3.0):
        cycle(guard, soc)
    engine.offset = 15.0  # now -6 has 133 bar, -3 has 124
    for soc in (-6.0, -3.0, -3.0):
        cycle(guard, soc)
    assert cycle(guard, 5.0)["soc_cad"] == guard.good["soc_cad"] == -3.0
    assert [entry.name for entry in guard.log] == ["p_max_bar"]


@pytest.mark.parametrize("limits", [{}, {"p_max_bar": math.nan}])
def test_a_reading_that_is_missing_or_not_a_number_counts_as_exceeded(limits):
    guard = guard_of(Engine(answer=Measurement(limits=limits)))
    cycle(guard, -5.0)
    assert cycle(guard, -6.0) == START
    assert guard.log[0].name == "p_max_bar"


def test_a_misfire_proves_nothing():
    guard = guard_of(Engine(answer=Measurement(misfire=True, limits={"p_max_bar": 40.0, "nox_ppm": 0.0})))
    cycle(guard, -11.5)
    assert guard.good == START


def test_what_the_plant_clamps_itself_comes_back_and_is_what_proved_good():
    guard = guard_of(Engine(answer=Measurement(limits={"p_max_bar": 100.0}, applied={"rail_bar": 500.0})))
    assert cycle(guard, 1.0, 800.0) == {"soc_cad": 1.0, "rail_bar": 500.0}
    assert guard.good == {"soc_cad": 1.0, "rail_bar": 500.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": {"soc_cad": 0.0}}, "rail_bar: needs a start and bounds"),
        ({"bounds": {"soc_cad": (0.0, 5.0)}}, "rail_bar: needs a start and bounds"),
        ({"start": {**START, "rail_bar": 200.0}}, "start\\['rail_bar'\\] = 200: must be in"),
        ({"start": {**START, "rail_bar": math.nan}}, "rail_bar"),
        ({"bounds": {**BOUNDS, "soc_cad": (5.0, 5.0)}}, "bounds\\['soc_cad'\\]"),
        ({"bounds": {**BOUNDS, "soc_cad": (-math.inf, 5.0)}}, "bounds\\['soc_cad'\\]"),
        ({"rates": {"soc_cad": 0.0}}, "rates\\['soc_cad'\\] = 0: must be > 0"),
        ({"rates": {"soc_cd": 1.0}}, "rates: unknown name 'soc_cd': did you mean 'soc_cad'"),
        ({"limits": [Limit("p_max", 1.0)]}, "limits: unknown name 'p_max'"),
        ({"hold_cycles": 0}, "hold_cycles = 0"),
    ],
)
def test_a_guard_that_cannot_guard_is_refused(change, message):
    with pytest.raises(ParameterError, match=message):
        guard_of(**change)


def test_wrong_names_are_errors_and_nothing_is_applied():
    engine = Engine()
    guard = guard_of(engine)
    with pytest.raises(RigError, match="apply the inputs first"):
        guard.measure()
    with pytest.raises(ParameterError, match="must be soc_cad, rail_bar"):
        guard.apply({"soc_cad": 1.0})
    assert engine.applied == []


@pytest.mark.parametrize("kind", [ExtremumSeeking, Spsa])
def test_a_seeker_below_a_guard_keeps_the_bounds_and_learns_from_what_was_applied(kind):
    upper = 82.0
    bench = VirtualEngine(limits=["p_max_bar"], seed=3)
    guard = ActuatorGuard(
        bench,
        start={"soc_cad": 2.0},
        bounds={"soc_cad": (-7.0, 10.0)},
        rates={"soc_cad": 1.5},
        limits=[Limit("p_max_bar", upper)],
    )
    run = run_seeker(SimulatedRig(guard), kind(start=2.0, bounds=(-30.0, 10.0)), 600)
    applied = run.dataset["applied"][:, 0].to_numpy()
    assert applied.min() >= -7.0
    asked = run.dataset["asked"][:, 0].to_numpy()
    changed = [entry.cycle for entry in guard.log if entry.asked != entry.applied]
    assert np.array_equal(np.flatnonzero(asked != applied), changed)
    assert guard.counts["limit"] > 0
    over = run.dataset["p_max_bar"].to_numpy() > upper
    assert over.sum() > 10
    for k in np.flatnonzero(over[:-1]):
        assert applied[k + 1] == 2.0 or applied[k + 1] in applied[: k + 1][~over[: k + 1]]


numbers = st.one_of(st.floats(), st.floats(-13.0, 11.0))


@settings(max_examples=300)
@given(
    asks=st.lists(st.tuples(numbers, st.one_of(st.floats(), st.floats(250.0, 1500.0))), min_size=1, max_size=40),
    delay=st.integers(0, 3),
    rate=st.floats(0.1, 30.0),
)
def test_whatever_is_asked_what_is_applied_lies_in_the_bounds_and_after_an_excess_is_a_proven_point(asks, delay, rate):
    engine = Engine(delay=delay)
    limit = Limit("p_max_bar", 125.0, delay_cycles=float(delay))
    guard = guard_of(engine, limits=[limit], rates={"soc_cad": rate})
    proven, was_over, before = [START], False, START
    for soc, rail in asks:
        guard.apply({"soc_cad": soc, "rail_bar": rail})
        applied = engine.applied[-1]
        for name, (lower, upper) in BOUNDS.items():
            assert lower <= applied[name] <= upper
        if was_over:
            assert applied in proven
        if applied not in proven:
            assert abs(applied["soc_cad"] - before["soc_cad"]) <= rate * (1.0 + 1e-12)
        measured = guard.measure()
        assert measured.applied == applied
        assert guard.good in [*proven, *engine.applied]
        assert engine.pressure(guard.good) <= 125.0
        proven.append(guard.good)
        was_over, before = measured.limits["p_max_bar"] > 125.0, applied
