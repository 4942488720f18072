"""A drive over the throttle: steady start, mass in the manifold, wanted torque, controllers, models that are wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mgdd.control import Pid, SlidingMode
from mgdd.errors import ParameterError, ShapeError
from mgdd.loop import simulate_drive
from mgdd.results.labels import check_labels
from mgdd.throttle import DemandChain, SensorPair, Throttle
from mgdd.throttle.characteristics import airflow_torque_nm

QUIET = SensorPair(noise_v=0.0, adc_bits=24)
CHAIN = DemandChain()


def tip_in(n: int = 1500, at: int = 300) -> np.ndarray:
    return np.where(np.arange(n) < at, 12.0, 55.0)


class Held:
    """Holds a duty, whatever it is told."""

    def __init__(self, duty: float) -> None:
        self.duty = duty

    def step(self, *_: float) -> float:
        return self.duty


def test_a_held_pedal_stays_at_its_steady_demand() -> None:
    run = simulate_drive(CHAIN, np.full(800, 30.0), 2400.0, sensors=QUIET)
    check_labels(run)
    steady = CHAIN.steady(30.0, 2400.0)
    np.testing.assert_allclose(run["reference_deg"], float(steady["opening_deg"].item()), atol=0.01)
    np.testing.assert_allclose(run["pressure_kpa"][0], float(steady["pressure_kpa"].item()), rtol=1e-9)
    np.testing.assert_allclose(run["torque_nm"], float(steady["wanted_torque_nm"].item()), atol=2.0)


def test_mass_that_came_in_and_did_not_go_out_is_in_the_manifold() -> None:
    run = simulate_drive(CHAIN, tip_in(), 2000.0, sensors=QUIET)
    net = (run["throttle_air_g_per_s"] - run["cylinder_air_g_per_s"]).to_numpy()
    came = np.sum(0.5 * (net[1:] + net[:-1])) * 1e-3
    rise = float(run["pressure_kpa"][-1] - run["pressure_kpa"][0])
    volume, gas = CHAIN.manifold_l, 287.055 * CHAIN.manifold_temperature_k
    assert came == pytest.approx(rise * volume / gas * 1e3, rel=5e-3)


@pytest.mark.parametrize("controller", [Pid, SlidingMode])
def test_the_engine_makes_the_wanted_torque(controller: type[Pid | SlidingMode]) -> None:
    run = simulate_drive(CHAIN, tip_in(), 2000.0, controller=controller(), sensors=QUIET)
    error = (run["torque_nm"] - run["wanted_torque_nm"]).to_numpy()
    assert abs(error[-200:]).max() < 1.5
    assert abs((run["pressure_kpa"] - run["wanted_pressure_kpa"]).to_numpy()[:300]).max() < 1.0


def test_filling_fed_forward_is_what_makes_the_torque_quick() -> None:
    def rise_time(chain: DemandChain) -> int:
        torque = simulate_drive(chain, tip_in(), 2000.0, sensors=QUIET)["torque_nm"].to_numpy()
        return int(np.argmax(torque[300:] > torque[299] + 0.9 * (torque[-1] - torque[299])))

    assert rise_time(CHAIN) < 0.6 * rise_time(CHAIN.replace(filling_share=0.0))


def test_a_measured_pressure_corrects_an_engine_that_breathes_less() -> None:
    # 80 % pedal is above the critical ratio: the flow through the plate depends on the pressure behind it.
    weak = CHAIN.replace(volumetric_efficiency=0.765)
    pedal = np.full(2000, 80.0)
    told, blind = (
        simulate_drive(CHAIN, pedal, 3000.0, engine=weak, measured_pressure=is_told, sensors=QUIET)
        for is_told in (True, False)
    )
    error = [abs(float((run["torque_nm"] - run["wanted_torque_nm"])[-1])) for run in (told, blind)]
    assert error[0] < 1.0 < 4.0 < error[1]


def test_the_drop_over_the_plate_loads_it() -> None:
    run = simulate_drive(CHAIN, tip_in(), 2000.0, sensors=QUIET)
    drop = CHAIN.ambient_kpa - run["pressure_kpa"].to_numpy()
    one = airflow_torque_nm(Throttle(pressure_drop_kpa=1.0, bore_mm=CHAIN.bore_mm), run["angle_deg"].to_numpy())
    np.testing.assert_allclose(run["airflow_torque_nm"], one * drop, rtol=1e-12)
    assert not simulate_drive(CHAIN, tip_in(400), 2000.0, air_torque=False)["airflow_torque_nm"].any()


def test_runs_repeat_and_seeds_differ() -> None:
    first, second, other = (simulate_drive(CHAIN, tip_in(500), 2000.0, seed=seed) for seed in (3, 3, 4))
    assert first.identical(second)
    assert not np.array_equal(first["sensed_angle_deg"], other["sensed_angle_deg"])


@pytest.mark.parametrize(
    ("pedal", "speed", "controller", "error", "field"),
    [
        ([10.0, 120.0], 2000.0, None, ParameterError, "pedal_percent"),
        ([10.0, math.nan], 2000.0, None, ParameterError, "pedal_percent"),
        ([10.0, 20.0], [2000.0, 0.0], None, ParameterError, "speed_rpm"),
        ([10.0, 20.0], 2000.0, Held(math.nan), ParameterError, "duty"),
        ([10.0, 20.0], [2000.0], None, ShapeError, ""),
        ([], 2000.0, None, ShapeError, ""),
        (10.0, 2000.0, None, ShapeError, ""),
    ],
)
def test_what_cannot_be_driven_is_refused(
    pedal: object, speed: object, controller: object, error: type[Exception], field: str
) -> None:
    with pytest.raises(error) as refused:
        simulate_drive(CHAIN, pedal, speed, controller=controller)  # type: ignore[arg-type]
    assert (getattr(refused.value, "field", "") or "") == field
