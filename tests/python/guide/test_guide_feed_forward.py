"""Feed-forward with a learnt trim from Python: guides of every kind, refusals, history and what it is made of."""

from __future__ import annotations

import logging
import math
from typing import Any

import numpy as np
import pytest

from mgdd.engine import OperatingPoint
from mgdd.errors import Error, ParameterError
from mgdd.guide import FeedForward
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.optimize import ComponentLag, ExtremumSeeking, Limit, Spsa
from mgdd.optimize.optimum import Optimum

SPACE: dict[str, Any] = {"start": -20.0, "bounds": (-30.0, 10.0)}


def plant(x: float, optimum: float, noise: float = 0.0) -> float:
    return 56.0 - 0.0255 * (x - optimum) ** 2 + noise


def curved(at: float) -> Optimum:
    return Optimum(inputs={"soc_cad": at}, objective="J", value=0.0, curvature=-0.051)


def run(ff: FeedForward, point: Any, optimum: float, cycles: int, rng: np.random.Generator | None = None) -> None:
    for _ in range(cycles):
        ff.at(point)
        noise = 0.0 if rng is None else 0.25 * rng.standard_normal()
        ff.tell(plant(float(ff.ask()[0]), optimum, noise))


@pytest.mark.parametrize(
    ("said", "curvature"),
    [(-9.0, False), (np.float64(-9.0), False), ([-9.0], False), (np.array([-9.0]), False), (curved(-9.0), True)],
)
def test_a_guide_may_answer_in_several_ways(said: Any, curvature: bool) -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda _: said, noise_sd=0.2)
    assert ff.at(20.0) == "followed"
    assert ff.at(20.0) == "same"
    assert ff.estimate == pytest.approx([-9.0])
    ff.tell(50.0) if ff.ask().size else None
    ff.guide = lambda _: curved(-3.0) if curvature else -3.0
    assert ff.at(40.0) == "followed"
    assert ff.testing == 1


@pytest.mark.parametrize("point", [OperatingPoint(), {"speed_rpm": 1500.0, "fuel_mg": 20.0}, (1500.0, 20.0), 20.0])
def test_the_guide_sees_the_point_as_it_was_given(point: Any) -> None:
    seen = []

    def guide(at: Any) -> float:
        seen.append(at)
        return -5.0

    ff = FeedForward(ExtremumSeeking(**SPACE), guide)
    run(ff, point, -5.0, 3)
    assert seen == [point]


@pytest.mark.parametrize("point", ["idle", object(), {"fuel_mg": "much"}, None])
def test_what_is_no_operating_point_is_refused(point: Any) -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda _: -5.0)
    with pytest.raises(ParameterError, match="point"):
        ff.at(point)
    assert ff.at(20.0) == "followed"


def test_a_point_that_is_not_finite_holds_what_stands(caplog: pytest.LogCaptureFixture) -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda _: -5.0)
    run(ff, 20.0, -5.0, 20)
    trust, state = ff.trust, ff.state
    with caplog.at_level(logging.WARNING):
        assert ff.at(math.nan) == "held"
    assert "not finite" in caplog.text
    assert (ff.trust, ff.state) == (trust, state)


def raising(_: Any) -> float:
    raise ZeroDivisionError("map has no cell")


@pytest.mark.parametrize(
    ("guide", "word"),
    [
        (raising, "ZeroDivisionError: map has no cell"),
        (lambda _: math.nan, "nan"),
        (lambda _: 10.5, "10.5"),
        (lambda _: -30.5, "-30.5"),
        (lambda _: [1.0, 2.0], "2.0"),
        (lambda _: "late", "late"),
        (lambda _: curved(math.inf), "inf"),
    ],
)
def test_a_guide_that_fails_is_refused_logged_and_believed_less(
    guide: Any, word: str, caplog: pytest.LogCaptureFixture
) -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda _: -5.0, noise_sd=0.25)
    run(ff, 20.0, -5.0, 60)
    estimate, good = float(ff.estimate[0]), ff.guide
    ff.guide = guide
    with caplog.at_level(logging.WARNING):
        assert ff.at(30.0) == "refused"
        assert word in caplog.text
        ff.tell(plant(float(ff.ask()[0]), -5.0))
        first = len(caplog.records)
        assert ff.at(30.0) == "refused"  # asked again in the next cycle, and not logged as loudly again
        assert len(caplog.records) == first
    assert ff.trust < 0.9
    assert ff.feed_forward == pytest.approx([-5.0])
    assert ff.estimate == pytest.approx([estimate])
    ff.tell(plant(float(ff.ask()[0]), -5.0))
    ff.guide = lambda at: curved(-8.5) if good is not None and at == 30.0 else -5.0
    assert ff.at(30.0) == "followed"  # late, but as at a new point: tested, and the whole move
    assert ff.testing == 1


def test_outside_of_its_range_the_last_feed_forward_is_held_at_full_trust() -> None:
    ff = FeedForward(
        ExtremumSeeking(**SPACE), lambda fuel: curved(-0.35 * fuel) if fuel < 35.0 else None, noise_sd=0.05
    )
    run(ff, 20.0, -7.0, 30)
    run(ff, 40.0, -7.0, 30)
    assert (ff.at(40.0), ff.trust) == ("held", 1.0)
    assert ff.feed_forward == pytest.approx([-7.0])
    run(ff, 30.0, -10.5, 2)
    assert ff.verdict == "confirmed"
    assert ff.feed_forward[0] == pytest.approx(-10.5, abs=0.3)


def test_small_changes_are_followed_and_calibrations_move_nothing() -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda fuel: -0.35 * fuel)
    run(ff, 20.0, -7.0, 25)
    before = float(ff.estimate[0])
    assert ff.at(20.4) == "followed"
    for moved_by in (-0.2 * 0.14, -0.36 * 0.14):
        ff.ask()
        assert ff.estimate[0] - before == pytest.approx(moved_by)
        ff.tell(misfire=True)
        assert ff.at(20.4) == "same"
    for _ in range(100):
        ff.ask()
        ff.tell(misfire=True)
    assert ff.estimate[0] - before == pytest.approx(-0.14)
    ff.guide = lambda fuel: -0.35 * fuel + 1.5
    asked = ff.ask()
    with pytest.raises(ParameterError, match="between ask"):
        ff.at(20.4)
    ff.tell(50.0)
    before = float(ff.estimate[0])
    assert ff.at(20.4) == "followed"
    assert ff.estimate == pytest.approx([before])
    assert asked.size == 1
    for expected in (1.0, 1.5, 1.5):
        ff.at(20.4)
        ff.ask()
        ff.tell(misfire=True)
        assert ff.feed_forward[0] == pytest.approx(-0.35 * 20.4 + expected)
    assert ff.estimate[0] == pytest.approx(before)


def test_history_says_what_came_from_the_guide_and_what_from_the_trim() -> None:
    rng = np.random.default_rng(3)
    ff = FeedForward(ExtremumSeeking(**SPACE), lambda fuel: curved(-0.35 * fuel + 1.0), noise_sd=0.25)
    run(ff, 12.0, -4.2, 100, rng)
    run(ff, 30.0, -10.5, 50, rng)
    history = ff.history
    assert history.sizes == {"cycle": 150, "input": 1}
    assert all({"units", "long_name"} <= set(v.attrs) for v in history.variables.values())
    estimate, forward, trim = (history[name].to_numpy()[:, 0] for name in ("estimate", "feed_forward", "trim"))
    np.testing.assert_allclose(estimate, forward + trim, atol=1e-12)
    assert history["guide_optimum"].to_numpy()[[0, 99, 100, 149], 0] == pytest.approx([-3.2, -3.2, -9.5, -9.5])
    assert history["testing"].to_numpy()[98:104].tolist() == [0, 0, 1, 2, 0, 0]
    assert history["point"].to_numpy()[[0, 99, 100]].tolist() == [1, 1, 2]
    applied = history["applied"].to_numpy()[:, 0]
    assert applied[101] - applied[100] == pytest.approx(-6.3)
    assert ((history["trust"] >= 0) & (history["trust"] <= 1)).all()
    assert FeedForward(ExtremumSeeking(**SPACE)).history.sizes["cycle"] == 0


def moved(fuel: float) -> Optimum:
    return curved(-0.35 * fuel + 1.0)


def test_a_state_that_does_not_fit_changes_nothing() -> None:
    ff = FeedForward(ExtremumSeeking(**SPACE), moved)
    run(ff, 12.0, -4.2, 15)
    before = ff.state
    broken: list[dict[str, Any]] = [
        FeedForward(Spsa(**SPACE), moved).state,
        {name: column for name, column in before.items() if name != "points"},
        {**before, "points": [1.0, 9.0]},
        {**before, "guide.trust": [1.5]},
    ]
    for state in broken:
        with pytest.raises(Error):
            ff.state = state
        assert ff.state == before


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"trust": 1.2}, "initial|trust"),
        ({"noise_sd": 0.0}, "noise_sd"),
        ({"calibration_rate": [1.0, 2.0]}, "calibration_rate"),
        ({"guide": 3.0}, "guide"),
        ({"seeker": "esc"}, "seeker"),
    ],
)
def test_refused_arguments_are_named(change: dict[str, Any], field: str) -> None:
    arguments: dict[str, Any] = {"seeker": ExtremumSeeking(**SPACE), "guide": moved, **change}
    with pytest.raises(Error, match=field):
        FeedForward(arguments.pop("seeker"), arguments.pop("guide"), **arguments)


@pytest.mark.parametrize(
    ("lags", "stages"),
    [
        ([(0.0, 0.0)], [1, 2, 0]),
        ([(0.0, 0.0), (1.0, 0.5)], [1, 1, 1, 1, 2, 2, 2, 2, 0]),  # three cycles until the slower one has settled
        ([(38.0, 25.0)], [0]),
    ],
)
def test_the_test_of_a_guide_waits_for_the_sensors(lags: list[tuple[float, float]], stages: list[int]) -> None:
    components = [ComponentLag(delay_cycles=delay, lag_cycles=lag) for delay, lag in lags]
    ff = FeedForward(ExtremumSeeking(components=components, **SPACE), moved, noise_sd=0.1)
    ff.at(12.0)
    for stage in stages:
        ff.at(30.0)
        assert ff.testing == stage
        ff.ask()
        ff.tell(np.full(len(lags), 50.0))


def test_several_inputs_move_together() -> None:
    seeker = ExtremumSeeking(start=[8.0, -6.0], bounds=(-40.0, 40.0), amplitude=[1.0, 0.5], period=20, harmonics=[2, 3])
    ff = FeedForward(seeker, lambda fuel: [0.1 * fuel, -0.2 * fuel], noise_sd=0.1, calibration_rate=[1.0, 2.0])
    ff.at(20.0)
    assert ff.estimate == pytest.approx([2.0, -4.0])
    for optimum, fuel in (([2.5, -4.5], 20.0), ([4.5, -8.5], 40.0)):
        for _ in range(40):
            ff.at(fuel)
            ff.tell(-0.05 * float(np.sum((ff.ask() - optimum) ** 2)))
    assert ff.feed_forward == pytest.approx([4.0, -8.0])


def test_the_loop_judges_the_limits_of_its_seeker() -> None:
    bench = VirtualEngine(limits=["p_max_bar"], seed=1)
    seeker = ExtremumSeeking(start=0.4, bounds=(-30.0, 10.0), limits=[Limit("p_max_bar", 95.0)])
    guided = FeedForward(seeker, lambda _: 0.0, trust=0.7)
    assert guided.settings["limits"][0].upper == 95.0
    assert (guided.settings["amplitude"], guided.settings["trust"]) == (seeker.settings["amplitude"], 0.7)
    run = run_seeker(bench, guided, 100)
    assert run.summary["limit_p_max_bar"] == 95.0
