"""Arguments of the wrong kind are named with the remedy; arrays are taken in every form of `numpy.asarray`."""

import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import pint
import pytest
import xarray as xr

import mgdd
from array_calls import CALLS, MORE, Array
from mgdd import _core, presets
from mgdd._arguments import refusal
from mgdd.engine import (
    Cylinder,
    NoxModel,
    NoxProxy,
    OperatingPoint,
    Performance,
    PerformanceTerm,
    find_optimum,
    simulate,
)
from mgdd.errors import Error, ParameterError
from mgdd.guide import Curve
from mgdd.loop import SensorDynamics, VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import ExtremumSeeking, Limit, MapSeeking, Spsa
from mgdd.throttle import SensorPair, Throttle

PRESET = presets.load("puma_single")
SEEKER = ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0))
LEAK = re.compile(r"incompatible (function|constructor) arguments|Unable to cast|instance has no|pybind11")


def functions(owner: Any, seen: set[int] | None = None) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every function, method and constructor that the core exports, by name."""
    seen = set() if seen is None else seen
    for name, member in inspect.getmembers(owner):
        if id(member) in seen:
            continue
        if inspect.ismodule(member) and member.__name__.startswith("mgdd._core"):
            yield from functions(member, seen)
        elif inspect.isclass(member) and member.__module__.startswith("mgdd._core"):
            seen.add(id(member))
            yield from functions(member, seen)
        elif callable(member) and re.match(rf"{name}\(.*\) -> ", getattr(member, "__doc__", None) or ""):
            yield f"{owner.__name__}.{name}", member


FUNCTIONS = dict(functions(_core))


class Strange:
    """Nothing that any function takes."""


def answer(call: Callable[[], Any]) -> str:
    """What the error of a call says, or nothing."""
    try:
        call()
    except (Error, TypeError, ValueError, AttributeError) as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_call_leaks_the_signatures_of_the_core(name: str) -> None:
    function = FUNCTIONS[name]
    for given in ((Strange(),), (Strange(),) * 3, (Strange(),) * 40, ([[], {}],), ()):
        for keywords in ({}, {"no_such_argument": Strange()}):
            said = answer(lambda: function(*given, **keywords))  # noqa: B023
            assert not LEAK.search(said), said
            assert "mgdd._core" not in said, said
            assert len(said) < 600


@pytest.mark.parametrize(
    ("call", "field", "message"),
    [
        (lambda: Cylinder(bore_mm=[86.0]), "bore_mm", r"bore_mm = \[86.0\], a list: must be one number"),
        (lambda: Cylinder(bore_mm="86"), "bore_mm", "bore_mm = '86': must be one number"),
        (lambda: Cylinder(burn_shape=2), "burn_shape", "burn_shape = 2: must be a name"),
        (lambda: Cylinder().replace(bore_mm=[86.0]), "bore_mm", "bore_mm"),
        (
            lambda: OperatingPoint(fuel_mg=np.ones(3)),
            "fuel_mg",
            r"fuel_mg = array\(.*\): must be one number; call",
        ),
        (lambda: Throttle(inertia_kgm2=None), "inertia_kgm2", "inertia_kgm2 = None: must be one number"),
        (lambda: NoxModel(proxy=1.0), "proxy", "proxy = 1.0: must be a NoxProxy or None"),
        (lambda: NoxProxy().affine_log_ppm("hot"), "t_max_k", "t_max_k = 'hot': must be numbers in one array"),
        (lambda: PerformanceTerm(3), "signal", "signal = 3: must be a name"),
        (lambda: Performance([1.0]), "terms", "terms = .*: must be a sequence of PerformanceTerms or None"),
        (lambda: SensorPair(adc_bits=12.5), "adc_bits", "adc_bits = 12.5: must be a whole number"),
        (lambda: SensorDynamics(delay_s=[3.0]), "delay_s", "delay_s"),
        (lambda: Limit("p_max_bar", [95.0]), "upper", "upper = .*: must be one number"),
        (lambda: ExtremumSeeking(start=0.0, period="x"), "period", "period = 'x': must be a whole number"),
        (lambda: ExtremumSeeking(start="x"), "start", "start = 'x': must be"),
        (lambda: Spsa(start=0.0, seed=-1), "seed", "seed = -1: must be a whole number >= 0"),
        (lambda: monte_carlo(VirtualEngine(), SEEKER, [1, -1], cycles=5), None, "-1.*must be"),
        (
            lambda: ExtremumSeeking(start=0.0, period=10**12),
            "period",
            "period = 1000000000000: must be a whole number up",
        ),
        (lambda: MapSeeking({"a": (0, 1)}, {"x": [0, 1]}, seed=-1), "seed", "seed = -1: must be a whole number >= 0"),
        (lambda: MapSeeking({"a": (0, 1)}, {"x": [0, 1]}, kept=10**12), "kept", "kept = 1000000000000: must be"),
        (lambda: Spsa(start=0.0, limits=[3.0]), "limits", r"limits = \[3.0\], a list: must be a sequence of Limits"),
        (lambda: VirtualEngine([Cylinder()]), "cylinder", "cylinder = .*: must be a Cylinder"),
        (lambda: VirtualEngine(point=[OperatingPoint()]), None, "OperatingPoint"),
        (lambda: VirtualEngine().step([-6.0]), "soc_cad", r"soc_cad = \[-6.0\], a list: must be one number"),
        (lambda: VirtualEngine().run("late"), "soc_cad", "soc_cad = 'late': must be numbers in one array"),
        (lambda: setattr(VirtualEngine(), "state", 3), "state", "state = 3: must be a mapping of names to"),
        (lambda: run_seeker(SEEKER, SEEKER, 10), None, "plant"),
        (lambda: run_seeker(VirtualEngine(), VirtualEngine(), 10), "seeker", "seeker = .*: must be a seeker, as"),
        (lambda: run_seeker(VirtualEngine(), SEEKER, 10.5), "cycles", "cycles = 10.5: must be a whole number"),
        (lambda: monte_carlo(VirtualEngine(), VirtualEngine(), [1], cycles=5), None, "must be a seeker, as"),
        (
            lambda: _core.engine.volume_l(PRESET, 0.0),
            "cylinder",
            r"Preset .*: must be a Cylinder; give its .cylinder",
        ),
        (
            lambda: _core.engine.volume_l("puma_single", 0.0),
            "cylinder",
            r"must be a Cylinder; mgdd.presets.load\(name\)",
        ),
    ],
)
def test_the_argument_is_named(call: Callable[[], Any], field: str | None, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as error:
        call()
    if field is not None:
        assert error.value.field == field
        assert error.value.bound is not None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Cylinder(bore=86.0), r"Cylinder\(\) has no argument 'bore': did you mean 'bore_mm'\?"),
        (lambda: Cylinder(86.0), r"Cylinder\(\) takes 0 positional arguments, 1 were given; give .* by name"),
        (lambda: ExtremumSeeking(stort=1.0), r"ExtremumSeeking\(\) has no argument 'stort': did you mean 'start'\?"),
        (ExtremumSeeking, r"ExtremumSeeking\(\) lacks start"),
        (lambda: Limit("p_max_bar", 95.0, name="x"), r"Limit\(\) got 'name' twice"),
    ],
)
def test_a_call_of_the_wrong_form_is_a_type_error_as_in_python(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        call()


def test_overloads_that_fail_at_the_same_argument_are_named_together() -> None:
    signatures = ["(a: int, b: mgdd._core.Cat) -> None", "(a: int, b: mgdd._core.Dog) -> None"]
    error = refusal("f", signatures, (1, 2), {})
    assert str(error) == "b = 2: must be a Cat or a Dog"
    unknown = refusal("f", ["(a: object) -> None"], (1,), {})
    assert isinstance(unknown, TypeError)
    assert str(unknown) == "f() does not take these arguments: it is f(a: object) -> None"


def test_a_number_that_is_too_large_is_told_from_a_name_beside_it() -> None:
    signature = "(a: typing.SupportsInt | str, b: typing.SupportsInt | None = None) -> None"
    assert str(refusal("f", [signature], ["x", -3], {})) == "b = -3: must be a whole number >= 0"
    assert "does not take these arguments" in str(refusal("f", [signature], ["x"], {"b": 3}))


@pytest.mark.parametrize("soc", ["scalar", "array", "list"])
def test_numbers_that_carry_a_unit_are_refused_and_not_read_as_radians(soc: str) -> None:
    """Of pint -6 degree is the number -0.105."""
    quantity = pint.UnitRegistry()
    given = {
        "scalar": -6 * quantity.degree,
        "array": np.array([-6.0, -3.0]) * quantity.degree,
        "list": [-6 * quantity.degree],
    }[soc]
    with pytest.raises(ParameterError, match=r"soc_cad = .*magnitude"):
        simulate(PRESET.cylinder, PRESET.point, soc_cad=given)
    with pytest.raises(ParameterError, match=r"magnitude"):
        find_optimum(PRESET.cylinder, PRESET.point, bounds_cad=(-20 * quantity.degree, 5 * quantity.degree))
    with pytest.raises(ParameterError, match=r"start = .*magnitude"):
        ExtremumSeeking(start=given, bounds=(-30.0, 10.0))
    with pytest.raises(ParameterError, match=r"limp_home_deg = .*magnitude"):
        Throttle(limp_home_deg=7 * quantity.degree)
    curve = Curve.parabola(curvature=-0.05, best=3.0, reach=60.0)
    with pytest.raises(ParameterError, match=r"inputs = .*magnitude"):
        curve(given)


def strided(values: Array) -> Array:
    out = np.repeat(values, 2)[::2]
    out.flags.writeable = False
    return out


def unaligned(values: Array) -> Array:
    """Begin at an odd byte, as an array over a buffer that another process sent."""
    out = np.frombuffer(b"\0" + values.tobytes(), values.dtype, offset=1)
    assert not out.flags.aligned
    return out


FORMS: dict[str, Callable[[Array], Any]] = {
    "list": lambda values: values.tolist(),
    "tuple": lambda values: tuple(values.tolist()),
    "series": lambda values: pd.Series(values, index=np.arange(values.size) + 1000),
    "dataarray": lambda values: xr.DataArray(values, dims="sample", coords={"sample": np.arange(values.size) + 1000}),
    "read-only strided": strided,
    "unaligned": unaligned,
    "scalars of numpy": list,
}


def takers() -> Iterable[str]:
    """Public functions and methods that say ArrayLike, protocols and constructors of results left out."""
    for module in mgdd.__all__:
        room = getattr(mgdd, module)
        for name in getattr(room, "__all__", ()):
            thing = getattr(room, name)
            members = vars(thing).items() if inspect.isclass(thing) else [("", thing)]
            for key, member in members:
                function = getattr(member, "__func__", member)
                annotations = getattr(function, "__annotations__", {}) if callable(function) else {}
                if any("ArrayLike" in str(note) for what, note in annotations.items() if what != "return"):
                    yield f"{module}.{name}.{key}".rstrip(".")


def test_every_taker_of_arrays_is_here() -> None:
    found = {name for name in takers() if not name.startswith("results.FitReport.")}
    assert set(CALLS) == found


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", [*CALLS, *MORE])
def test_every_form_gives_the_same_numbers(name: str, form: str) -> None:
    call, arrays = (CALLS | MORE)[name]
    before = [values.copy() for values in arrays]
    expected = call(*arrays)
    given = [FORMS[form](values) for values in arrays]
    found = call(*given)
    np.testing.assert_equal(found, expected)
    for values, copy, own in zip(arrays, before, given, strict=True):
        np.testing.assert_array_equal(values, copy)
        np.testing.assert_array_equal(np.asarray(own), copy)
