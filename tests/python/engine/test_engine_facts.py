"""Facts about the engine that stand without any program: closed forms, symmetry, unit systems."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import _core
from mgdd.engine import Cylinder, NoxProxy, OperatingPoint, find_optimum, sensitivities, simulate, timing_sweep
from mgdd.errors import ParameterError
from mgdd.results.labels import check_labels

GAMMA = 1.37
ADIABATIC = Cylinder(wall_heat_scale=0.0)
MOTORED = OperatingPoint(fuel_mg=0.0)
FIXED = OperatingPoint(burn_duration_cad=30.0)


@given(
    bore=st.floats(50.0, 200.0),
    stroke=st.floats(50.0, 200.0),
    rod=st.floats(0.7, 4.0),
    ratio=st.floats(8.0, 25.0),
    angle=st.floats(-180.0, 180.0),
)
def test_volume_is_that_of_the_mechanism(bore, stroke, rod, ratio, angle):
    cylinder = Cylinder(bore_mm=bore, stroke_mm=stroke, connecting_rod_mm=rod * stroke, compression_ratio=ratio)
    swept = np.pi / 4.0 * bore**2 * stroke * 1e-6
    crank = stroke / 2.0
    pin = crank * np.cos(np.radians(angle)) + np.sqrt((rod * stroke) ** 2 - (crank * np.sin(np.radians(angle))) ** 2)
    expected = swept / (ratio - 1.0) + np.pi / 4.0 * bore**2 * (rod * stroke + crank - pin) * 1e-6
    assert float(_core.engine.volume_l(cylinder, angle)) == pytest.approx(expected, rel=1e-9)
    top, bottom = _core.engine.volume_l(cylinder, np.array([0.0, 180.0]))
    assert bottom / top == pytest.approx(ratio, rel=1e-9)
    assert cylinder.swept_volume_l == pytest.approx(swept, rel=1e-12)


def test_triangle_of_heat():
    cylinder, soc, duration = Cylinder(), -6.0, 30.0
    x = _core.engine.burned_fraction(cylinder, np.array([soc, soc + duration / 2.0, soc + duration]), soc, duration)
    np.testing.assert_allclose(x, [0.0, 0.5, 1.0], atol=1e-15)
    cycle = simulate(cylinder, FIXED, soc_cad=soc)
    assert float(cycle.ca50_cad) - soc == pytest.approx(15.0, rel=1e-12)
    assert float(cycle.ca90_cad - cycle.ca10_cad) == pytest.approx(duration * (1.0 - 2.0 * np.sqrt(0.05)), rel=1e-12)
    h = 1e-4
    slope = (
        np.diff(_core.engine.burned_fraction(cylinder, np.array([soc + 15.0 - h, soc + 15.0]), soc, duration))[0] / h
    )
    assert 856.0 * slope == pytest.approx(2.0 * 856.0 / duration, rel=1e-5)


@pytest.mark.parametrize(("integrator", "tolerance"), [("trapezoid", 5e-4), ("split", 1e-11)])
def test_adiabatic_compression_is_the_closed_form(integrator, tolerance):
    cycle = simulate(ADIABATIC, MOTORED, integrator=integrator)
    volume = cycle.volume_l.values
    exact = 1.5 * (volume[0] / volume) ** GAMMA
    np.testing.assert_allclose(cycle.pressure_bar, exact, rtol=tolerance)
    work = (exact[-1] * volume[-1] - exact[0] * volume[0]) * 100.0 / (1.0 - GAMMA)
    assert work == pytest.approx(-3.832, abs=5e-4)
    assert float(cycle.work_closed_j) == pytest.approx(work, abs=0.01)


def test_seed_creates_energy_where_the_others_do_not():
    seed = simulate(ADIABATIC, MOTORED, integrator="tan2018_lagged")
    assert float(seed.pressure_bar.sel(crank_angle_cad=0)) == pytest.approx(71.60, abs=0.02)
    assert float(seed.work_closed_j) == pytest.approx(6.96, abs=0.05)


def test_without_wall_heat_the_best_burn_is_centred():
    for duration in (10.0, 30.0, 40.0):
        best = find_optimum(ADIABATIC, OperatingPoint(burn_duration_cad=duration))
        assert best["ca50_cad"] == pytest.approx(0.0, abs=0.05)
    far = ADIABATIC.replace(ivc_cad=-150.0, evo_cad=150.0)
    mirrored = timing_sweep(far, FIXED, soc_cad=[-15.0 - 6.0, -15.0 + 6.0], integrator="split", step_cad=0.1)
    early, late = mirrored.imep_closed_bar.values
    assert early == pytest.approx(late, rel=1e-3)


def test_efficiency_stays_below_otto():
    otto = 1.0 - 18.2 ** (1.0 - GAMMA)
    assert otto == pytest.approx(0.6582, abs=5e-5)
    short = simulate(ADIABATIC, OperatingPoint(burn_duration_cad=10.0), soc_cad=-5.0)
    assert float(short.efficiency_gross) == pytest.approx(0.6495, abs=0.001)
    for duration in (3.0, 10.0, 60.0):
        sweep = timing_sweep(ADIABATIC, OperatingPoint(burn_duration_cad=duration))
        assert float(sweep.efficiency_gross.max()) < otto


def test_grid_error_of_efficiency_by_integrator():
    def change(integrator):
        coarse, fine = (
            float(simulate(Cylinder(), FIXED, step_cad=step, integrator=integrator).efficiency_gross)
            for step in (1.0, 0.1)
        )
        return coarse - fine

    assert abs(change("trapezoid")) < 2e-4
    assert abs(change("split")) < 2e-4
    assert change("tan2018_lagged") == pytest.approx(1.5e-2, abs=5e-4)
    assert change("euler") == pytest.approx(-7.9e-3, abs=1e-4)


def test_woschni_constants_of_all_unit_systems():
    w = 17.0
    h = _core.engine.woschni_coefficient(_core.engine.woschni_c1_bar_m, 0.086, 80.0, 1700.0, w)
    assert _core.engine.woschni_coefficient(3.26, 0.086, 8000.0, 1700.0, w) == pytest.approx(h, rel=5e-4)
    assert _core.engine.woschni_coefficient(516.8, 86.0, 80.0, 1700.0, w) == pytest.approx(h, rel=5e-4)
    assert _core.engine.woschni_coefficient(0.01298, 0.086, 80e5, 1700.0, w) == pytest.approx(h, rel=5e-4)


@pytest.mark.parametrize("model", ["woschni", "hohenberg", "eichelberg"])
def test_wall_heat_is_the_printed_formula(model):
    cylinder = Cylinder(wall_heat_model=model, wall_heat_scale=0.7)
    cycle = simulate(cylinder, FIXED)
    angle, volume = cycle.crank_angle_cad.values, cycle.volume_l.values
    p, t = cycle.pressure_bar.values, cycle.temperature_k.values
    motored = 1.5 * (volume[0] / volume) ** GAMMA
    burning = np.where(angle >= -6.0, np.maximum(0.0, p - motored), 0.0)
    velocity = 2.28 * 4.3 + 3.24e-3 * cylinder.swept_volume_l * t[0] / (1.5 * volume[0]) * burning
    if model == "woschni":
        film = 0.7 * 129.8 * 0.086**-0.2 * p**0.8 * t**-0.55 * velocity**0.8
    elif model == "eichelberg":
        film = 0.7 * 2.43 * np.cbrt(4.3) * np.sqrt(p * t)
    else:
        film = 0.7 * 130.0 * (volume * 1e-3) ** -0.06 * p**0.8 * t**-0.4 * (4.3 + 1.4) ** 0.8
    loss = film * _core.engine.wall_area_m2(cylinder, angle) * (t - 450.0) / (6.0 * 1500.0)
    np.testing.assert_allclose(cycle.heat_loss_j_per_cad[1:], loss[:-1], rtol=1e-10, atol=1e-12)
    assert float(cycle.heat_loss_j) == pytest.approx(loss[:-1].sum(), rel=1e-12)


def test_gamma_laws_bend_the_compression():
    def top(**law):
        return float(simulate(ADIABATIC.replace(**law), MOTORED).p_max_bar)

    flat = top(gamma_model="linear", gamma_linear_300k=GAMMA, gamma_linear_slope_per_k=0.0)
    assert flat == pytest.approx(top(), rel=1e-12)
    same = {"gamma_polynomial_c0": 1.404, "gamma_polynomial_c1_per_k": -8e-5, "gamma_polynomial_c2_per_k2": 0.0}
    assert top(gamma_model="polynomial", **same) == pytest.approx(top(gamma_model="linear"), rel=1e-12)
    assert top(gamma_model="linear") < top()


def test_gross_work_adds_the_ideal_remainder():
    cycle = simulate(Cylinder(), FIXED)
    bottom = float(_core.engine.volume_l(Cylinder(), 180.0))
    first, last = float(cycle.volume_l[0]), float(cycle.volume_l[-1])
    rest = 1.5 * (first - bottom) + 0.5 * (float(cycle.pressure_bar[-1]) + 1.5) * (bottom - last)
    assert float(cycle.work_gross_j - cycle.work_closed_j) == pytest.approx(100.0 * rest, rel=1e-12)
    assert float(cycle.efficiency_gross) == pytest.approx(float(cycle.work_gross_j) / 856.0, rel=1e-14)


@given(factor=st.floats(0.3, 3.0))
@settings(max_examples=20)
def test_adiabatic_cycle_scales_with_its_charge(factor):
    one = simulate(ADIABATIC, FIXED)
    scaled = FIXED.replace(intake_pressure_kpa=150.0 * factor, fuel_mg=20.0 * factor)
    many = simulate(ADIABATIC, scaled)
    np.testing.assert_allclose(many.pressure_bar, factor * one.pressure_bar, rtol=1e-12)
    assert float(many.t_max_k) == pytest.approx(float(one.t_max_k), rel=1e-12)


def test_trapped_mass_is_the_charge_said_otherwise():
    by_volume = simulate(Cylinder(), FIXED)
    mass_g = 0.9 * 150.0 * Cylinder().swept_volume_l / (8.314462618 * 313.0) * 28.9647
    by_mass = simulate(Cylinder(), FIXED.replace(trapped_mass_g=mass_g))
    np.testing.assert_allclose(by_mass.pressure_bar, by_volume.pressure_bar, rtol=1e-12)


def test_nox_maps_agree_in_value_and_slope_where_they_meet():
    nox = NoxProxy()
    t = np.array([1899.9, 1900.0, 1900.1])
    np.testing.assert_allclose(nox.affine_log_ppm(t), nox.arrhenius_ppm(t), rtol=1e-7)
    assert np.log(nox.affine_log_ppm(1901.0) / 1200.0) == pytest.approx(16000.0 / 1900.0**2, rel=1e-12)
    hot = NoxProxy(reference_temperature_k=2000.0, reference_nox_ppm=500.0, activation_temperature_k=2e4)
    assert float(hot.arrhenius_ppm(2000.0)) == 500.0


def test_duration_law():
    law = _core.engine.burn_duration_cad(Cylinder(), OperatingPoint(fuel_mg=40.0, speed_rpm=3000.0))
    assert law == pytest.approx(30.0 * 2.0**0.9, rel=1e-14)
    assert _core.engine.burn_duration_cad(Cylinder(), OperatingPoint(fuel_mg=40.0, burn_duration_cad=17.0)) == 17.0


# Away from kinks: start, joint and end of the burn lie between grid angles.
SHAPES = ("triangle", "wiebe", "double_wiebe")


@pytest.mark.parametrize("shape", SHAPES)
def test_timing_moves_the_burn_and_nothing_before_it(shape):
    d = sensitivities(Cylinder(burn_shape=shape), OperatingPoint(), wrt="soc_cad", soc_cad=-6.3)
    for name in ("ca10_cad", "ca50_cad", "ca90_cad"):
        assert float(d[f"d_{name}"].squeeze()) == pytest.approx(1.0, abs=1e-9)
    before = d.d_pressure_bar.where(d.crank_angle_cad < -6.3, drop=True)
    assert (before == 0.0).all()
    assert float(d.d_pressure_bar.sel(crank_angle_cad=0.0).squeeze()) < 0.0


def test_fuel_and_heating_value_trade():
    d = sensitivities(
        Cylinder(), OperatingPoint(burn_duration_cad=30.0), wrt=["fuel_mg", "lower_heating_value_mj_per_kg"]
    )
    fuel, heat = d.d_pressure_bar.values.T
    np.testing.assert_allclose(20.0 * fuel, 42.8 * heat, rtol=1e-12, atol=1e-12)


def test_adiabatic_work_is_homogeneous_in_charge_and_fuel():
    cylinder, point = Cylinder(wall_heat_scale=0.0), OperatingPoint(burn_duration_cad=30.0)
    d = sensitivities(cylinder, point, wrt=["intake_pressure_kpa", "fuel_mg"])
    by_charge, by_fuel = d.d_imep_gross_bar.values
    value = float(simulate(cylinder, point).imep_gross_bar)
    assert 150.0 * by_charge + 20.0 * by_fuel == pytest.approx(value, rel=1e-12)


def test_best_timing_is_where_the_derivative_vanishes():
    from mgdd.engine import find_optimum

    best = find_optimum(Cylinder(), OperatingPoint())
    d = sensitivities(Cylinder(), OperatingPoint(), wrt=["soc_cad"], soc_cad=best["soc_cad"])
    assert abs(float(d.d_efficiency_gross.squeeze())) < 1e-8


def test_dataset_says_units_and_refuses_by_name():
    d = sensitivities(Cylinder(), OperatingPoint())
    check_labels(d)
    assert d["d_p_max_bar"].attrs["units"] == "bar"
    assert d["d_p_max_bar"].attrs["long_name"].endswith(", bar per unit of the parameter")
    assert d.parameter_units.sel(parameter="fuel_mg").item() == "mg"
    for name in ("evo_cad", "soc"):
        with pytest.raises(ParameterError, match=f"'{name}' is not an input with a derivative: must be one of"):
            sensitivities(Cylinder(), OperatingPoint(), wrt=["fuel_mg", name])
