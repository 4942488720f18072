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
    ThermalNo,
    analyze,
    fit_nox_proxy,
    nox_at_reference_humidity,
    nox_g_per_kwh,
    simulate,
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


TRUE = ThermalNo(lambda_burned=1.02, calibration=0.35, mixing_time_ms=1.5)
TIMINGS = (-12.0, -9.0, -6.0, -3.0, 0.0, 3.0)


@pytest.fixture(scope="module")
def sweep():
    """Give cycles of one engine over timing and load, their points, and what a plant of another mixture emits."""
    random = np.random.default_rng(11)
    points = [OperatingPoint(speed_rpm=1400.0, fuel_mg=fuel) for fuel in (12.0, 20.0) for _ in TIMINGS]
    cycles = [simulate(Cylinder(), p, soc_cad=soc) for p, soc in zip(points, 2 * TIMINGS, strict=True)]
    nox = [float(TRUE.cycle(c, Cylinder(), point=p)["nox_ppm"]) for c, p in zip(cycles, points, strict=True)]
    return cycles, points, np.array(nox) * np.exp(0.03 * random.standard_normal(len(nox)))


def test_measured_pressure_gives_the_no_of_the_cycle_behind_it() -> None:
    point = OperatingPoint()
    cycle = simulate(Cylinder(), point, soc_cad=-7.0, step_cad=0.5)
    back = analyze(cycle, Cylinder(), point=point, gamma="cylinder", fractions="gross")
    direct, measured = (ThermalNo().cycle(c, Cylinder(), point=point) for c in (cycle, back))
    assert float(measured["nox_ppm"]) == pytest.approx(float(direct["nox_ppm"]), rel=0.01)
    assert float(measured["flame_max_k"]) == pytest.approx(float(direct["flame_max_k"]), abs=5.0)
    assert float(direct["no_ppm"][-1]) == float(direct["nox_ppm"])


def test_the_fit_finds_mixture_and_factor_of_another_plant(sweep) -> None:
    cycles, points, nox = sweep
    found = ThermalNo(mixing_time_ms=1.5).fit(cycles, nox, Cylinder(), point=points)
    assert found.points == 12
    assert found.lambda_low <= 1.02 <= found.lambda_high
    assert found.model.lambda_burned == pytest.approx(1.02, abs=0.05)
    assert found.model.calibration == pytest.approx(0.35, rel=0.25)
    assert 0.01 < found.residual_ln < 0.06
    assert found.doubts == ()
    exact = [float(TRUE.cycle(c, Cylinder(), point=p)["nox_ppm"]) for c, p in zip(cycles, points, strict=True)]
    sharp = ThermalNo(mixing_time_ms=1.5).fit(cycles, exact, Cylinder(), point=points)
    assert sharp.doubts == ()
    assert sharp.model.lambda_burned == pytest.approx(1.02, abs=0.01)
    assert sharp.lambda_high - sharp.lambda_low < 0.5 * (found.lambda_high - found.lambda_low)


def test_a_fitted_half_tells_the_other_half_where_a_proxy_of_temperature_does_not(sweep) -> None:
    cycles, points, nox = sweep
    low, high = slice(0, 6), slice(6, 12)  # loads
    found = ThermalNo().fit(cycles[low], nox[low], Cylinder(), point=points[low]).model
    told = [
        float(found.cycle(c, Cylinder(), point=p)["nox_ppm"]) for c, p in zip(cycles[high], points[high], strict=True)
    ]
    t_max = np.array([float(c["t_max_k"]) for c in cycles])
    proxy = fit_nox_proxy(t_max[low], nox[low], map="arrhenius").proxy.arrhenius_ppm(t_max[high])
    error, of_proxy = (np.sqrt(np.mean(np.log(each / nox[high]) ** 2)) for each in (np.array(told), np.array(proxy)))
    assert error < 0.15
    assert error < 0.5 * of_proxy


def test_few_or_like_cycles_are_doubted(sweep) -> None:
    cycles, points, nox = sweep
    one = ThermalNo().fit(cycles[:1], nox[:1], Cylinder(), point=points[0])
    assert "1 cycle(s): the mixture stays 1.1" in one.doubts[0]
    assert np.isnan(one.residual_ln)
    again = ThermalNo(calibration=one.model.calibration).cycle(cycles[0], Cylinder(), point=points[0])
    assert float(again["nox_ppm"]) == pytest.approx(nox[0], rel=1e-12)
    noisy = nox[2] * np.array([1.0, 0.7, 1.3, 0.9])
    alike = ThermalNo().fit([cycles[2]] * 4, noisy, Cylinder(), point=points[2])
    assert "leave the mixture open" in alike.doubts[0]
    grams = ThermalNo().fit(cycles[:1], nox[:1] * 1e-6, Cylinder(), point=points[0])
    assert "unit of nox_ppm" in grams.doubts[1]


def test_a_proxy_takes_its_slope_from_the_model(sweep) -> None:
    cycles, points, _ = sweep
    fit = fit_nox_proxy(
        [float(c["t_max_k"]) for c in cycles[:6]],
        [float(TRUE.cycle(c, Cylinder(), point=p)["nox_ppm"]) for c, p in zip(cycles[:6], points[:6], strict=True)],
    )
    assert isinstance(fit.proxy, NoxProxy)
    assert fit.residual_ln < 0.15


def test_bad_input_is_refused_by_name(sweep) -> None:
    cycles, points, nox = sweep
    with pytest.raises(ParameterError, match=r"lambda_burned = 9: must be in \[0.7, 3\]"):
        ThermalNo(lambda_burned=9.0).cycle(cycles[0], Cylinder(), point=points[0])
    with pytest.raises(ParameterError, match="rates = 'fast'"):
        ThermalNo(rates="fast").cycle(cycles[0], Cylinder(), point=points[0])
    with pytest.raises(DataError, match="the cycle has no temperature_k"):
        ThermalNo().cycle(cycles[0].drop_vars("temperature_k"), Cylinder(), point=points[0])
    with pytest.raises(DataError, match="the cycle has no burned_fraction or heat"):
        ThermalNo().cycle(cycles[0].drop_vars("burned_fraction"), Cylinder(), point=points[0])
    with pytest.raises(DataError, match="give one cycle"):
        ThermalNo().cycle(cycles[0].expand_dims(cycle=[1, 2]), Cylinder(), point=points[0])
    with pytest.raises(DataError, match=r"nox_ppm\[1\] = -3.0: must be > 0|nox_ppm\[1\] = -3"):
        ThermalNo().fit(cycles[:2], [100.0, -3.0], Cylinder(), point=points[0])
    with pytest.raises(ShapeError, match="2 cycles, 3 values of nox_ppm"):
        ThermalNo().fit(cycles[:2], nox[:3], Cylinder(), point=points[0])
    with pytest.raises(DataError, match="no cycle"):
        ThermalNo().fit([], [], Cylinder(), point=points[0])
    with pytest.raises(ParameterError, match="exhaust_kg_per_h = 0"):
        nox_g_per_kwh(100.0, exhaust_kg_per_h=0.0, power_kw=1.0)
    with pytest.raises(ParameterError, match=r"intake_water_fraction = 0\.5"):
        nox_at_reference_humidity(100.0, 0.5)
    with pytest.raises(ParameterError, match="ignition = 'glow'"):
        nox_at_reference_humidity(100.0, 0.01, ignition="glow")


def test_humidity_as_the_rule_computes_it() -> None:
    assert float(nox_at_reference_humidity(700.5, 0.022)) == pytest.approx(736.2, abs=0.05)
    assert float(nox_at_reference_humidity(154.7, 0.022, ignition="spark")) == pytest.approx(169.5, abs=0.05)
