"""Exact derivatives against extrapolated differences, and laws that need none."""

from __future__ import annotations

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint, sensitivities, simulate
from mgdd.errors import ParameterError
from mgdd.results.labels import check_labels

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
