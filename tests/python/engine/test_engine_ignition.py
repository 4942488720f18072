"""Ignition delay: printed correlations, the integral by other quadrature, its U-shape, and the way back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import _core
from mgdd.engine import Cylinder, OperatingPoint, ignition_delay, simulate
from mgdd.errors import ParameterError

CYLINDER, POINT = Cylinder(), OperatingPoint()
MODELS = ("watson", "wolfer", "hardenberg_hase", "polynomial")


def test_correlations_at_sixty_bar():
    assert _core.engine.watson_delay_ms(60.0, 900.0) == pytest.approx(0.553, rel=5e-3)
    assert _core.engine.wolfer_delay_ms(60.0, 900.0) == pytest.approx(0.591, rel=5e-3)
    assert _core.engine.hardenberg_hase_delay_cad(60.0, 900.0, 45.0, 4.3) == pytest.approx(1.950, rel=5e-3)
    assert math.isinf(_core.engine.hardenberg_hase_delay_cad(12.4, 900.0, 45.0, 4.3))
    assert (
        _core.engine.hardenberg_hase_delay_cad(60.0, 900.0, 55.0, 4.3) < 1.950
    )  # a higher cetane number ignites sooner


@pytest.mark.parametrize("model", ["watson", "wolfer"])
@pytest.mark.parametrize("soi", [-25.0, -12.0, -3.0, 6.0])
def test_delay_is_where_the_integral_reaches_one(model, soi):
    motored = simulate(CYLINDER, POINT.replace(fuel_mg=0.0), step_cad=0.05)
    tau_ms = {"watson": _core.engine.watson_delay_ms, "wolfer": _core.engine.wolfer_delay_ms}[model](
        motored.pressure_bar, motored.temperature_k
    )
    soc = ignition_delay(CYLINDER.replace(ignition_model=model), POINT, soi_cad=soi).soc_cad
    angle = np.linspace(soi, soc, 5001)
    rate = np.interp(angle, motored.crank_angle_cad, 1e3 / (6.0 * 1500.0) / tau_ms)
    assert np.trapezoid(rate, angle) == pytest.approx(1.0, abs=0.01)


def test_delay_is_u_shaped():
    soi = np.arange(-30.0, 10.01, 0.1)
    delay = np.array([ignition_delay(CYLINDER, POINT, soi_cad=s).delay_cad for s in soi])
    lowest = int(np.argmin(delay))
    assert delay[lowest] == pytest.approx(3.82, abs=0.02)
    assert soi[lowest] == pytest.approx(-2.2, abs=0.3)
    assert -8.0 < soi[lowest] < 2.0
    coarse = delay[::5]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(coarse))))
    assert turns.size == 1  # one minimum
    assert delay[100] == pytest.approx(8.1, abs=0.2)  # SOI -20
    assert delay[250] == pytest.approx(3.9, abs=0.2)  # SOI -5
    assert delay[100] > 1.7 * delay[250]
    assert (np.diff(soi + delay) > 0.0).all()


@given(soc=st.floats(-15.0, 8.0), model=st.sampled_from(MODELS), speed=st.floats(900.0, 2200.0))
@settings(max_examples=80)
def test_the_way_back(soc, model, speed):
    cylinder, point = CYLINDER.replace(ignition_model=model), POINT.replace(speed_rpm=speed)
    back = ignition_delay(cylinder, point, soc_cad=soc)
    if back.clipped:
        assert back.soc_cad != pytest.approx(soc, abs=1e-6)
        return
    again = ignition_delay(cylinder, point, soi_cad=back.soi_cad)
    assert again.soc_cad == pytest.approx(soc, abs=1e-6)
    assert again.ignites
    assert back.delay_cad == pytest.approx(again.soc_cad - back.soi_cad, abs=1e-9)


def test_one_timing_is_asked_for():
    for both in ({}, {"soi_cad": -10.0, "soc_cad": -6.0}):
        with pytest.raises(ParameterError, match="give exactly one of them"):
            ignition_delay(CYLINDER, POINT, **both)


@pytest.mark.parametrize(("speed", "edge"), [(1000, -23.0), (1500, -18.8), (2000, -15.7), (3000, -11.3)])
def test_too_early_a_combustion_is_clipped_to_the_edge(speed, edge):
    point = POINT.replace(speed_rpm=speed)
    timing = ignition_delay(CYLINDER, point, soc_cad=edge - 5.0)
    assert timing.clipped
    assert timing.soi_cad == -60.0
    assert timing.soc_cad == pytest.approx(edge, abs=0.06)
    assert not ignition_delay(CYLINDER, point, soc_cad=edge + 0.2).clipped


@pytest.mark.parametrize(("speed", "last"), [(1500, 18.0), (3000, 10.5)])
def test_a_late_injection_does_not_ignite(speed, last):
    point = POINT.replace(speed_rpm=speed)
    assert ignition_delay(CYLINDER, point, soi_cad=last - 0.1).ignites
    lost = ignition_delay(CYLINDER, point, soi_cad=last + 0.3)
    assert not lost.ignites
    assert math.isnan(lost.soc_cad)
    assert math.isnan(lost.delay_cad)


def test_polynomial_is_the_polynomial_and_wall_heat_delays():
    cylinder = CYLINDER.replace(
        ignition_model="polynomial", ignition_c0_cad=4.0, ignition_c1=0.1, ignition_c2_per_cad=0.02
    )
    assert ignition_delay(cylinder, POINT, soi_cad=-10.0).delay_cad == pytest.approx(5.0, abs=1e-12)
    warm = ignition_delay(CYLINDER.replace(wall_heat_scale=0.0), POINT, soi_cad=5.0).delay_cad
    assert warm < ignition_delay(CYLINDER, POINT, soi_cad=5.0).delay_cad
    assert ignition_delay(CYLINDER, POINT.replace(fuel_mg=0.0), soi_cad=5.0) == ignition_delay(
        CYLINDER, POINT, soi_cad=5.0
    )
