"""Seekers that a user writes: those of the page run as any other, and keep what their authors promise."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.engine import OperatingPoint
from mgdd.errors import ParameterError, ShapeError
from mgdd.loop import VirtualEngine, seek

PAGE = Path(__file__).resolve().parents[2] / "docs" / "own_seeker.md"
BOUNDS = {"soc_cad": (-25.0, 10.0)}


@pytest.fixture(scope="module")
def page() -> dict[str, Any]:
    """Run what the page shows, top to bottom, and give its names."""
    names: dict[str, Any] = {}
    for block in re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        exec(block, names)  # noqa: S102
    return names


def test_seekers_of_the_page_find_the_best_and_go_on(page: dict[str, Any]) -> None:
    assert abs(page["found"].inputs["soc_cad"] + 5.63) < 1.5
    assert page["found"].findings == ()
    assert page["more"].seeker.cycle == 500
    assert page["more"].run.dataset.sizes["cycle"] == 100
    two = seek(page["plant"], page["two"], seeker=page["found"].seeker.own.__class__(
        [-12.0, 25.0], ([-25.0, 0.0], [15.0, 40.0]), kappa=0.5, period=40, harmonics=(4, 5)), cycles=900)  # fmt: skip
    for inputs in (page["seeker"].estimate, list(two.inputs.values())):
        np.testing.assert_allclose(inputs, [-4.0, 15.0], atol=1.0)


@pytest.mark.parametrize("scale", [1.0, 5.0])
def test_the_newton_form_does_not_mind_the_scale_of_j(page: dict[str, Any], scale: float) -> None:
    seeker, estimates, hessians = page["NewtonSeeking"](12.0, (-30.0, 30.0), hessian=-0.051), [], []
    for _ in range(700):
        seeker.tell(-scale * 0.5 * 0.051 * seeker.ask()[0] ** 2)
        estimates.append(float(seeker.estimate[0]))
        hessians.append(seeker.hessian[0, 0])
    assert estimates[298] == 12.0
    assert np.mean(hessians[289:299]) == pytest.approx(-scale * 0.051, rel=0.01)
    assert int(np.argmax(np.abs(estimates) <= 1.0)) == pytest.approx(299 + 117, abs=4)


def test_the_bounded_form_never_steps_beyond_amplitude_times_omega(page: dict[str, Any]) -> None:
    seeker, rng, asked = page["BoundedSeeking"](0.0, (-30.0, 30.0)), np.random.default_rng(2), []
    for _ in range(2000):
        asked.append(float(seeker.ask()[0]))
        seeker.tell(rng.normal(0.0, 1e3))
    assert 0.6 < np.abs(np.diff(asked)).max() <= 0.2 * np.pi * (1.0 + 1e-12)


class Walk:
    """Steps towards what was better; takes everything that a loop can tell."""

    def __init__(self, start: float) -> None:
        self.estimate, self.best, self.told = start, -np.inf, list[dict[str, Any]]()
        self.restarts, self.rng = 0, np.random.default_rng(1)

    def ask(self) -> float:
        self.trial = self.estimate + self.rng.normal(0.0, 1.0)
        return self.trial

    def tell(self, J: float, limits: Any = None, *, misfire: bool = False, applied: Any = None) -> None:  # noqa: N803
        self.told.append({"j": J, "limits": limits, "misfire": misfire, "applied": applied})
        if not misfire and self.best < J and (limits is None or limits[0] <= 3.0):
            self.estimate, self.best = self.trial, J

    def restart(self) -> None:
        self.restarts += 1


def test_an_object_is_told_what_it_takes() -> None:
    walk = Walk(8.0)

    def plant(x: Any) -> Any:
        return None if x["a"] > 9.0 else ((x["a"] - 2.0) ** 2, {"p": 3.5 - x["a"] / 8.0})

    found = seek(plant, {"a": (-20.0, 20.0)}, seeker=walk, limits={"p": 3.0}, maximize=False, cycles=200)
    assert found.inputs["a"] == pytest.approx(4.0, abs=0.5)  # where the limit holds
    assert found.limits["p"] == pytest.approx(3.0, abs=0.2)
    assert {one["misfire"] for one in walk.told} == {True, False}
    assert walk.told[-1]["j"] < 0.0  # minimised


def test_a_failed_cycle_is_asked_again_and_a_new_point_is_a_restart(page: dict[str, Any]) -> None:
    seeker = page["BoundedSeeking"](-12.0, (-25.0, 10.0))
    bench = VirtualEngine(seed=2, limits=["p_max_bar"], misfire_probability=0.1)
    found = seek(bench, BOUNDS, seeker=seeker, cycles=500)
    assert abs(found.inputs["soc_cad"] + 5.63) < 2.0
    assert 20 < 500 - seeker.k == int(found.run.dataset["misfire"].sum())
    walk, points = Walk(-12.0), [(0, OperatingPoint()), (20, OperatingPoint(fuel_mg=26.0))]
    found = seek(VirtualEngine(schedule=points), BOUNDS, seeker=walk, cycles=30)
    assert (found.seeker.kind, walk.restarts, found.seeker.own is walk) == ("Walk", 1, True)


def test_an_object_that_cannot_seek_is_refused_by_what_it_lacks() -> None:
    with pytest.raises(ShapeError, match="its estimate has 1 entries: must have 2"):
        seek(lambda _: 0.0, {"a": (0.0, 1.0), "b": (0.0, 1.0)}, seeker=Walk(0.0))
    with pytest.raises(ParameterError, match="inputs: none given"):
        seek(VirtualEngine(), seeker=Walk(0.0))
    with pytest.raises(ParameterError, match="start: the seeker given has its own"):
        seek(VirtualEngine(), BOUNDS, seeker=Walk(0.0), start=1.0)
    with pytest.raises(ParameterError, match="seeker"):
        seek(VirtualEngine(), BOUNDS, seeker=object())
