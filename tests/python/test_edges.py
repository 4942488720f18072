"""Edges of the parameter space: values that are allowed, states that are not, and answers that stay honest there."""

import math

import numpy as np
import pytest

from mgdd import datasets, io, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze, find_optimum, sensitivities, simulate
from mgdd.engine.cycle import convergence
from mgdd.errors import ConvergenceError, DataError, ParameterError, ShapeError
from mgdd.identify import ModelFamily, best_timing, fit_cylinder, wall_heat_profile
from mgdd.optimize import FitOptions

HD = presets.load("hd_diesel_128x144").cylinder
POINT = OperatingPoint(burn_duration_cad=30.0)
FEW = ModelFamily(gammas=[("linear", 1.40)], wall_heat_scales=[0.5, 1.0])


def test_no_piston_speed_term_still_has_derivatives() -> None:
    still = Cylinder(woschni_c2=0.0)
    d = sensitivities(still, POINT, wrt=["soc_cad", "fuel_mg"], soc_cad=-6.3)
    up, down = (simulate(still, POINT, soc_cad=-6.3 + h) for h in (1e-4, -1e-4))
    difference = float(up["imep_gross_bar"] - down["imep_gross_bar"]) / 2e-4
    assert float(d["d_imep_gross_bar"].sel(parameter="soc_cad")) == pytest.approx(difference, rel=1e-5)
    assert math.isfinite(find_optimum(still, POINT)["efficiency_gross"])


def test_fuel_at_zero_has_its_one_sided_derivative() -> None:
    motored = POINT.replace(fuel_mg=0.0)
    d = sensitivities(Cylinder(), motored, wrt=["fuel_mg"])
    rise = simulate(Cylinder(), POINT.replace(fuel_mg=1e-4)), simulate(Cylinder(), motored)
    difference = float(rise[0]["imep_gross_bar"] - rise[1]["imep_gross_bar"]) / 1e-4
    assert float(d["d_imep_gross_bar"].squeeze()) == pytest.approx(difference, rel=1e-3)
    assert np.isnan(d["d_ca50_cad"].values).all()  # a motored cycle has no burn to move


@pytest.mark.parametrize("run", [simulate, find_optimum, sensitivities, convergence])
def test_a_vacuum_at_ivc_is_refused(run) -> None:
    with pytest.raises(ParameterError, match=r"ivc_pressure_rise_kpa = -200 kPa: p\(IVC\) is -50 kPa"):
        run(Cylinder(ivc_pressure_rise_kpa=-200.0), POINT)


def test_a_cycle_that_leaves_the_numbers_says_where() -> None:
    greedy = Cylinder(wall_heat_scale=30.0)
    slow = POINT.replace(speed_rpm=100.0)
    with pytest.raises(ConvergenceError, match="leaves the physical range at"):
        simulate(greedy, slow, step_cad=5.0)


def test_slips_of_units_are_told() -> None:
    assert simulate(Cylinder(), POINT).attrs["warnings"] == ""
    for cylinder, point in (
        (Cylinder(), POINT.replace(fuel_mg=500.0)),
        (Cylinder(), POINT.replace(intake_temperature_k=20.0)),
        (Cylinder(), POINT.replace(trapped_mass_g=0.001)),
    ):
        assert simulate(cylinder, point).attrs["warnings"]


def test_a_second_burn_may_not_start_before_ivc() -> None:
    early = Cylinder(burn_shape="double_wiebe", second_delay_cad=-60.0, ivc_cad=-70.0)
    with pytest.raises(ParameterError, match=r"second_delay_cad = -60 °CA: the burn starts at -80"):
        simulate(early, POINT, soc_cad=-20.0)


def test_wall_heat_follows_the_heat_not_its_bookkeeping() -> None:
    """The same heat release as one Wiebe law, or as the second of two with the first empty, loses the same heat."""
    plain = Cylinder(burn_shape="wiebe", wiebe_m=1.2)
    second = Cylinder(
        burn_shape="double_wiebe",
        second_fraction=1.0,
        second_delay_cad=-8.0,
        second_duration_cad=30.0,
        second_wiebe_m=1.2,
    )
    one, two = simulate(plain, POINT, soc_cad=-10.0), simulate(second, POINT, soc_cad=-2.0)
    np.testing.assert_allclose(two["pressure_bar"], one["pressure_bar"], rtol=1e-12)


@pytest.mark.parametrize(
    "point",
    [
        POINT.replace(intake_temperature_k=350.0),
        POINT.replace(trapped_mass_g=1.2),
    ],
)
def test_analysis_knows_the_charge_of_a_simulation(point: OperatingPoint) -> None:
    for cylinder in (Cylinder(), Cylinder(ivc_pressure_rise_kpa=20.0)):
        back = analyze(simulate(cylinder, point), cylinder)
        assert float(back["heat_gross_j"]) == pytest.approx(856.0, rel=1e-9)


def test_limits_of_several_kinds() -> None:
    alone = find_optimum(Cylinder(), POINT, limits={"p_max_bar": 95.0})
    both = find_optimum(Cylinder(), POINT, limits={"p_max_bar": 95.0, "ca50_cad": 12.0})
    assert both["soc_cad"] == pytest.approx(alone["soc_cad"], abs=1e-6)
    narrow = find_optimum(Cylinder(), POINT, limits={"p_max_bar": 95.0, "ca50_cad": 11.95})  # a window of 0.03 CAD
    assert alone["soc_cad"] - 1e-6 <= narrow["soc_cad"] <= -3.05
    early = find_optimum(Cylinder(), POINT, limits={"ca50_cad": -3.0})
    assert early["soc_cad"] == pytest.approx(-18.0, abs=1e-6)
    late = find_optimum(Cylinder(ivc_cad=-20.0), POINT)
    assert math.isfinite(late["soc_cad"])


def test_profile_follows_the_fit_and_never_invents_its_range() -> None:
    trace = datasets.read("hd_diesel_128x144")[1:2]
    fit = fit_cylinder(trace, HD, free=["soc_cad", "burn_duration_cad", "fuel_heat_j", "wiebe_m", "wall_heat_scale"])
    profile = wall_heat_profile(fit, scales=[0.5])
    scales = profile.dataset["wall_heat_scale"].values
    assert {0.0, 2.5} <= set(scales.round(12))
    best = float(profile.dataset["rmse_percent"].min())
    assert best == pytest.approx(100.0 * fit.report.rmse, rel=1e-3)  # the same parameters are free
    edge = float(profile.dataset["rmse_percent"].sel(wall_heat_scale=profile.range_high, method="nearest"))
    assert profile.range_high == 2.5 or edge == pytest.approx(1.1 * best, rel=0.02)


def test_profile_of_an_unfinished_fit_says_so() -> None:
    trace = datasets.read("hd_diesel_128x144")[1:2]
    bad = fit_cylinder(
        trace, HD.replace(burn_shape="double_wiebe", gamma_model="constant"), options=FitOptions(max_iterations=2)
    )
    profile = wall_heat_profile(bad, scales=[0.5, 1.0])
    assert not profile.identifiable
    assert "did not converge" in profile.reasons[0]
    only = fit_cylinder(trace, HD, free=["wall_heat_scale"])
    with pytest.raises(ParameterError, match="only free parameter"):
        wall_heat_profile(only)


def test_start_is_checked_before_the_fit() -> None:
    trace = datasets.read("hd_diesel_128x144")[1:2]
    with pytest.raises(ParameterError, match=r"start of second_fraction\[pressure_a50_bar\] = 5: must be in \[0, 1\]"):
        fit_cylinder(trace, HD, start_values=[{"second_fraction": 5.0}])
    with pytest.raises(ParameterError, match="fuel_heat_j"):
        fit_cylinder(trace, HD, start_values=[{"fuel_heat_j": math.nan}])
    with pytest.raises(ShapeError, match="list of traces"):
        fit_cylinder(trace[0], HD)
    assert fit_cylinder(trace, HD).report.success


def test_a_trace_that_lacks_the_closed_part_is_doubted() -> None:
    whole = datasets.read("hd_diesel_128x144")[1]
    part = io.pressure_trace(whole["crank_angle_cad"].values[83:-63], whole["pressure_bar"].values[83:-63], name="part")
    assert "spans" in analyze(part, HD).attrs["warnings"]
    with pytest.raises(DataError, match=r"'part' starts at -60.*trapped_mass_g"):
        fit_cylinder([part], HD)
    shifted = io.pressure_trace(
        whole["crank_angle_cad"].values[:-12] + 10.0, whole["pressure_bar"].values[:-12], name="late"
    )
    fit = fit_cylinder([shifted], HD)
    assert any(found.code == "doubtful_trace" and "TDC" in found.text for found in fit.findings)


def test_best_timing_refuses_a_wrong_limit_before_any_fit() -> None:
    seen: list[str] = []
    with pytest.raises(ParameterError, match="'pmax' is not an indicator"):
        best_timing(datasets.read("hd_diesel_128x144")[:1], HD, limits={"pmax": 90.0}, progress=seen.append)
    assert seen == []
    (row,) = best_timing(datasets.read("hd_diesel_128x144")[:1], HD, bounds_cad=(-1.0, 2.0), family=FEW)
    assert all(-1.0 <= answer.free_soc_cad <= 2.0 for answer in row.members)
    assert any(answer.at_bound for answer in row.members)
