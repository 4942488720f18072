"""A run that swings says so: by its own crossings, whatever the controller and the plant, and no other run does."""

from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.loop import track, track_many, tuned_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.track import swinging

TIME = 1e-3 * np.arange(2000)


@pytest.mark.parametrize(("hertz", "times", "said"), [(12.0, 6, True), (12.0, 3, False), (2.0, 6, False)])
def test_quick_crossings_in_a_row_are_a_swing(hertz: float, times: int, said: bool) -> None:
    until = 0.2 + times / (2.0 * hertz)  # one crossing a half turn, the first while it leaves the middle
    error = np.where((TIME > 0.2) & (until > TIME), 0.8 * np.cos(2.0 * np.pi * hertz * (TIME - 0.2)), 0.0)
    found = swinging(np.full(TIME.size, 33.0), 33.0 + error, 1e-3)
    assert (found is not None) == said
    if found is not None:
        assert (found.code, f"{times} times" in found.text, "1.6 deg" in found.text) == ("oscillation", True, True)


@pytest.mark.parametrize("error", [0.2 * np.sin(80.0 * TIME), 3.0 * np.exp(-9.0 * TIME), np.zeros(TIME.size)])
def test_rest_noise_and_settling_are_none(error: np.ndarray) -> None:
    assert swinging(np.full(TIME.size, 33.0), 33.0 + error, 1e-3) is None


def test_a_reference_that_moves_is_crossed_by_what_lags_behind() -> None:
    reference = 40.0 + 10.0 * np.sin(2.0 * np.pi * 4.0 * TIME)
    assert swinging(reference, 40.0 + 10.0 * np.sin(2.0 * np.pi * 4.0 * TIME - 0.5), 1e-3) is None
    steps = np.repeat([40.0, 44.0] * 20, 50)
    assert swinging(steps, np.concatenate([np.full(3, 40.0), steps[:-3]]), 1e-3) is None


@pytest.mark.parametrize("kind", FAMILIES)
@pytest.mark.parametrize("reference", ["step:20:60", "step:40:42", "step:4:20"])
def test_a_loop_slower_than_its_controller_was_told_is_named(kind: str, reference: str) -> None:
    slow = track(tuned_controller(kind, "P2"), reference, throttle="P2", delay_samples=12, seed=3)
    assert float(slow["limit_cycle_deg"]) > 0.5
    assert "swings by" in slow.attrs["findings"]
    assert "tuned_controller" in slow.summary()
    right = track(tuned_controller(kind, "P2"), reference, throttle="P2", seed=3)
    assert "findings" not in right.attrs


class Relay:
    """An own plant, an integrator behind a bang-bang controller, whose dead time is three samples."""

    def __init__(self) -> None:
        self.output, self._sent = 20.0, [0.0, 0.0, 0.0]

    def step(self, duty: float) -> None:
        self._sent.append(duty)
        self.output += 0.6 * self._sent.pop(0)


class BangBang:
    """The other half."""

    def step(self, reference_deg: float, measurement_deg: float) -> float:
        return 1.0 if reference_deg > measurement_deg else -1.0


def test_own_plants_and_many_runs_are_judged_alike(caplog: pytest.LogCaptureFixture) -> None:
    assert "swings" in track(BangBang(), "step:20:60", throttle=Relay(), noise_deg=0.0).attrs["findings"]
    how: dict[str, Any] = {"delay_samples": 12}
    runs = track_many({"pid": tuned_controller("pid", "P1")}, ["step:20:60", "step:40:42"], ["P1", "P2"], **how)
    assert runs.attrs["findings"].startswith("4 of 4 runs swing")
    assert "findings" not in track_many({"pid": tuned_controller("pid", "P1")}, ["step:20:60"], ["P1"]).attrs
    strong = ["--plant-scale", "resistance_ohm=0.2", "--delay-samples", "12"]  # which the controller is not told
    main(["throttle", "track", "--controller", "pid", "--reference", "step:20:60", *strong])
    assert "the plate swings by" in caplog.text
