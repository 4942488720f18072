"""Bad input to records, engine and calibration: an error that names field, value and remedy, and nothing changed."""

import math

import numpy as np
import pytest

from mgdd import _core
from mgdd.control import Pid, SlidingMode, ThrottleSupervisor
from mgdd.engine import Cylinder, NoxProxy, OperatingPoint, analyze, ignition_delay, simulate, timing_sweep
from mgdd.engine.cycle import convergence
from mgdd.errors import DataError, Error, ParameterError
from mgdd.identify import fit_cylinder
from mgdd.io import pressure_trace
from mgdd.optimize import FitOptions
from mgdd.rig import SafetyEnvelope
from mgdd.throttle import DemandChain, SensorPair, Throttle

CYLINDER, POINT = Cylinder(), OperatingPoint()
RECORDS = (Cylinder, OperatingPoint, Throttle, SensorPair, DemandChain, SafetyEnvelope)
CONTROLLERS = (Pid, SlidingMode, ThrottleSupervisor)
NUMBERS = [(kind, name) for kind in RECORDS + CONTROLLERS for name, field in kind.fields().items() if "lower" in field]
IDS = [f"{kind.__name__}.{name}" for kind, name in NUMBERS]


@pytest.mark.parametrize(("kind", "name"), NUMBERS, ids=IDS)
def test_every_field_refuses_what_is_outside_its_domain_and_changes_nothing(kind, name):
    field, good = kind.fields()[name], kind()
    below = field["lower"] if field["lower_open"] else field["lower"] - 1.0
    for bad in (math.nan, math.inf, -math.inf, below, field["upper"] * 2.0 + 1.0):
        for build in (kind, *([good.replace] if kind in RECORDS else [])):
            with pytest.raises(ParameterError, match=r"must be|must lie") as caught:
                build(**{name: bad})
            assert name in str(caught.value) or "before evo_cad" in str(caught.value)
    with pytest.raises((ParameterError, TypeError)):
        kind(**{name: "wide"})
    if kind in RECORDS:
        assert good == kind()
        assert good.replace(**{name: getattr(good, name)}) == good  # right after wrong


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"connecting_rod_mm": 40.0}, r"connecting_rod_mm = 40 mm: must be longer than the crank radius.*86"),
        ({"ivc_cad": 130.0, "evo_cad": 120.0}, r"ivc_cad = 130 °CA aTDC: must be before evo_cad = 120"),
        ({"ivc_cad": 140.0}, r"ivc_cad = 140 °CA aTDC.*°bTDC"),
        ({"ivc_cad": 140.0, "evo_cad": 150.0}, r"ivc_cad = 140.*°bTDC.*pass -140"),
        ({"evo_cad": 490.0}, r"evo_cad = 490.*firing TDC = 0"),
        ({"gamma_model": "linear", "gamma_linear_slope_per_k": -1.9e-4}, r"gamma_linear_slope_per_k.*must stay > 1"),
        ({"burn_shape": "square"}, r"burn_shape = 'square': must be one of triangle, wiebe, double_wiebe"),
        ({"gamma_model": "cubic"}, r"gamma_model = 'cubic'.*polynomial"),
        ({"wall_heat_model": "annand"}, r"wall_heat_model = 'annand'.*hohenberg"),
        ({"ignition_model": "magic"}, r"ignition_model = 'magic'.*watson"),
    ],
)
def test_cylinders_that_cannot_be(changes, match):
    with pytest.raises(ParameterError, match=match):
        Cylinder(**changes)
    with pytest.raises(ParameterError, match=match):
        CYLINDER.replace(**changes)
    assert Cylinder() == CYLINDER


def test_unknown_fields_suggest_the_nearest():
    with pytest.raises(ParameterError, match="no field 'bore': did you mean 'bore_mm'"):
        CYLINDER.replace(bore=90.0)
    with pytest.raises(ParameterError, match="no field 'fuel': did you mean 'fuel_mg'"):
        POINT.replace(fuel=10.0)
    with pytest.raises(ParameterError, match="bore_mm = True: must be one number"):
        CYLINDER.replace(bore_mm=True)
    for make in (OperatingPoint, POINT.replace):
        with pytest.raises(ParameterError, match="burn_duration_cad = True: must be one number"):
            make(burn_duration_cad=True)
    with pytest.raises(ParameterError, match="burn_shape = 3: must be a name"):
        CYLINDER.replace(burn_shape=3)


TIMED = [
    lambda soc: simulate(CYLINDER, POINT, soc_cad=soc),
    lambda soc: timing_sweep(CYLINDER, POINT, soc_cad=[-6.0, soc]),
    lambda soc: convergence(CYLINDER, POINT, soc_cad=soc),
    lambda soc: ignition_delay(CYLINDER, POINT, soc_cad=soc),
]


@pytest.mark.parametrize("call", TIMED)
@pytest.mark.parametrize(
    ("soc", "match"),
    [
        (25.0, r"= 25 °CA aTDC: must be <= 20; this looks like °bTDC.*pass -25"),
        (354.0, r"= 354 °CA aTDC: must be in \[-60, 20\]"),
        (-61.0, r"= -61 °CA aTDC: must be in \[-60, 20\]"),
        (math.nan, r"= -?nan °CA aTDC: must be in"),
        (math.inf, r"= inf °CA aTDC: must be in"),
    ],
)
def test_timings_outside_their_window(call, soc, match):
    with pytest.raises(ParameterError, match="soc_cad " + match):
        call(soc)


def test_timings_outside_the_closed_part():
    late = CYLINDER.replace(ivc_cad=-30.0)
    with pytest.raises(ParameterError, match=r"soc_cad = -40 °CA aTDC: must lie in the closed part.*-30"):
        simulate(late, POINT, soc_cad=-40.0)
    with pytest.raises(ParameterError, match=r"soi_cad = 21.*°bTDC"):
        ignition_delay(CYLINDER, POINT, soi_cad=21.0)


@pytest.mark.parametrize("step", [0.0, -1.0, 0.0005, 5.5, math.nan, math.inf])
def test_steps_outside_their_bounds(step):
    with pytest.raises(ParameterError, match=r"step_cad = .*must be in \[0\.001, 5\]"):
        simulate(CYLINDER, POINT, step_cad=step)


def test_other_arguments():
    with pytest.raises(ParameterError, match=r"integrator = 'rk4'.*trapezoid, split, tan2018_lagged, euler"):
        simulate(CYLINDER, POINT, integrator="rk4")
    with pytest.raises(ParameterError, match=r"step_cad.*0\.004"):
        convergence(CYLINDER, POINT, step_cad=0.003)
    with pytest.raises(ParameterError, match="reference_nox_ppm"):
        NoxProxy(reference_nox_ppm=-1.0)
    with pytest.raises(ParameterError, match="burn_duration_cad"):
        _core.engine.burned_fraction(CYLINDER, np.array([0.0]), -6.0, 0.0)
    with pytest.raises(TypeError):
        simulate(CYLINDER)
    with pytest.raises(ParameterError, match=r"cylinder = OperatingPoint\(\): must be a Cylinder"):
        simulate(POINT, CYLINDER)


def good_trace():
    cycle = simulate(CYLINDER, POINT)
    return cycle.crank_angle_cad.values.copy(), cycle.pressure_bar.values.copy()


def gap(a, p):
    return np.delete(a, slice(50, 55)), np.delete(p, slice(50, 55))


def changed(index, value, column):
    def spoil(a, p):
        (a if column == "angle" else p)[index] = value
        return a, p

    return spoil


BAD_TRACES = [
    (gap, r"gap.* -91 .*-85"),
    (changed(17, math.nan, "pressure"), r"17\D.*finite"),
    (changed(17, math.inf, "pressure"), r"17\D.*finite"),
    (changed(17, math.nan, "angle"), r"17\D.*finite"),
    (changed(18, -123.0, "angle"), r"repeat"),
    (changed(18, -120.5, "angle"), r"sort|increase"),
    (lambda a, p: (a[::-1].copy(), p), r"sort|increase|bTDC"),
    (lambda a, p: (a, p * 1e5), r"\bPa\b"),
    (lambda a, p: (a, p * 100.0), r"\bkPa\b"),
    (lambda a, p: (a[:-1], p), r"27[01].*27[01]"),
    (lambda a, p: (a[:10], p[:10]), r"10 samples.*20"),
    (lambda a, p: (a[:0], p[:0]), r"0 samples|empty|no sample"),
]


@pytest.mark.parametrize(("spoil", "match"), BAD_TRACES)
def test_traces_that_cannot_be_what_they_say(spoil, match):
    angle, pressure = spoil(*good_trace())
    before = angle.copy(), pressure.copy()
    with pytest.raises(Error, match=match):
        pressure_trace(angle, pressure)
    with pytest.raises(Error, match=match):
        _core.engine.check_trace(angle, pressure)
    with pytest.raises(Error, match=match):
        _core.engine.analyze(angle, pressure, CYLINDER, POINT, _core.engine.TraceOptions())
    np.testing.assert_array_equal(angle, before[0])
    np.testing.assert_array_equal(pressure, before[1])


BOUNDS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {  # what lies inside, and what is refused
    **dict.fromkeys(("pegging_exponent", "gamma"), ((1.01, 1.69), (1.0, 1.7, math.nan))),
    **dict.fromkeys(("gamma_compression", "gamma_combustion"), ((1.01, 1.69), (1.0, 1.7))),
    "heat_from_cad": ((19.9, -140.0), (20.0, 21.0, math.nan)),
    "earliest_burn_cad": ((-180.0, 90.0), (-180.1, 90.1, math.nan)),
    "smoothing_width_cad": ((0.01, 30.0), (0.0, 30.1, math.nan)),
    "smoothing_cutoff_hz": ((0.1, 1e6), (0.0, 1.1e6, math.nan)),
    "intake_pressure_kpa": ((0.1, 2000.0), (0.0, 2001.0, math.nan)),
    "bmep_bar": ((0.0, 5.0), (-0.1, 100.1, math.nan)),
    "inlet_pressure_kpa": ((0.1, 300.0), (0.0, -1.0, math.nan)),
}


@pytest.mark.parametrize("name", BOUNDS)
def test_options_of_an_analysis_have_their_bounds(name):
    more = {"heat_from_cad": {"heat_to_cad": 20.0}, "inlet_pressure_kpa": {"pegging": "inlet"}}.get(name, {})
    for inside, values in zip((True, False), BOUNDS[name], strict=True):
        for value in values:
            options, field = _core.engine.TraceOptions(**{name: value}, **more), ""
            try:
                _core.engine.analyze(*good_trace(), CYLINDER, POINT, options)
            except Error as error:
                field = error.field
            assert (field != name) == inside, value


def test_a_dataset_without_pressure_is_refused():
    cycle = simulate(CYLINDER, POINT)
    for call in (lambda t: analyze(t, CYLINDER), lambda t: fit_cylinder([t], CYLINDER)):
        with pytest.raises(DataError, match="no pressure_bar, it has"):
            call(cycle.drop_vars("pressure_bar"))
    with pytest.raises(DataError, match=r"peg|> 0"):
        analyze(pressure_trace(*good_trace()).assign(pressure_bar=lambda d: d.pressure_bar - 3.0), CYLINDER)


def trace():
    return pressure_trace(*good_trace())


@pytest.mark.parametrize(
    ("keyword", "error", "match"),
    [
        ({"free": ["soc"]}, ParameterError, "'soc' is not a parameter of a calibration.*soc_cad"),
        ({"free": ["evo_cad"]}, ParameterError, "'evo_cad'.*except ivc_cad and evo_cad"),
        ({"free": ["soc_cad", "soc_cad"]}, ParameterError, "'soc_cad' is named twice"),
        ({"free": []}, ParameterError, "free is empty"),
        ({"step_cad": 0.0}, ParameterError, "step_cad = 0"),
        ({"integrator": "rk4"}, ParameterError, "integrator = 'rk4'"),
        ({"options": FitOptions(seed=1)}, ParameterError, "seed has no effect on this fit"),
        ({"start_values": [{"fuel": 3.0}]}, ParameterError, "'fuel' is not a parameter of a trace.*fuel_heat_j"),
        ({"start_values": [{"fuel_heat_j": -3.0}]}, ParameterError, r"fuel_heat_j\[trace\] = -3"),
        ({"start_values": [{"soc_cad": math.nan}]}, ParameterError, r"soc_cad\[trace\] = -?nan"),
        ({"start_values": []}, ParameterError, "start_values has 0 entries for 1 traces"),
    ],
)
def test_calibrations_that_cannot_start(keyword, error, match):
    with pytest.raises(error, match=match):
        fit_cylinder([trace()], CYLINDER, **keyword)


def test_no_traces_at_all():
    with pytest.raises(DataError, match="no traces"):
        fit_cylinder([], CYLINDER)


def test_errors_are_also_what_python_expects():
    assert issubclass(ParameterError, ValueError)
    assert issubclass(DataError, ValueError)
    with pytest.raises(ValueError, match="bore_mm"):
        Cylinder(bore_mm=0.0)
