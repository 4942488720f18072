"""Analysis of traces: the way back from a simulation, pegging, TDC errors, figures of the measured traces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import _core, datasets, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_trace
from mgdd.results.labels import check_labels

CYLINDER, POINT = Cylinder(), OperatingPoint()
ADIABATIC = Cylinder(wall_heat_scale=0.0)
MOTORED = OperatingPoint(fuel_mg=0.0)


def moved(cycle, *, angle=0.0, pressure=0.0):
    return pressure_trace(cycle.crank_angle_cad.values + angle, cycle.pressure_bar.values + pressure)


@given(
    soc=st.floats(-22.0, 6.0),
    fuel=st.floats(5.0, 45.0),
    speed=st.floats(800.0, 4000.0),
    scale=st.floats(0.0, 1.2),
    shape=st.sampled_from(("triangle", "wiebe", "double_wiebe")),
    wall=st.sampled_from(("woschni", "hohenberg")),
)
@settings(max_examples=60)
def test_analysis_inverts_the_simulation(soc, fuel, speed, scale, shape, wall):
    cylinder = CYLINDER.replace(burn_shape=shape, wall_heat_model=wall, wall_heat_scale=scale)
    point = OperatingPoint(fuel_mg=fuel, speed_rpm=speed, burn_duration_cad=35.0)
    cycle = simulate(cylinder, point, soc_cad=soc)
    back = analyze(cycle, cylinder, point=point, gamma="cylinder", fractions="gross")
    assert float(back.heat_gross_cumulative_j[-1]) == pytest.approx(42.8 * fuel, rel=1e-9)
    net = float(back.heat_net_cumulative_j[-1])
    assert net + float(cycle.heat_loss_j) == pytest.approx(42.8 * fuel, rel=1e-9)
    np.testing.assert_allclose(back.heat_release_gross_j_per_cad, cycle.heat_release_j_per_cad, atol=1e-9 * 42.8 * fuel)
    assert float(back.ca50_cad) == pytest.approx(float(cycle.ca50_cad), abs=0.1)
    assert float(back.imep_closed_bar) == pytest.approx(float(cycle.imep_closed_bar), rel=1e-12)


def test_the_middle_of_the_net_heat_comes_earlier():
    for soc, expected in ((-6.0, 8.70), (-20.0, -5.72)):
        cycle = simulate(CYLINDER, POINT, soc_cad=soc)
        net = analyze(cycle, CYLINDER, point=POINT, gamma="cylinder", heat_window_cad=(soc, 130.0))
        assert float(net.ca50_cad) == pytest.approx(expected, abs=0.01)
        assert net.attrs["fractions"] == "net"


def gross_error_percent(cycle, gamma):
    # The whole balance, not its peak: the apparent heat of compression counts too.
    back = analyze(cycle, CYLINDER, point=POINT, gamma=gamma, fractions="gross")
    assert back.attrs["gamma"] == gamma
    return 100.0 * (float(back.heat_gross_cumulative_j[-1]) / 856.0 - 1.0)


@pytest.mark.parametrize(("gamma", "percent"), [(1.30, 7.7), (1.33, 4.0), (1.35, 1.9), (1.40, -2.5)])
def test_another_gamma_shifts_the_heat(gamma, percent):
    assert gross_error_percent(simulate(CYLINDER, POINT), gamma) == pytest.approx(percent, abs=0.3)


@pytest.mark.parametrize(
    ("integrator", "percent", "tolerance"), [("split", 9e-3, 1e-3), ("euler", -2.4, 0.05), ("seed", 2.6, 0.05)]
)
def test_another_integrator_shifts_the_heat(integrator, percent, tolerance):
    cycle = simulate(CYLINDER, POINT, integrator=integrator)
    assert gross_error_percent(cycle, "cylinder") == pytest.approx(percent, abs=tolerance)


@pytest.mark.parametrize("method", ["two_point", "least_squares"])
@pytest.mark.parametrize("offset", [-0.3, -0.12, 0.05, 0.3])
def test_pegging_recovers_an_offset(method, offset):
    cycle = simulate(ADIABATIC, MOTORED)
    back = analyze(moved(cycle, pressure=offset), ADIABATIC, point=MOTORED, pegging=method, pegging_exponent=1.37)
    assert float(back.pegging_bar) == pytest.approx(-offset, abs=0.005)
    np.testing.assert_allclose(back.pressure_bar, cycle.pressure_bar, atol=0.005)
    assert back.attrs["method"] == method


def test_inlet_pegging_reads_bottom_dead_centre():
    angle = np.arange(-200.0, 131.0)
    trace = pressure_trace(angle, np.where(angle < -160.0, 0.9 + 0.01 * (angle + 180.0), 30.0))
    for keyword in ({"inlet_pressure_kpa": 150.0}, {"point": POINT}):
        back = analyze(trace, CYLINDER, pegging="inlet", **keyword)
        assert float(back.pegging_bar) == pytest.approx(0.6, abs=1e-12)
    with pytest.raises(DataError, match="-180"):
        analyze(trace.sel(crank_angle_cad=slice(-150, 130)), CYLINDER, point=POINT, pegging="inlet")
    with pytest.raises(ParameterError, match="needs inlet_pressure_kpa, or a point"):
        analyze(trace, CYLINDER, pegging="inlet")


def test_a_wrong_offset_moves_the_compression_exponent():
    cycle = simulate(ADIABATIC, MOTORED)
    sound = float(analyze(cycle, ADIABATIC, point=MOTORED).n_compression)
    assert sound == pytest.approx(1.37, abs=1e-3)
    low = float(analyze(moved(cycle, pressure=0.1), ADIABATIC, point=MOTORED).n_compression)
    assert sound - low == pytest.approx(0.03, abs=0.005)


def test_one_degree_of_tdc_costs_nine_percent_of_imep():
    for soc, percent in ((-6.0, 9.09), (-20.0, 12.8), (0.0, 8.4), (10.0, 8.1)):
        cycle = simulate(CYLINDER, POINT, soc_cad=soc)
        angle = cycle.crank_angle_cad.values

        def work(offset, angle=angle, pressure=cycle.pressure_bar.values):
            return np.trapezoid(pressure, _core.engine.volume_l(CYLINDER, angle + offset))

        assert 100.0 * (work(1.0) / work(0.0) - 1.0) == pytest.approx(percent, abs=0.1)
        if soc == -6.0:
            assert 100.0 * (work(-1.0) / work(0.0) - 1.0) == pytest.approx(-9.14, abs=0.1)
            assert 100.0 * (work(0.1) / work(0.0) - 1.0) == pytest.approx(0.91, abs=0.1)


FIGURES = [  # p_max, its angle, n_c, n_e, work, IMEP, CA50, net heat, CA50 with 1.37/1.30
    (126.5, 6, 1.377, 1.347, 1331.6, 7.19, 5.0, 2313, 4.6),
    (183.5, 8, 1.382, 1.330, 2540.1, 13.71, 6.9, 4434, 6.4),
    (230.4, 10, 1.378, 1.327, 3737.3, 20.17, 9.4, 6620, 8.9),
    (233.2, 10, 1.372, 1.320, 4857.5, 26.21, 14.9, 9074, 14.2),
]


@pytest.mark.parametrize("load", range(4))
def test_measured_traces_give_their_published_figures(load):
    cylinder, trace, own = (
        presets.load("hd_diesel_128x144").cylinder,
        datasets.load("hd_diesel_128x144")[load],
        FIGURES[load],
    )
    back = analyze(trace, cylinder)
    check_labels(back)
    assert trace.sizes["crank_angle_cad"] == 267
    assert float(trace.pressure_bar.max()) == pytest.approx(own[0], abs=0.05)
    assert float(trace.crank_angle_cad[int(trace.pressure_bar.values.argmax())]) == own[1]
    assert float(back.p_max_cad) == pytest.approx(own[1], abs=0.5)
    assert float(back.n_compression) == pytest.approx(own[2], abs=1e-3)
    assert float(back.n_expansion) == pytest.approx(own[3], abs=1e-3)
    work = float(back.imep_closed_bar) * cylinder.swept_volume_l * 100.0
    assert work == pytest.approx(own[4], abs=0.1)
    assert float(back.imep_closed_bar) == pytest.approx(own[5], abs=0.01)
    assert float(back.ca50_cad) == pytest.approx(own[6], abs=0.06)
    assert float(back.heat_net_j) == pytest.approx(own[7], abs=1.0)
    assert float(analyze(trace, cylinder, gamma="split").ca50_cad) == pytest.approx(own[8], abs=0.15)
    assert back.attrs["warnings"] == ""
    assert float(back.ca10_cad) < float(back.ca50_cad) < float(back.ca90_cad)


def test_a_motored_peak_far_from_tdc_is_noticed(caplog):
    motored = simulate(CYLINDER, MOTORED)
    assert analyze(motored, CYLINDER, point=MOTORED).attrs["warnings"] == ""
    assert analyze(moved(motored), CYLINDER, point=MOTORED).attrs["warnings"] == ""
    for error in (-3.0, 3.0):
        warnings = analyze(moved(motored, angle=error), CYLINDER, point=MOTORED).attrs["warnings"]
        assert "TDC" in warnings, error
    assert "TDC" in caplog.text


def test_a_suspect_compression_is_noticed():
    cycle = simulate(CYLINDER, POINT)
    warnings = analyze(moved(cycle, pressure=-0.5), CYLINDER, point=POINT).attrs["warnings"]
    assert "polytropic exponent of compression" in warnings


def test_noise_hardly_moves_work_and_middle():
    cycle = simulate(CYLINDER, POINT, step_cad=0.5)
    clean = analyze(moved(cycle), CYLINDER, point=POINT)
    noise = np.random.default_rng(5).normal(0.0, 0.05, cycle.sizes["crank_angle_cad"])
    noisy = analyze(
        pressure_trace(cycle.crank_angle_cad.values, cycle.pressure_bar.values + noise), CYLINDER, point=POINT
    )
    assert float(noisy.imep_closed_bar) == pytest.approx(float(clean.imep_closed_bar), rel=2e-3)
    assert float(noisy.ca50_cad) == pytest.approx(float(clean.ca50_cad), abs=0.2)


def test_conditions_come_from_the_trace_before_the_point():
    trace = datasets.load("hd_diesel_128x144")[0]
    cylinder = presets.load("hd_diesel_128x144").cylinder
    here = analyze(trace, cylinder)
    there = analyze(trace, cylinder, point=OperatingPoint(speed_rpm=5000.0, trapped_mass_g=1.0))
    assert float(here.t_max_k) == float(there.t_max_k)
    heavier = analyze(trace.assign_attrs(trapped_mass_g=2.0 * 3.0858), cylinder)
    assert float(heavier.t_max_k) == pytest.approx(0.5 * float(here.t_max_k), rel=1e-12)


@pytest.mark.parametrize(
    ("keyword", "match"),
    [
        ({"gamma": 1.0}, r"gamma = 1: must be in \(1, 1\.7\)"),
        ({"gamma": float("nan")}, "gamma = nan"),
        ({"gamma": "magic"}, "gamma = 'magic'.*split or cylinder"),
        ({"pegging": "auto"}, "pegging = 'auto'.*two_point"),
        ({"pegging": "two_point", "pegging_exponent": 0.9}, r"pegging_exponent = 0\.9"),
        ({"pegging": "inlet", "inlet_pressure_kpa": -1.0}, "inlet_pressure_kpa = -1"),
        ({"fractions": "both"}, "fractions = 'both'.*net or gross"),
        ({"heat_window_cad": (20.0, -10.0)}, "heat_from_cad = 20"),
    ],
)
def test_bad_options_are_refused_by_name(keyword, match):
    cycle = simulate(CYLINDER, POINT)
    before = cycle.copy(deep=True)
    with pytest.raises(ParameterError, match=match):
        analyze(cycle, CYLINDER, point=POINT, **keyword)
    assert cycle.identical(before)
