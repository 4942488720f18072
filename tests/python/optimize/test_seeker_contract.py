"""What every stepped seeker bears, whichever there are: bad readings, actuators, failing starts, dead channels."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.errors import ParameterError
from mgdd.optimize import Seeker, Spsa

BEST, START = 4.0, -8.0
SEEKERS = stepped(start=START, bounds=(-20.0, 20.0))
every = pytest.mark.parametrize("name", SEEKERS)
# Their own rules for readings, actuators and failing inputs are tested with them.
OWN_LIKELIHOOD = {"GaussianProcessSeeking", "CurveSeeking"}
shared = pytest.mark.parametrize("name", sorted(set(SEEKERS) - OWN_LIKELIHOOD))

LIMITED = stepped(start=START, bounds=(-20.0, 20.0), limits={"p_max_bar": 100.0})
Actuator = Callable[[float], float]


def lag(cycles: float) -> Actuator:
    at = START

    def apply(asked: float) -> float:
        nonlocal at
        at += (1.0 - math.exp(-1.0 / cycles)) * (asked - at)
        return at

    return apply


def steps(width: float) -> Actuator:
    return lambda asked: width * round(asked / width)


def j_at(applied: float, rng: np.random.Generator) -> float:
    return float(50.0 - 0.03 * (applied - BEST) ** 2 + rng.normal(0.0, 0.3))


def search(
    seeker: Any,
    cycles: int = 500,
    actuator: Actuator | None = None,
    bad: dict[int, float] | None = None,
    works: Callable[[float], bool] = math.isfinite,
) -> tuple[float, int]:
    """Mean of the last hundred estimates, and how many cycles failed."""
    rng, estimates, failed = np.random.default_rng(3), [], 0
    for cycle in range(cycles):
        asked = float(np.ravel(seeker.ask())[0])
        applied = asked if actuator is None else actuator(asked)
        if works(applied):
            j = (bad or {}).get(cycle, j_at(applied, rng))
            seeker.tell(j, **({} if actuator is None else {"applied": applied}))
        else:
            failed += 1
            seeker.tell(misfire=True, **({} if actuator is None else {"applied": applied}))
        estimates.append(float(seeker.estimate[0]))
    return float(np.mean(estimates[-100:])), failed


def codes(seeker: Any) -> list[str]:
    return [finding.code for finding in seeker.findings]


def test_the_finder_finds_every_kind_of_seeker() -> None:
    assert {SEEKERS[name]().kind for name in SEEKERS} == {one.kind for one in Seeker.__subclasses__()}
    assert {"Spsa second_order", "ExtremumSeeking washout", "CurveSeeking"} <= set(SEEKERS)


@shared
@pytest.mark.parametrize(
    "bad", [{0: 0.0}, {0: 1e6}, {0: -1e30, 1: 1e30}, {1: 20.0, 2: 20.0, 3: 20.0}, {7: 0.0}, {60: 1e6}], ids=str
)
def test_a_bad_reading_does_not_lead_a_seeker_away(name: str, bad: dict[int, float]) -> None:
    assert search(SEEKERS[name](), bad=bad)[0] == pytest.approx(BEST, abs=3.0)


@every
@pytest.mark.parametrize("rest", [0.0, 1e-9])
@pytest.mark.parametrize("cycles", [4, 8, 30])
def test_a_channel_that_stands_still_at_first_does_not_set_the_scale(name: str, cycles: int, rest: float) -> None:
    rng = np.random.default_rng(1)
    still = {cycle: 48.0 + rest * rng.standard_normal() for cycle in range(cycles)}
    assert search(SEEKERS[name](), bad=still)[0] == pytest.approx(BEST, abs=3.0)


@shared
@pytest.mark.parametrize("bad", [{0: 1e6}, {2: 1e6}, {2: 0.0}, {60: 1e6}, {60: 0.0}], ids=str)
def test_a_bad_reading_of_a_limit_neither_breaks_it_nor_holds_a_seeker_back(name: str, bad: dict[int, float]) -> None:
    """Pressure rises by 2 bar a unit: the limit lies at 0, the best at 4."""
    seeker, rng = LIMITED[name](), np.random.default_rng(2)
    above = 0
    for cycle in range(400):
        asked = float(np.ravel(seeker.ask())[0])
        above += asked > 1.0
        seeker.tell(j_at(asked, rng), [bad.get(cycle, 100.0 + 2.0 * asked + rng.normal(0.0, 0.5))])
    assert above <= 40
    assert float(seeker.estimate[0]) == pytest.approx(0.0, abs=2.5)
    assert "limit_delay" not in codes(seeker)


@shared
@pytest.mark.parametrize(("kind", "size"), [(lag, 1.0), (lag, 4.0), (steps, 4.0)])
def test_what_an_actuator_really_did_does_not_stop_a_seeker(
    name: str, kind: Callable[[float], Actuator], size: float
) -> None:
    assert search(SEEKERS[name](), 900, kind(size))[0] == pytest.approx(BEST, abs=4.5)


@every
@pytest.mark.parametrize("low", [-2.0, 2.0])
def test_a_start_that_fails_is_left_for_what_works(name: str, low: float) -> None:
    estimate, failed = search(SEEKERS[name](), works=lambda applied: applied > low)
    assert estimate == pytest.approx(BEST, abs=3.0)
    assert failed < 60


@shared
def test_a_start_that_works_is_found_where_all_else_fails(name: str) -> None:
    seeker = SEEKERS[name]()
    estimate, failed = search(seeker, works=lambda applied: abs(applied - START) < 1.7)
    assert estimate == pytest.approx(START, abs=1.8)
    assert failed < 60


@every
def test_a_channel_that_reads_the_same_at_every_input_is_said(name: str) -> None:
    seeker, rng = SEEKERS[name](), np.random.default_rng(1)
    for _ in range(60):
        seeker.tell(j_at(float(np.ravel(seeker.ask())[0]), rng))
    assert "frozen" not in codes(seeker)
    for _ in range(60):
        seeker.ask()
        seeker.tell(49.88)
    (found,) = [finding for finding in seeker.findings if finding.code == "frozen"]
    assert found.names == ("J",)
    assert str(found).startswith("J read the same to the last bit in ")


def test_a_limit_that_moves_again_after_a_floor_is_no_dead_channel() -> None:
    seeker, rng = Spsa(start=0.0, limits={"p_max_bar": 100.0}), np.random.default_rng(1)
    for cycle in range(40):
        seeker.tell(j_at(float(seeker.ask()[0]), rng), [80.0 if cycle < 30 else 80.0 + rng.normal()])
    assert "frozen" not in codes(seeker)


def test_a_limit_that_reads_the_same_is_said_by_its_name() -> None:
    seeker, rng = Spsa(start=0.0, limits={"p_max_bar": 100.0}), np.random.default_rng(1)
    for _ in range(20):
        seeker.tell(j_at(float(seeker.ask()[0]), rng), [80.0])
    assert [finding.names for finding in seeker.findings if finding.code == "frozen"] == [("p_max_bar",)]


@every
def test_an_input_of_which_little_is_applied_is_said(name: str) -> None:
    seeker = SEEKERS[name]()
    search(seeker, 120, lambda _: START)
    assert "not_followed" in codes(seeker)
    as_asked = SEEKERS[name]()
    search(as_asked, 120, lambda asked: asked)
    assert "not_followed" not in codes(as_asked)


def path(make: Callable[[], Any], scale: float = 1.0, missing: int = 0, *, says: bool = False) -> list[float]:
    """What is asked over eighty cycles; every so many, where given, nothing is read."""
    seeker, rng, asked = make(), np.random.default_rng(7), []
    for cycle in range(80):
        asked.append(float(np.ravel(seeker.ask())[0]))
        assert float(np.ravel(seeker.ask())[0]) == asked[-1]
        j = scale * j_at(asked[-1], rng)
        applied = {"applied": asked[-1]} if says else {}
        if missing and cycle % missing == missing - 1:
            seeker.tell(misfire=True, **applied)
        else:
            seeker.tell(j, **applied)
        with pytest.raises(ParameterError, match="tell without ask"):
            seeker.tell(j)
        assert min(asked) >= -20.0
        assert max(asked) <= 20.0
    return asked


@every
def test_what_is_asked_is_the_same_again_and_within_bounds(name: str) -> None:
    assert path(SEEKERS[name]) == path(SEEKERS[name])
    assert path(SEEKERS[name], missing=5, says=True) == path(SEEKERS[name], missing=5)
    assert np.isfinite(path(SEEKERS[name], missing=1)).all()


@every
def test_another_unit_of_j_is_the_same_search(name: str) -> None:
    if name in {"GoldenSection", "CurveSeeking"}:
        pytest.skip("is given the noise or a curve in the unit of J")
    close = 1e-3 if name == "GaussianProcessSeeking" else 1e-6  # the top of a smooth J is known to a root of rounding
    np.testing.assert_allclose(path(SEEKERS[name], scale=1024.0), path(SEEKERS[name]), rtol=1e-6, atol=close)


@every
def test_minimising_is_maximising_the_negative(name: str) -> None:
    one = SEEKERS[name]()
    assert path(lambda: type(one)(**{**one.settings, "maximize": False}), scale=-1.0) == path(SEEKERS[name])
