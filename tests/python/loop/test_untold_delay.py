"""A loop whose delay is longer than it was stated, on throttles that share no code with the package."""

from dataclasses import replace
from typing import Any

import pytest

from independent_throttle import FAMILIES
from mgdd.control import GuidedPredictive
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.loop import Reference, track, tuned_controller
from throttle_bodies import BodyPlate, draw_body, known_of

_REFERENCE = Reference.parse("step:22:57")


def _controller(family: str, **settings: Any) -> tuple[GuidedPredictive, BodyPlate, int]:
    """Give a controller that knows a body within 20 %, the body at 22 deg, and its true delay."""
    body = replace(draw_body(family, 5), delay_samples=1)
    known = known_of(body, 3)
    model = FirstPrincipleModel(parameters=known, closed_deg=body.closed_deg, open_deg=body.open_deg)
    made = tuned_controller("guided", model, noise_deg=body.noise_deg)
    assert isinstance(made, GuidedPredictive)
    return GuidedPredictive(**(made.settings | settings)), BodyPlate(body, 22.0), body.delay_samples


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("later", [3, 5])
def test_a_delay_that_was_not_stated_is_found_in_the_first_step(family: str, later: int) -> None:
    controller, plate, delay = _controller(family)
    run = track(controller, _REFERENCE, throttle=plate, delay_samples=delay + later, noise_deg=0.03, seed=4)
    assert abs(controller.delay_found_samples - delay - later) <= 1
    assert run.attrs.get("findings") is None
    assert float(run["settling_ms"]) < 200.0
    assert float(run["limit_cycle_deg"]) < 0.3


@pytest.mark.parametrize("family", FAMILIES)
def test_without_the_search_it_swings(family: str) -> None:
    blind, plate, delay = _controller(family, delay_search_samples=0)
    run = track(blind, _REFERENCE, throttle=plate, delay_samples=delay + 5, noise_deg=0.03, seed=4)
    assert "the plate swings by" in str(run.attrs["findings"])
