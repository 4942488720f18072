"""Labelled Datasets: nothing without a unit, and JSON that any reader takes."""

import io
import json
import subprocess
import sys
from enum import Enum
from pathlib import PurePosixPath

import numpy as np
import pint
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from mgdd.errors import ConvergenceError, DataError, Error, ParameterError, ShapeError
from mgdd.results.labels import ANGLE, VARIABLES, Label, check_labels, labelled_dataset, to_jsonable
from mgdd.results.result import Result
from mgdd.results.units import _UNITS, _WHOLE, attribute_units, printed_units, unit_attributes, unit_of


def cycle(**extra):
    angle = np.arange(-2.0, 3.0)
    return {ANGLE: (ANGLE, angle), "pressure_bar": (ANGLE, 60.0 - angle**2)} | extra


def test_error_tree():
    assert all(issubclass(error, Error) for error in (ParameterError, ShapeError, DataError, ConvergenceError))
    assert all(issubclass(error, ValueError) for error in (ParameterError, ShapeError, DataError))
    assert issubclass(ConvergenceError, RuntimeError)


def test_every_canonical_name_has_unit_and_long_name():
    assert all(label.units.strip() and label.long_name.strip() for label in VARIABLES.values())
    units = {
        "_bar": "bar", "_k": "K", "_l": "L", "_ppm": "ppm", "_j": "J", "_j_per_cad": "J/°CA",
        "_bar_per_cad": "bar/°CA", "_mw_per_m2": "MW/m²",
    }  # fmt: skip
    for name, label in VARIABLES.items():
        suffixes = [suffix for suffix in units if name.endswith(suffix)]
        if suffixes:
            assert label.units == units[max(suffixes, key=len)], name


def test_dataset_carries_values_units_and_attributes():
    dataset = labelled_dataset(cycle(speed_rpm=((), 1200.0, "rpm", "engine speed")), attrs={"file": "a.csv"})
    check_labels(dataset)
    assert dataset["pressure_bar"].dims == (ANGLE,)
    assert ANGLE in dataset.indexes
    assert dataset[ANGLE].attrs == {"units": "degree", "long_name": "crank angle, °CA aTDC"}
    assert dataset["speed_rpm"].attrs == {"units": "rpm", "long_name": "engine speed"}
    assert dataset.attrs == {"file": "a.csv"}


def test_values_are_copied():
    variables = cycle()
    dataset = labelled_dataset(variables)
    dataset["pressure_bar"][0] = -1.0
    assert variables["pressure_bar"][1][0] == 56.0


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (((), 1.0), "variable torque_nm has no units"),
        (((), 1.0, "", "torque"), "variable torque_nm has no units"),
        (((), 1.0, "N·m", " "), "variable torque_nm has no long_name"),
        (((), 1.0, "N·m"), r"variable torque_nm: give \(dims, values\) or"),
        (("time_s", [1.0], "N·m", "torque"), "dimension time_s of torque_nm has no coordinate"),
    ],
)
def test_label_faults_are_refused(entry, message):
    with pytest.raises(DataError, match=message):
        labelled_dataset(cycle(torque_nm=entry))


def test_a_canonical_name_keeps_its_unit():
    with pytest.raises(DataError, match="p_max_bar has units 'Pa': this name is reserved for 'bar'"):
        labelled_dataset({"p_max_bar": ((), 1e7, "Pa", "maximum pressure")})


def test_shape_faults_are_refused():
    with pytest.raises(ShapeError, match=r"volume_l has 3 samples along crank_angle_cad: crank_angle_cad has 5"):
        labelled_dataset(cycle(volume_l=(ANGLE, [1.0, 2.0, 3.0])))
    with pytest.raises(ShapeError, match=r"p_max_bar has shape \(1,\): 0 dimension"):
        labelled_dataset(cycle(p_max_bar=((), [1.0])))


def test_check_labels_names_the_culprit():
    dataset = labelled_dataset(cycle())
    dataset["bare"] = 1.0
    with pytest.raises(DataError, match="variable bare has no units"):
        check_labels(dataset)
    with pytest.raises(DataError, match="dimension x has no coordinate"):
        check_labels(xr.Dataset({"a": ("x", [1.0], {"units": "-", "long_name": "a"})}))


class Status(Enum):
    DONE = "done"


def test_jsonable_of_everything_results_hold():
    dataset = labelled_dataset(cycle(soi_cad=((), np.nan)))
    obj = {
        "status": Status.DONE, 1: np.int64(3), "flag": np.bool_(True), "path": PurePosixPath("a/b"),
        "none": None, "set": {"b", "a"}, "inf": -np.inf, "array": dataset[ANGLE],
        "nested": (np.array([[1.0, np.nan]]),),
    }  # fmt: skip
    assert to_jsonable(obj) == {
        "status": "done", "1": 3, "flag": True, "path": "a/b", "none": None, "set": ["a", "b"], "inf": None,
        "array": [-2.0, -1.0, 0.0, 1.0, 2.0], "nested": [[[1.0, None]]],
    }  # fmt: skip
    whole = to_jsonable(dataset)
    assert whole["soi_cad"] is None
    assert whole["pressure_bar"] == [56.0, 59.0, 60.0, 59.0, 56.0]


def test_jsonable_refuses_what_has_no_form():
    with pytest.raises(TypeError, match="complex has no JSON form"):
        to_jsonable([1j])
    with pytest.raises(TypeError, match="bytes has no JSON form"):
        to_jsonable(b"a")


nested = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(nested)
def test_jsonable_is_strict_json_and_idempotent(obj):
    once = to_jsonable(obj)
    assert to_jsonable(once) == once
    assert json.loads(json.dumps(once, allow_nan=False)) == once


@pytest.mark.parametrize("module", ["mgdd.results", "mgdd.io", "mgdd.plot", "mgdd.datasets"])
def test_import_is_light(module):
    heavy = "{'xarray', 'matplotlib', 'pandas', 'scipy'}"
    code = f"import sys, {module}; print(*({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr


@pytest.mark.parametrize(
    "value", ["no fault", "", 3, 2.5, float("nan"), np.float32(1.0), np.int64(7), [1.0, 2], (0.5,)]
)
def test_attributes_survive_a_file(value):
    dataset = labelled_dataset(cycle(), attrs={"note": value})
    check_labels(dataset)
    back = xr.load_dataset(io.BytesIO(bytes(dataset.to_netcdf(engine="scipy"))), engine="scipy").attrs["note"]
    np.testing.assert_array_equal(np.ravel(back), np.ravel(value))


@pytest.mark.parametrize(
    "value", [True, np.bool_(False), None, (), ("a", "b"), {"a": 1}, [True], b"ab", np.zeros((2, 2))]
)
def test_an_attribute_that_no_file_holds_is_refused(value):
    with pytest.raises(DataError, match=r"(?s)attribute note of the Dataset = .*: netCDF stores text"):
        labelled_dataset(cycle(), attrs={"note": value})
    dataset = labelled_dataset(cycle())
    dataset["pressure_bar"].attrs["note"] = value
    with pytest.raises(DataError, match="attribute note of variable pressure_bar"):
        check_labels(dataset)
    labelled_dataset(cycle(), attrs={"note": "text"})
    with pytest.raises(DataError, match="attribute 1 of the Dataset: its name must be text"):
        labelled_dataset(cycle(), attrs={1: "one"})


@pytest.mark.parametrize("name", VARIABLES)
def test_units_of_the_known_names_are_read_by_pint_and_printed_as_before(name):
    label = VARIABLES[name]
    attributes = unit_attributes(*label)
    pint.application_registry.parse_units(attributes["units"])
    assert Label(*printed_units(**attributes)) == label


@pytest.mark.parametrize(
    ("printed", "units", "remark"),
    [
        ("°CA aTDC", "degree", "°CA aTDC"),
        ("°CA", "degree", "°CA"),
        ("deg/s²", "degree/second**2", None),
        ("J/°CA", "J/degree", "J/°CA"),
        ("MW/m²", "MW/m**2", None),
        ("mg/m³", "mg/m**3", None),
        ("N m s/rad", "N*m*s/rad", None),
        ("N·m", "N*m", "N·m"),
        ("1/deg", "1/degree", None),
        ("%/°CA", "percent/degree", "%/°CA"),
        ("% of p_max", "percent", "% of p_max"),
        ("bar/°CA (not documented)", "bar/degree", "bar/°CA (not documented)"),
        ("°CA aTDC per unit of the parameter", "degree", "°CA aTDC per unit of the parameter"),
        ("- per unit of the parameter", "1", "- per unit of the parameter"),
        ("unit of J", "1", "unit of J"),
        ("not given by the plant", "1", "not given by the plant"),
        ("samples", "1", "samples"),
        ("µs", "µs", None),
        ("-", "1", None),
        ("1", "1", None),
        ("m/s**2", "m/s**2", None),
    ],
)
def test_printed_units_become_expressions_and_come_back(printed, units, remark):
    attributes = unit_attributes(printed, "name, part")
    assert attributes == {"units": units, "long_name": f"name, part, {remark}" if remark else "name, part"}
    pint.application_registry.parse_units(units)
    back, name = printed_units(**attributes)
    assert name == "name, part"
    assert attribute_units(back) == units
    assert unit_attributes(back, name) == attributes


@pytest.mark.parametrize("units", ["3 bar", "a+b", "bar/", "[bar]", "last 50 cycles"])
def test_what_is_no_unit_is_refused(units):
    with pytest.raises(DataError, match=r"variable x has units .* is not a product or quotient of units, such as N\*m"):
        labelled_dataset({"x": ((), 1.0, units, "quantity")})
    assert labelled_dataset({"x": ((), 1.0, "bar", f"quantity, {units}")})["x"].attrs["units"] == "bar"


@pytest.mark.parametrize(
    "ending", [*_WHOLE, *(f"{over}_{name}" for name in _UNITS for over in ("", "_per", "_kg_per"))]
)
def test_the_unit_at_the_end_of_a_name_is_read_by_pint(ending):
    registry = pint.application_registry
    assert isinstance(registry.parse_units(attribute_units(unit_of(f"x{ending}"))), registry.Unit)


def test_what_a_property_lacks_is_named_and_not_the_property() -> None:
    class Halved(Result):
        @property
        def half(self) -> float:
            return self.extent / 2.0

    with pytest.raises(AttributeError, match="extent"):
        _ = Halved().half
