"""Laws of the independent throttles that identification is measured on."""

from __future__ import annotations

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


@pytest.mark.parametrize("delay", [1, 2, 3])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_delay_is_exact(family: str, delay: int) -> None:
    duty = [0.3] * 40 + [-0.2] * 60 + [0.5] * 80
    prompt = run(Bench(KINDS[family], angle_deg=20.0), duty)
    late = run(Bench(replace(KINDS[family], delay_samples=delay), angle_deg=20.0), [*duty, *[0.5] * delay])
    waiting = Bench(KINDS[family], angle_deg=20.0)
    run(waiting, [0.0] * delay)
    np.testing.assert_array_equal(late[delay:], run(waiting, duty))
    assert np.ptp(prompt) > 10.0


def test_the_current_follows_the_voltage_by_its_time_constant() -> None:
    bench = Bench(BODY, angle_deg=BODY.limp_home_deg)
    run(bench, [0.1] * 2)  # the plate stays: below breakaway
    lag = BODY.inductance_h / BODY.resistance_ohm
    expected = 0.1 * BODY.supply_v / BODY.resistance_ohm * (1.0 - math.exp(-2e-3 / lag))
    assert bench.current_a == pytest.approx(expected, rel=1e-12)


def test_the_motor_crosses_the_gap_before_the_plate_moves() -> None:
    body = replace(KINDS["backlash"], preload_above=0.0, preload_below=0.0, spring_above=0.0, spring_below=0.0)
    bench = Bench(body, angle_deg=40.0)
    while bench.angle_deg < 45.0:
        bench.sample(0.2)
    run(bench, [0.0] * 300)
    assert bench.speed_rad_per_s == 0.0
    assert bench.lead_deg == pytest.approx(body.half_gap_deg, abs=0.05)
    rest = bench.angle_deg
    while bench.lead_deg > -0.95 * body.half_gap_deg:
        bench.sample(-0.09)
        assert abs(bench.angle_deg - rest) < 1e-6, "the plate stays while the motor crosses"


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
        assert body.viscous > 0.0
        gain = math.degrees(body.stall_nm / body.inertia_kgm2)
        assert groups["gain_deg_per_s2_per_duty"] == pytest.approx(gain, rel=1e-12)
        damping = body.viscous + body.motor_nm_per_a**2 / body.resistance_ohm
        assert groups["tau_s"] == pytest.approx(body.inertia_kgm2 / damping, rel=1e-12)
        assert groups["electrical_s"] == pytest.approx(body.inductance_h / body.resistance_ohm, rel=1e-12)


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
