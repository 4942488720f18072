"""The best timing of the cycle model as a guide: against the offline search, its cache, calibration and pickles."""

from __future__ import annotations

from typing import Any

import pytest

from mgdd.engine import Cylinder, OperatingPoint, find_optimum
from mgdd.errors import Error, ParameterError
from mgdd.guide import ModelOptimum

POINTS = [OperatingPoint(speed_rpm=n, fuel_mg=m) for n, m in ((1000.0, 8.0), (1500.0, 20.0), (2600.0, 35.0))]


@pytest.mark.parametrize("method", ["gradient", "golden_section"])
@pytest.mark.parametrize("point", POINTS)
def test_finds_what_the_offline_search_finds(point: OperatingPoint, method: str) -> None:
    guide = ModelOptimum(Cylinder(), method=method)
    best, offline = guide(point), find_optimum(Cylinder(), point)
    assert best is not None
    assert best["soc_cad"] == pytest.approx(offline["soc_cad"], abs=0.06)
    assert best.value == pytest.approx(100.0 * offline.value, abs=2e-3)
    assert best.curvature == pytest.approx(100.0 * offline.curvature, rel=0.03)
    assert guide(point) is best  # each point is searched once


def test_a_calibration_is_searched_anew() -> None:
    guide, hot = ModelOptimum(Cylinder()), Cylinder(wall_heat_scale=1.0)
    before = guide(POINTS[1])
    guide.calibrate(hot)
    after, offline = guide(POINTS[1]), find_optimum(hot, POINTS[1])
    assert before is not None
    assert after is not None
    assert after["soc_cad"] == pytest.approx(offline["soc_cad"], abs=0.06)
    assert abs(after["soc_cad"] - before["soc_cad"]) > 2.0
    with pytest.raises(ParameterError, match="geometry"):
        guide.calibrate(Cylinder(bore_mm=90.0))
    assert guide.cylinder == hot


def test_knows_where_there_is_no_optimum() -> None:
    assert ModelOptimum(Cylinder())(OperatingPoint(fuel_mg=0.0)) is None
    with pytest.raises(ParameterError, match="point"):
        ModelOptimum(Cylinder())((1500.0, 20.0))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"bounds_cad": (10.0, -30.0)}, "upper_cad"),
        ({"bounds_cad": (-70.0, 10.0)}, "lower_cad"),
        ({"method": "newton"}, "method"),
    ],
)
def test_refused_settings_are_named(change: dict[str, Any], field: str) -> None:
    with pytest.raises(Error, match=field):
        ModelOptimum(Cylinder(), **change)
