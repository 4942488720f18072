"""Mgdd1 guided by an object of Python: the duties of the same model in the core, errors of the object, state."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from mgdd.control import Mgdd1, Pid
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.loop import track, track_many
from mgdd.throttle import PseudoWiener, Throttle


class PlateInPython:
    """PW-R with smooth friction, written from its equations: position from limp-home, speed, bias, delayed duty."""

    n_states = 4

    def __init__(self, model: PseudoWiener) -> None:
        self.p = dict(model.parameters)
        self.sample_s = self.p["sample_s"]
        assert self.p["delay_samples"] == 1.0
        assert self.p["above_square_per_deg"] == 0.0

    def at_rest(self, angle_deg: float) -> list[float]:
        return [angle_deg - self.p["limp_home_deg"], 0.0, 0.0, 0.0]

    def step(self, state: Any, duty: float) -> list[float]:
        p = self.p
        x, w, bias, late = state
        h = p["sample_s"] / p["substeps"]
        for _ in range(int(p["substeps"])):
            side = "above" if x >= 0.0 else "below"
            tau, gain, preload, spring, level = (
                p[f"{side}_{name}"]
                for name in (
                    "tau_s",
                    "gain_deg_per_s2_per_duty",
                    "preload_duty",
                    "spring_duty_per_deg",
                    "coulomb_duty",
                )
            )
            share = min(max(x / p["ramp_deg"], -1.0), 1.0)
            inside = abs(x) <= p["ramp_deg"]
            push = w + h * gain * (late - bias - preload * share - spring * x)
            still = 1.0 + h / tau + h * h * gain * (spring + (preload / p["ramp_deg"] if inside else 0.0))
            t = math.tanh(w / p["tanh_deg_per_s"])
            slope = h * gain * level / p["tanh_deg_per_s"] * (1.0 - t * t)
            w = (push - h * gain * level * t + slope * w) / (still + slope)
            moved = x + h * w
            x = min(max(moved, p["closed_deg"] - p["limp_home_deg"]), p["open_deg"] - p["limp_home_deg"])
            w = w if moved == x else 0.0
        return [x, w, bias, duty]

    def output(self, state: Any) -> float:
        return float(state[0] + self.p["limp_home_deg"])

    def correct(self, state: Any, angle_deg: float) -> list[float]:
        x, w, bias, late = state
        error = angle_deg - self.p["limp_home_deg"] - x
        lowest, highest = (self.p[end] - self.p["limp_home_deg"] for end in ("closed_deg", "open_deg"))
        bias = min(max(bias - 0.004 * error, -0.4), 0.4)
        return [min(max(x + 0.35 * error, lowest), highest), w + 35.0 * error, bias, late]


def plate() -> PseudoWiener:
    return PseudoWiener(
        "pw_r",
        {"delay_samples": 1.0, "ramp_deg": 0.5, "tanh_deg_per_s": 40.0, "substeps": 1.0, "below_coulomb_duty": 0.08},
        friction="tanh",
    )


@pytest.mark.parametrize("reference", ["step:20:60", "step:12:4"])
def test_a_model_in_python_gives_the_duties_of_the_same_in_the_core(reference: str) -> None:
    settings: dict[str, Any] = {"horizon_samples": 12, "adaptation_gain": 0.7, "delay_samples": 0}
    in_core = track(Mgdd1(plate(), **settings), reference, seed=3)["duty"].to_numpy()
    in_python = track(Mgdd1(PlateInPython(plate()), **settings), reference, seed=3)["duty"].to_numpy()
    assert np.abs(in_core - in_python).max() < 1e-9
    assert np.ptp(in_core) > 0.3


class Moody(PlateInPython):
    """Works until it is told to break."""

    def __init__(self, method: str) -> None:
        super().__init__(plate())
        self.method, self.answer, self.left = method, None, -1

    def _mood(self, method: str, good: Any) -> Any:
        if method != self.method or self.left < 0:
            return good
        self.left -= 1
        if self.left >= 0:
            return good
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def at_rest(self, angle_deg: float) -> Any:
        return self._mood("at_rest", super().at_rest(angle_deg))

    def step(self, state: Any, duty: float) -> Any:
        return self._mood("step", super().step(state, duty))

    def output(self, state: Any) -> Any:
        return self._mood("output", super().output(state))

    def correct(self, state: Any, angle_deg: float) -> Any:
        return self._mood("correct", super().correct(state, angle_deg))


@pytest.mark.parametrize("method", ["step", "output", "correct"])
@pytest.mark.parametrize("late", [0, 1, 17])
@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (KeyError("lost"), KeyError),
        (math.nan, (DataError, ShapeError)),
        ([1.0, math.inf, 0.0, 0.0], (DataError, ShapeError)),
        ("nonsense", ValueError),
    ],
)
def test_what_goes_wrong_in_a_guide_comes_out_and_changes_nothing(
    method: str, late: int, answer: Any, error: Any
) -> None:
    guide = Moody(method)
    broken, sound = Mgdd1(guide), Mgdd1(PlateInPython(plate()))
    for k in range(30):
        measured = 20.0 + math.sin(0.3 * k)
        if k in (4, 20):
            before, duty = broken.state, broken.duty
            guide.answer, guide.left = answer, 0 if method == "correct" else late
            with pytest.raises(error):
                broken.step(30.0, measured)
            assert broken.state == before
            assert broken.duty == duty
            guide.left = -1
        assert broken.step(30.0, measured) == sound.step(30.0, measured)


def test_a_prediction_that_is_not_finite_is_named() -> None:
    guide = Moody("output")
    controller = Mgdd1(guide)
    controller.step(30.0, 20.0)
    guide.answer, guide.left = math.nan, 3
    with pytest.raises(DataError, match=r"output gave nan"):
        controller.step(30.0, 20.0)
    guide = Moody("at_rest")
    controller = Mgdd1(guide)
    guide.answer, guide.left = [1.0, 2.0], 0
    with pytest.raises(ShapeError, match=r"at_rest gave 2 numbers: must give 4"):
        controller.step(30.0, 20.0)
    assert controller.step(30.0, 20.0) == Mgdd1(PlateInPython(plate())).step(30.0, 20.0)


def test_its_run_goes_on_bit_for_bit() -> None:
    first, second = Mgdd1(PlateInPython(plate())), Mgdd1(PlateInPython(plate()))
    for k in range(40):
        measured = 20.0 + 0.5 * k
        if k == 25:
            second.state = first.state
        duty = first.step(50.0, measured)
        if k >= 25:
            assert second.step(50.0, measured) == duty
    thawed = pickle.loads(pickle.dumps(first))
    assert thawed.step(50.0, 41.0) == first.step(50.0, 41.0)
    first.reset()
    assert first.step(50.0, 20.0) == Mgdd1(PlateInPython(plate())).step(50.0, 20.0)


def test_what_is_not_a_guide_is_refused() -> None:
    class Half(PlateInPython):
        output = None  # type: ignore[assignment]

    with pytest.raises(ParameterError, match="output"):
        Mgdd1(Half(plate()))
    with pytest.raises(ParameterError, match="guide"):
        Mgdd1(object())
    for name, value in (("n_states", 0), ("n_states", 33), ("n_states", 2.0), ("sample_s", 0.0), ("sample_s", "1 ms")):
        guide = PlateInPython(plate())
        setattr(guide, name, value)
        with pytest.raises(ParameterError, match=name):
            Mgdd1(guide)
    with pytest.raises(ParameterError, match="track"):
        track_many({"pid": Pid(), "own": Mgdd1(PlateInPython(plate()))}, ["step:40:42"], [Throttle()])
