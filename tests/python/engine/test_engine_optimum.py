"""The best timing: against a golden-section search, under limits, and the published ranges of the measured engine."""

from __future__ import annotations

import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from mgdd import _core, datasets, presets
from mgdd.engine import Cylinder, OperatingPoint, find_optimum, simulate
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.identify import fit_cylinder

CYLINDER, POINT = Cylinder(), OperatingPoint()


def value(cylinder, point, soc, name="efficiency_gross"):
    return float(_core.engine.scan(cylinder, point, np.array([soc]), 1.0, "trapezoid")[name][0])


@given(
    speed=st.floats(900.0, 3000.0),
    fuel=st.floats(6.0, 40.0),
    scale=st.floats(0.0, 1.5),
    shape=st.sampled_from(("triangle", "wiebe")),
    objective=st.sampled_from(("efficiency_gross", "imep_gross_bar", "imep_closed_bar")),
)
@settings(max_examples=25)
def test_agrees_with_a_search_without_derivatives(speed, fuel, scale, shape, objective):
    cylinder = CYLINDER.replace(wall_heat_scale=scale, burn_shape=shape)
    point = POINT.replace(speed_rpm=speed, fuel_mg=fuel)
    best = find_optimum(cylinder, point, objective)
    other = minimize_scalar(
        lambda soc: -value(cylinder, point, soc, objective),
        bounds=(-30.0, 10.0),
        method="bounded",
        options={"xatol": 1e-6},
    )
    assert best.value >= -other.fun * (1.0 - 1e-9)
    assert best["soc_cad"] == pytest.approx(other.x, abs=0.02)
    assert best.value == value(cylinder, point, best["soc_cad"], objective)
    assert best.objective == objective
    assert not best.at_bound
    assert best.active_limits == ()


def test_default_optimum_and_how_flat_it_is():
    best = find_optimum(CYLINDER, POINT)
    assert best["soc_cad"] == pytest.approx(-5.63, abs=0.15)
    assert best["ca50_cad"] == pytest.approx(9.37, abs=0.15)
    assert 6.0 < best["ca50_cad"] < 12.0
    assert best.curvature == pytest.approx(-5.1e-4, rel=0.05)
    # Three degrees beside it cost 0.23 points.
    assert best.value - value(CYLINDER, POINT, best["soc_cad"] + 3.0) == pytest.approx(2.3e-3, rel=0.1)


def test_the_burn_moves_later_with_wall_heat():
    ca50 = [find_optimum(CYLINDER.replace(wall_heat_scale=s), POINT)["ca50_cad"] for s in (0.0, 0.5, 1.0, 2.0)]
    np.testing.assert_allclose(ca50, [0.0, 9.4, 13.4, 17.9], atol=0.2)
    assert ca50[0] == pytest.approx(0.0, abs=0.05)


def test_what_hardly_matters():
    start = find_optimum(CYLINDER, POINT)["soc_cad"]

    def shift(**changes):
        return find_optimum(CYLINDER.replace(**changes), POINT)["soc_cad"] - start

    assert shift(connecting_rod_mm=140.0) == pytest.approx(-0.14, abs=0.02)
    assert shift(ivc_cad=-120.0) == pytest.approx(-0.5, abs=0.05)
    assert shift(evo_cad=150.0) == pytest.approx(0.1, abs=0.05)
    assert shift(compression_ratio=16.0) == pytest.approx(-0.7, abs=0.05)
    assert shift(wall_temperature_k=500.0) - shift(wall_temperature_k=400.0) == pytest.approx(-0.24, abs=0.02)
    low = find_optimum(CYLINDER.replace(compression_ratio=16.0), POINT)
    assert 100.0 * (low["efficiency_gross"] - 0.5619) == pytest.approx(-0.8, abs=0.05)


@pytest.mark.parametrize(("name", "limit"), [("p_max_bar", 95.0), ("dp_max_bar_per_cad", 2.5), ("t_max_k", 1900.0)])
def test_a_limit_is_kept_and_named(name, limit):
    best = find_optimum(CYLINDER, POINT, limits={name: limit})
    assert best.active_limits == (name,)
    assert value(CYLINDER, POINT, best["soc_cad"], name) <= limit
    assert value(CYLINDER, POINT, best["soc_cad"], name) == pytest.approx(limit, rel=1e-6)
    free = find_optimum(CYLINDER, POINT)
    assert best.value < free.value
    assert best["soc_cad"] > free["soc_cad"]
    loose = find_optimum(CYLINDER, POINT, limits={name: 1e4})
    assert loose["soc_cad"] == free["soc_cad"]
    assert loose.active_limits == ()


def test_two_limits_and_the_one_that_bites():
    best = find_optimum(CYLINDER, POINT, limits={"p_max_bar": 95.0, "t_max_k": 2500.0})
    assert best.active_limits == ("p_max_bar",)
    assert {limit.name: limit.upper for limit in best.limits} == {"p_max_bar": 95.0, "t_max_k": 2500.0}


def test_a_limit_that_nothing_reaches_is_a_finding() -> None:
    far = find_optimum("puma_single", limits={"p_max_bar": 95.0, "p_max_cad": 95.0})
    assert far.active_limits == ("p_max_bar",)
    (found,) = far.findings
    assert (found.code, found.names) == ("idle_limit", ("p_max_cad",))
    assert "not reached for soc_cad in [-30, 10]" in found.text
    assert pickle.loads(pickle.dumps(far)).findings == far.findings
    assert json.loads(json.dumps(far.to_dict()))["findings"][0]["code"] == "idle_limit"


@pytest.mark.parametrize(
    ("guess", "meant"),
    [
        ("pmax", "did you mean 'p_max_bar'?"),
        ("p_max", "did you mean 'p_max_bar'?"),
        ("dpmax", "did you mean 'dp_max_bar_per_cad'?"),
        ("imep", "did you mean 'imep_closed_bar' or 'imep_gross_bar'?"),
    ],
)
def test_a_limit_of_another_name_is_led_to_what_can_be_one(guess: str, meant: str) -> None:
    with pytest.raises(ParameterError) as refused:
        find_optimum("puma_single", limits={guess: 95.0})
    assert str(refused.value).endswith(meant)


def test_unreachable_limits_say_how_near_they_come():
    with pytest.raises(ConvergenceError, match=r"p_max_bar >= 70\.11 \(limit 50\).*bounds_cad"):
        find_optimum(CYLINDER, POINT, limits={"p_max_bar": 50.0})


def test_the_edge_of_the_range_is_marked():
    late = find_optimum(CYLINDER, POINT, bounds_cad=(0.0, 10.0))
    assert late.at_bound
    assert late["soc_cad"] == 0.0
    early = find_optimum(CYLINDER, POINT, bounds_cad=(-30.0, -10.0))
    assert early.at_bound
    assert early["soc_cad"] == -10.0
    edge = find_optimum(CYLINDER, POINT, bounds_cad=(18.0, 20.0))
    assert math.isnan(edge.curvature)


@pytest.mark.parametrize(
    ("arguments", "keyword", "match"),
    [
        (("torque",), {}, "objective = 'torque'.*efficiency_gross"),
        ((), {"limits": {"pmax": 90.0}}, "'pmax' is not an indicator.*p_max_bar"),
        ((), {"limits": {"p_max_bar": math.nan}}, "p_max_bar = nan"),
        ((), {"bounds_cad": (10.0, -30.0)}, "bounds_cad"),
        ((), {"bounds_cad": (-90.0, 0.0)}, r"bounds_cad.*\[-60, 20\]"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, keyword, match):
    with pytest.raises(ParameterError, match=match):
        find_optimum(CYLINDER, POINT, *arguments, **keyword)


def test_a_motored_point_has_no_optimum():
    with pytest.raises(ParameterError, match="fuel_mg = 0"):
        find_optimum(CYLINDER, POINT.replace(fuel_mg=0.0))


def test_the_best_timing_of_the_measured_engine_depends_on_the_unknown_wall_heat():
    # The published figures maximise closed work; gains in % at full load, without a pressure limit.
    cylinder, traces = presets.load("hd_diesel_128x144").cylinder, datasets.read("hd_diesel_128x144")
    published = {0.0: (-9.8, -18.3, 5.9), 0.5: (-5.9, -13.9, 2.8), 1.0: (-3.7, -11.2, 1.2)}
    for scale, (light, full, gain) in published.items():
        free = ["soc_cad", "burn_duration_cad", "fuel_heat_j"]
        # The published fits let the burn start before the injection.
        fit = fit_cylinder(traces, cylinder.replace(wall_heat_scale=scale), free=free, bounds={"soc_cad": (None, None)})
        found = [find_optimum(load.cylinder, load.point, "imep_closed_bar", step_cad=0.25) for load in fit.loads]
        assert found[0]["soc_cad"] == pytest.approx(light, abs=0.1)
        assert found[3]["soc_cad"] == pytest.approx(full, abs=0.1)
        last = fit.loads[3]
        now = simulate(last.cylinder, last.point, soc_cad=last.soc_cad, step_cad=0.25)
        assert 100.0 * (found[3].value / float(now.imep_closed_bar) - 1.0) == pytest.approx(gain, abs=0.12)
