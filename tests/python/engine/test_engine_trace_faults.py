"""Faults of amplifier and sensor that the analysis names, and sound traces that it leaves alone."""

from __future__ import annotations

import numpy as np
import pytest

from mgdd import datasets, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.errors import ParameterError
from mgdd.io import pressure_trace

CYLINDER, POINT = Cylinder(), OperatingPoint(fuel_mg=20.0)


def analysed(*, spoil=lambda _, bar: bar, step=0.5, decimals=None, point=POINT, **said):
    """Analyse a simulated cycle with 0.05 bar of noise, spoilt, or rounded."""
    cycle = simulate(CYLINDER, point, soc_cad=-4.0, step_cad=step)
    angle = cycle["crank_angle_cad"].to_numpy()
    noisy = cycle["pressure_bar"].to_numpy() + 0.05 * np.random.default_rng(2).standard_normal(angle.size)
    bar = spoil(angle, noisy if decimals is None else np.round(noisy, decimals))
    trace = pressure_trace(angle, bar).assign_attrs(trapped_mass_g=cycle.attrs["trapped_mass_g"])
    return analyze(trace, CYLINDER, point=point, quiet=True, **said)


def test_equal_samples_of_a_coarse_converter_are_no_fault():
    for point in (POINT, POINT.replace(fuel_mg=0.0)):
        for step in (0.1, 1.0):
            for decimals in (0, 1):
                warnings = analysed(step=step, decimals=decimals, point=point).attrs["warnings"]
                assert not any(word in warnings for word in ("equal samples", "off its neighbours"))


def test_the_heat_of_the_stated_fuel_shows_a_wrong_gain():
    assert analysed(fuel_mg=20.0).attrs["warnings"] == ""
    for factor in (0.75, 1.25):
        spoilt = analysed(fuel_mg=20.0, spoil=lambda _, bar, factor=factor: factor * bar)
        assert "of the heat of the stated fuel, outside 0.83..1.18: suspect the gain" in spoilt.attrs["warnings"]
        assert "stated fuel" not in analysed(spoil=lambda _, bar, factor=factor: factor * bar).attrs["warnings"]
    with pytest.raises(ParameterError, match="fuel_mg"):
        analysed(fuel_mg=0.0)


def test_the_stated_brake_work_shows_a_wrong_gain():
    gross = float(simulate(CYLINDER, POINT, soc_cad=-4.0)["imep_gross_bar"])
    assert analysed(bmep_bar=gross - 1.5).attrs["warnings"] == ""
    assert "above the stated BMEP" in analysed(bmep_bar=gross - 6.5).attrs["warnings"]


def test_the_measured_traces_are_not_doubted():
    cylinder = presets.load("hd_diesel_128x144").cylinder
    assert [analyze(t, cylinder, quiet=True).attrs["warnings"] for t in datasets.read("hd_diesel_128x144")] == [""] * 4
