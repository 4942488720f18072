"""One cycle: the reference numbers, conservation laws, step-size bars, and the Dataset that carries it."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import _core
from mgdd.engine import (
    Cylinder,
    NoxProxy,
    OperatingPoint,
    analyze,
    find_optimum,
    ignition_delay,
    simulate,
    timing_sweep,
)
from mgdd.engine.cycle import convergence
from mgdd.results.labels import check_labels

R = 8.314462618
WORDS = ("soc_cad", "soi_cad", "integrator", "step_cad", "objective")
SHAPES = ("triangle", "wiebe", "double_wiebe")
INTEGRATORS = ("trapezoid", "split", "tan2018_lagged", "euler")


@functools.cache
def parse(text):
    """Split settings into cylinder, point and the words that are not fields; the C++ suite does the same."""
    cylinder, point, words = {}, {}, {}
    for word in text.split():
        name, value = word.split("=")
        if name in WORDS:
            words[name] = value
        elif name in OperatingPoint.fields():
            point[name] = float(value)
        else:
            numeric = "choices" not in Cylinder.fields()[name]
            cylinder[name] = float(value) if numeric else value
    return Cylinder(**cylinder), OperatingPoint(**point), words


@functools.cache
def run(text):
    cylinder, point, words = parse(text)
    soc = float(words.get("soc_cad", -6.0))
    return simulate(cylinder, point, soc_cad=soc, integrator=words.get("integrator", "trapezoid"))


@functools.cache
def best(text):
    cylinder, point, words = parse(text)
    integrator = words.get("integrator", "trapezoid")
    return find_optimum(cylinder, point, words.get("objective", "efficiency_gross"), integrator=integrator)


def computed(text, quantity, at):
    cylinder, point, words = parse(text)
    if quantity.startswith("optimum_"):
        name = quantity.removeprefix("optimum_")
        found = best(text)
        if name == "curvature_per_cad2":
            return found.curvature
        if name in (*found.inputs, *found.values):
            return found[name]
        return float(simulate(cylinder, point, soc_cad=found["soc_cad"])[name])
    if quantity in ("delay_cad", "ignition_soc_cad"):
        timing = ignition_delay(cylinder, point, soi_cad=float(words["soi_cad"]))
        return getattr(timing, quantity.removeprefix("ignition_"))
    if quantity in ("swept_volume_l", "clearance_volume_l"):
        return getattr(cylinder, quantity)
    if quantity == "volume_l":
        return float(_core.engine.volume_l(cylinder, at))
    if quantity == "wall_area_mm2":
        return float(_core.engine.wall_area_m2(cylinder, at)) * 1e6
    cycle = run(text)
    if quantity in ("pressure_bar", "temperature_k"):
        return float(cycle[quantity].sel(crank_angle_cad=at))
    amount_mol = float((cycle.pressure_bar * cycle.volume_l / cycle.temperature_k)[0]) * 100.0 / R
    if quantity == "amount_mol":
        return amount_mol
    if quantity == "alpha_k_per_j":
        return (cylinder.gamma - 1.0) / (amount_mol * R)
    if quantity == "nox_arrhenius_ppm":
        return float(NoxProxy().arrhenius_ppm(cycle.t_max_k))
    if quantity == "n_compression":
        return float(analyze(cycle, cylinder, point=point).n_compression)
    if quantity == "work_booked_j":
        return float(cycle.work_booked_j.sum())
    return float(cycle[quantity])


def test_every_reference_number_holds(root):
    rows = [line.split(",") for line in (root / "tests/data/engine_golden.csv").read_text().splitlines()]
    rows = [row for row in rows if not row[0].startswith("#")][1:]
    wrong, compared = [], 0
    for text, name, value, tolerance in rows:
        quantity, _, at = name.partition("@")
        if quantity.startswith("fit_"):
            continue
        compared += 1
        found = computed(text, quantity, float(at or "nan"))
        if not abs(found - float(value)) <= float(tolerance):
            wrong.append((text, name, value, found))
    assert not wrong
    assert compared > 170


timings = st.floats(-25.0, 10.0)
durations = st.floats(1.5, 90.0)


@given(soc=timings, duration=durations, shape=st.sampled_from(SHAPES), m=st.floats(-0.4, 4.0))
@settings(max_examples=100)
def test_the_fuel_energy_is_released_exactly(soc, duration, shape, m):
    cylinder = Cylinder(burn_shape=shape, wiebe_m=m)
    cycle = simulate(cylinder, OperatingPoint(burn_duration_cad=duration), soc_cad=soc)
    assert float(cycle.heat_release_j_per_cad.sum()) == pytest.approx(856.0, rel=1e-9)
    fraction = cycle.burned_fraction.values
    assert (np.diff(fraction) >= 0.0).all()
    assert fraction[0] == 0.0
    assert fraction[-1] == pytest.approx(1.0, abs=1e-12)


@given(
    soc=timings,
    duration=durations,
    step=st.floats(0.3, 4.0),
    speed=st.floats(600.0, 5000.0),
    fuel=st.floats(0.0, 45.0),
    integrator=st.sampled_from(INTEGRATORS),
    gamma=st.sampled_from(("constant", "linear", "polynomial")),
    wall=st.sampled_from(("woschni", "hohenberg", "eichelberg")),
    scale=st.floats(0.0, 1.5),
)
@settings(max_examples=150)
def test_first_law_closes_in_every_step(soc, duration, step, speed, fuel, integrator, gamma, wall, scale):
    cylinder = Cylinder(gamma_model=gamma, wall_heat_model=wall, wall_heat_scale=scale)
    point = OperatingPoint(speed_rpm=speed, fuel_mg=fuel, burn_duration_cad=duration)
    cycle = simulate(cylinder, point, soc_cad=soc, step_cad=step, integrator=integrator)
    width = np.diff(cycle.crank_angle_cad, prepend=cycle.crank_angle_cad[0])
    heat = (cycle.heat_release_j_per_cad - cycle.heat_loss_j_per_cad) * width
    assert np.abs(heat - cycle.work_booked_j - cycle.energy_change_j).max() < 1e-9 * max(856.0, 42.8 * fuel)


def test_energy_of_the_whole_cycle_by_hand():
    for integrator in INTEGRATORS:
        cycle = simulate(Cylinder(), OperatingPoint(), integrator=integrator)
        energy = np.diff((cycle.pressure_bar * cycle.volume_l * 100.0)[[0, -1]])[0] / 0.37
        rest = 856.0 - float(cycle.heat_loss_j) - float(cycle.work_booked_j.sum()) - energy
        assert abs(rest) < 1e-9 * 856.0


def test_trapezoid_books_the_area_of_the_diagram():
    cycle = simulate(Cylinder(), OperatingPoint())
    area = np.trapezoid(cycle.pressure_bar, cycle.volume_l) * 100.0
    assert float(cycle.work_booked_j.sum()) == pytest.approx(area, rel=1e-12)
    assert float(cycle.work_closed_j) == pytest.approx(area, rel=1e-12)
    gaps = []
    for soc in (-20.0, -15.0, -10.0, -6.0, 0.0, 5.0, 10.0):
        seed = simulate(Cylinder(), OperatingPoint(), soc_cad=soc, integrator="tan2018_lagged")
        gaps.append(float(seed.work_closed_j - seed.work_booked_j.sum()))
    assert gaps[3] == pytest.approx(22.3, abs=0.2)
    assert min(gaps) > 18.0
    assert max(gaps) < 28.05


def test_advance_raises_the_peaks_strictly():
    sweep = timing_sweep(Cylinder(), OperatingPoint(), soc_cad=np.arange(0.0, -20.25, -0.25))
    assert (np.diff(sweep.p_max_bar) > 0.0).all()
    assert (np.diff(sweep.t_max_k) > 0.0).all()
    slope = sweep.dp_max_bar_per_cad
    assert (np.diff(slope) >= 0.0).all()
    assert (np.diff(slope.where(sweep.soc_cad < -4.25, drop=True)) > 0.0).all()
    np.testing.assert_allclose(slope.where(sweep.soc_cad >= -4.0, drop=True), 2.287, atol=5e-4)


@given(a=st.floats(-25.0, 0.0), b=st.floats(-25.0, 0.0), fuel=st.floats(8.0, 40.0), speed=st.floats(900.0, 3000.0))
@settings(max_examples=40)
def test_an_earlier_burn_never_peaks_lower(a, b, fuel, speed):
    point = OperatingPoint(fuel_mg=fuel, speed_rpm=speed)
    early, late = _core.engine.scan(Cylinder(), point, np.array([min(a, b), max(a, b)]), 1.0, "trapezoid")["p_max_bar"]
    assert early >= late - 1e-3  # the parabola between samples


INDICATORS = ("imep_closed_bar", "p_max_bar", "t_max_k")


def step_errors(point, soc, step=1.0):
    def at(h):
        columns = _core.engine.scan(Cylinder(), point, np.array([soc]), h, "trapezoid")
        return np.array([columns[name][0] for name in INDICATORS])

    return 100.0 * (at(step) / at(0.01) - 1.0)


def test_step_size_bars_hold():
    one = step_errors(OperatingPoint(), -6.0)
    assert (np.abs(one) < [0.05, 0.2, 0.15]).all()
    np.testing.assert_allclose(step_errors(OperatingPoint(), -6.0, 0.5) / one, 0.5, atol=0.06)
    for speed in (900.0, 1600.0, 3000.0):
        for fuel in (6.0, 20.0, 40.0):
            for soc in (-20.0, -8.3, 5.0):
                errors = step_errors(OperatingPoint(speed_rpm=speed, fuel_mg=fuel), soc)
                assert (np.abs(errors) < [0.3, 0.6, 0.5]).all(), (speed, fuel, soc)


def test_convergence_estimates_the_true_error():
    table = convergence(Cylinder(), OperatingPoint())
    check_labels(table)
    for name, error in zip(INDICATORS, step_errors(OperatingPoint(), -6.0), strict=True):
        row = table.sel(indicator=name)
        assert 100.0 * float(row.error / row.extrapolated) == pytest.approx(error, rel=0.2)
        assert float(row.order) == pytest.approx(1.0, abs=0.3)


def test_dataset_is_labelled_and_consistent():
    cycle = simulate(Cylinder(), OperatingPoint(fuel_mg=12.0), soc_cad=-3.0, step_cad=0.7)
    check_labels(cycle)
    assert float(cycle.crank_angle_cad[-1]) == 130.0
    assert float(cycle.heat_release_j_per_cad[0]) == float(cycle.heat_loss_j_per_cad[0]) == 0.0
    width = np.diff(cycle.crank_angle_cad)
    released = np.cumsum(cycle.heat_release_j_per_cad.values[1:] * width)
    np.testing.assert_allclose(released, 12.0 * 42.8 * cycle.burned_fraction.values[1:], atol=1e-9)
    before = cycle.crank_angle_cad < -3.0
    np.testing.assert_array_equal(cycle.pressure_bar[before], cycle.motored_pressure_bar[before])
    motored = simulate(Cylinder(), OperatingPoint(fuel_mg=0.0), step_cad=0.7)
    np.testing.assert_array_equal(cycle.motored_pressure_bar, motored.pressure_bar)
    assert float(cycle.fuel_heat_j) == pytest.approx(12.0 * 42.8, rel=1e-15)
    burned = np.interp([float(cycle.ca50_cad)], cycle.crank_angle_cad, cycle.burned_fraction)
    assert burned[0] == pytest.approx(0.5, abs=2e-3)


def test_a_timing_sweep_has_nox_by_its_proxy():
    sweep = timing_sweep(Cylinder(), OperatingPoint(), soc_cad=[-20.0, -6.25, 5.0])
    np.testing.assert_array_equal(sweep.nox_affine_log_ppm, NoxProxy().affine_log_ppm(sweep.t_max_k))
    np.testing.assert_array_equal(sweep.nox_arrhenius_ppm, NoxProxy().arrhenius_ppm(sweep.t_max_k))
    many = timing_sweep(Cylinder(), OperatingPoint(), nox=NoxProxy(reference_nox_ppm=500.0))
    assert (np.diff(many.nox_affine_log_ppm) < 0.0).all()  # NOx falls as the burn moves later
    assert float(many.nox_affine_log_ppm.sel(soc_cad=-20.0)) == pytest.approx(
        float(sweep.nox_affine_log_ppm.sel(soc_cad=-20.0)) * 500.0 / 1200.0, rel=1e-12
    )
