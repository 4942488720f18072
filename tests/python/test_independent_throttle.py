"""Laws of the independent throttles that identification is measured on."""

import ast
import math
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import independent_throttle
import throttle_bodies
from independent_throttle import FAMILIES, Bench, Body
from throttle_bodies import draw_body, forty_bodies, make_logs

pytestmark = pytest.mark.slow

BODY = Body()
KINDS = {
    "coulomb": BODY,
    "stribeck": replace(BODY, family="stribeck", static_nm=0.36, stribeck_rad_per_s=0.25),
    "lugre": replace(BODY, family="lugre", static_nm=0.34, stribeck_rad_per_s=0.25),
    "backlash": replace(BODY, family="backlash", half_gap_deg=0.2),
}


def run(bench: Bench, duty: list[float]) -> np.ndarray:
    return np.array([bench.sample(u) for u in duty])


@pytest.mark.parametrize("module", [independent_throttle, throttle_bodies])
def test_it_shares_no_code_with_the_package(module: ModuleType) -> None:
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert names <= {"__future__", "dataclasses", "independent_throttle", "math", "numpy"}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("angle_deg", "speed"), [(70.0, 20.0), (2.0, 15.0), (12.0, -25.0)])
def test_energy_never_rises_without_input(family: str, angle_deg: float, speed: float) -> None:
    bench = Bench(KINDS[family], angle_deg=angle_deg, speed_rad_per_s=speed)
    energy = [bench.energy_j()]
    for _ in range(600):
        bench.sample(0.0)
        energy.append(bench.energy_j())
    lowest = np.minimum.accumulate(energy)
    assert np.max(energy - lowest) < 1e-4 * energy[0]
    assert energy[-1] < 0.2 * energy[0]


@pytest.mark.parametrize("family", FAMILIES)
def test_without_springs_a_held_duty_ends_at_its_terminal_speed(family: str) -> None:
    body = replace(
        KINDS[family], spring_above=0.0, spring_below=0.0, preload_above=0.0, preload_below=0.0,
        closed_deg=-4000.0, open_deg=4000.0,
    )  # fmt: skip
    for duty in (0.31, -0.44):
        bench = Bench(body, angle_deg=0.0)
        run(bench, [duty] * 600)
        torque = abs(duty) * body.stall_nm - body.coulomb_nm
        expected = math.copysign(torque / (body.viscous + body.motor_nm_per_a**2 / body.resistance_ohm), duty)
        assert bench.speed_rad_per_s == pytest.approx(expected, rel=1e-4), duty


def test_forty_bodies_are_the_same_ones_every_time_and_all_different() -> None:
    bodies = forty_bodies()
    assert bodies == forty_bodies()
    assert len(set(bodies)) == 40
    for family in FAMILIES:
        own = [body for body in bodies if body.family == family]
        assert len(own) == 10
        assert {body.delay_samples for body in own} == {0, 1, 2, 3}
    for body in bodies:
        groups = body.groups()
        assert min(groups["beta_above_duty"], groups["beta_below_duty"]) * body.stall_nm > 1.1 * body.static_nm


def test_a_log_starts_at_rest_visits_both_sides_and_is_read_by_a_noisy_converter() -> None:
    body = draw_body("stribeck", 5)
    train, test = make_logs(body, 5)
    again, _ = make_logs(body, 5)
    for one, other in zip(train, again, strict=True):
        np.testing.assert_array_equal(one, other)
    for time, duty, angle in (train, test):
        assert np.ptp(angle[:200]) < 0.4
        assert np.all(np.abs(duty) <= 1.0)
        np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)
        for there in (angle > body.limp_home_deg + 15.0, angle < body.limp_home_deg - 2.0):
            assert 0.02 < np.mean(there) < 0.97
        steps = angle / body.converter_deg
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
        assert 0.01 < np.std(np.diff(angle[:200])) < 0.2
    assert not np.array_equal(train[1][:5000], test[1][:5000])
