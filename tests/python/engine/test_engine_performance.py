"""NOx models, soft sensor, fit and performance from Python: values, records, errors."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from mgdd.engine import (
    Cylinder,
    NoxModel,
    NoxProxy,
    OperatingPoint,
    Performance,
    PerformanceTerm,
    SoftSensor,
    fit_nox_proxy,
    timing_sweep,
)
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.loop import SensorDynamics

RECORDS = [
    NoxProxy(reference_nox_ppm=700.0),
    NoxModel(map="arrhenius", intake_o2_fraction=0.18),
    SoftSensor(model=NoxModel(o2_exponent=2.0), correction_gain=0.02),
    PerformanceTerm("p_max_bar", -2.0, above=120.0),
    Performance([PerformanceTerm("imep_gross_bar", 3.0, reference=2.0), PerformanceTerm("nox_ppm", -0.01)]),
    SensorDynamics(delay_s=1.0, lag_cycles=4.0),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda r: type(r).__name__)
def test_records_are_values(record: object) -> None:
    kind = type(record)
    for twin in (pickle.loads(pickle.dumps(record)), kind(**record.to_dict())):
        assert twin == record
        assert hash(twin) == hash(record)
    assert record != "something else"
    names = {"NoxProxy": NoxProxy, "NoxModel": NoxModel, "SoftSensor": SoftSensor, "Performance": Performance}
    names |= {"PerformanceTerm": PerformanceTerm, "SensorDynamics": SensorDynamics}
    assert eval(repr(record), {"__builtins__": {}}, names) == record
    assert all(other is record or other != record for other in RECORDS)


def test_soft_sensor_on_arrays() -> None:
    sensor = SoftSensor(model=NoxModel(map="arrhenius"))
    t = np.array([1800.0, 1900.0, 2000.0])
    np.testing.assert_allclose(sensor.ppm(t), NoxProxy().arrhenius_ppm(t))
    np.testing.assert_allclose(sensor.ppm(t, ln_bias=0.2), np.exp(0.2) * sensor.ppm(t))
    bias = 0.0
    for _ in range(100):
        bias = sensor.next_bias(bias, analyser_ppm=900.0, delayed_soft_ppm=1000.0)
    assert bias == pytest.approx(np.log(0.9) * (1.0 - 0.99**100))


def test_fit_of_a_model_sweep_reads_its_own_proxy_back() -> None:
    sweep = timing_sweep(Cylinder(), OperatingPoint(), soc_cad=np.linspace(-15.0, 5.0, 9))
    t = sweep["t_max_k"].values
    fit = fit_nox_proxy(t, NoxProxy().arrhenius_ppm(t), map="arrhenius")
    assert fit.proxy.reference_nox_ppm == pytest.approx(1200.0)
    assert fit.proxy.activation_temperature_k == pytest.approx(16000.0)
    # The other map misses the curvature, and its residual says so.
    other = fit_nox_proxy(t, NoxProxy().arrhenius_ppm(t))
    assert other.map == "affine_log"
    assert 1e-3 < other.residual_ln < 0.1
    assert other.activation_temperature_stderr_k > 0.0
    assert "NoxFit(" in repr(other)


def test_fit_refuses_what_is_no_sweep() -> None:
    t = [1800.0, 1850.0, 1900.0, 1950.0, 2000.0]
    with pytest.raises(DataError, match="t_max_k has 4 points: a fit needs at least 5"):
        fit_nox_proxy(t[:4], [1.0, 2.0, 3.0, 4.0])
    with pytest.raises(DataError, match=r"nox_ppm\[1\] = -2"):
        fit_nox_proxy(t, [1.0, -2.0, 3.0, 4.0, 5.0])
    with pytest.raises(DataError, match="nox_ppm does not rise with t_max_k"):
        fit_nox_proxy(t, [5.0, 4.0, 3.0, 2.0, 1.0])
    with pytest.raises(ShapeError, match="nox_ppm has 2 entries: t_max_k has 5"):
        fit_nox_proxy(t, [1.0, 2.0])
    with pytest.raises(ParameterError, match="map = 'cubic': must be one of affine_log, arrhenius"):
        fit_nox_proxy(t, t, map="cubic")


def test_performance_takes_signals_by_name() -> None:
    hinge = PerformanceTerm("dp_max_bar_per_cad", -2.0, above=10.0)
    j = Performance([PerformanceTerm("efficiency_percent", 2.0, reference=56.0), hinge])
    signals = {"efficiency_percent": 28.0, "dp_max_bar_per_cad": 20.0, "unused": 1.0}
    np.testing.assert_allclose(j.components(signals), [1.0, -2.0])
    assert j.value(signals) == -1.0
    assert len(j) == 2
    assert j.terms[1] == hinge
    with pytest.raises(ParameterError, match="signals lack 'dp_max_bar_per_cad'"):
        j.value({"efficiency_percent": 28.0})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Performance([]), "terms has 0 entries: must be 1 to 8"),
        (lambda: Performance([PerformanceTerm("nox_ppm")] * 9), "terms has 9 entries"),
        (lambda: Performance.efficiency_and_nox(-1.0), "nox_weight_percent_per_ppm = -1 %/ppm: must be in"),
        (lambda: PerformanceTerm("torque"), "signal = 'torque': must be one of efficiency_percent"),
        (lambda: PerformanceTerm("nox_ppm", reference=0.0), "reference = 0 ppm: must be > 0"),
        (lambda: PerformanceTerm("nox_ppm", above=-1.0), "above = -1 ppm: must be > 0"),
        (lambda: PerformanceTerm("nox_ppm", float("inf")), "weight = inf: must be finite"),
        (lambda: SensorDynamics().delay_at(-1.0), r"speed_rpm = -1 rpm: must be in \[0, 100000\]"),
        (lambda: SensorDynamics(delay_s=100.0), r"sensor.delay_s = 100 s: must be in \[0, 60\]"),
    ],
)
def test_records_refuse_by_name(make: object, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        make()
