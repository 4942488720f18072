"""Parameter files: every kind and option there and back bit for bit, and refusals that name file, key and remedy."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import _core, presets
from mgdd.errors import DataError, ParameterError
from mgdd.identify import OdeModel, load_throttle_model
from mgdd.identify.throttle.first_principle_model import TYPICAL, FirstPrincipleModel
from mgdd.io.parameters import Entry, ParameterFile, Wanted
from mgdd.throttle import PseudoWiener, SensorPair, Throttle, simulate_throttle

TIME = 1e-3 * np.arange(300)
DUTY = 0.1 + 0.5 * np.sin(2.0 * np.pi * TIME * (2.0 + 20.0 * TIME))
GROUPS = dict(TYPICAL)


def span(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


@st.composite
def first_principle(draw: st.DrawFn) -> FirstPrincipleModel:
    bounds = {parameter.name: parameter for parameter in _core.identify.throttle_group_bounds()}
    values = {name: draw(span(bound.lower, bound.upper)) for name, bound in bounds.items()}
    values["delay_samples"] = draw(span(0.0, 3.0))
    values["presliding_deg"] = draw(st.one_of(st.just(0.0), span(0.01, 0.5)))
    return FirstPrincipleModel(
        parameters=values,
        closed_deg=draw(span(-5.0, 5.0)),
        open_deg=draw(span(30.0, 100.0)),
        substeps=draw(st.integers(1, 8)),
        sample_s=draw(st.sampled_from([1e-3, 1.5e-3])),
    )


def changed(draw: st.DrawFn, start: dict[str, float], names: list[str]) -> dict[str, float]:
    return {name: start[name] * draw(span(0.9, 1.1)) for name in names if start[name] != 0.0}


@st.composite
def pseudo_wiener(draw: st.DrawFn) -> PseudoWiener:
    kind = draw(st.sampled_from(["pw_r", "pw_w", "pw_p"]))
    values: dict[str, float] = {
        "delay_samples": float(draw(st.integers(0, 5))),
        "closed_deg": draw(span(-3.0, 3.0)),
        "open_deg": draw(span(40.0, 95.0)),
        "sample_s": draw(st.sampled_from([5e-4, 1e-3, 2e-3])),
    }
    options: dict[str, Any] = {}
    if kind == "pw_r":
        options["switching"] = draw(st.sampled_from(["predicted", "measured"]))
        options["friction"] = draw(st.sampled_from(["set_valued", "tanh"]))
        values |= {"substeps": float(draw(st.integers(1, 6))), "ramp_deg": draw(span(0.05, 1.5))}
        values |= {"tanh_deg_per_s": draw(span(0.5, 20.0)), "dead_band_deg": draw(span(0.0, 1.0))}
    if kind == "pw_w":
        values |= {"knot_lower_duty": draw(span(-0.5, -0.2)), "knot_upper_duty": draw(span(0.2, 0.6))}
    if kind == "pw_p":
        values["plays"] = float(draw(st.integers(1, 8)))
    base = dict(PseudoWiener(kind, values, **options).parameters)
    if "map_start" in base:
        values["map_start"] = float(draw(st.booleans()))
    moved = [name for name in base if name.endswith(("tau_s", "coulomb_duty", "preload_duty"))]
    return PseudoWiener(kind, values | changed(draw, base, moved), **options)


MODELS = st.one_of(first_principle(), pseudo_wiener())


@given(model=MODELS, start_deg=span(5.0, 35.0))
@settings(max_examples=150)
def test_a_throttle_model_simulates_bit_for_bit_after_a_file(model: Any, start_deg: float) -> None:
    again = type(model).from_toml(model.to_toml())
    assert again == model
    assert again.to_toml() == model.to_toml()
    step = TIME * (model.parameters.get("sample_s", 1e-3) / 1e-3)
    state = {"angle_deg": start_deg}
    one, two = (m.simulate({"time_s": step, "duty": DUTY}, initial_state=state) for m in (again, model))
    xr.testing.assert_identical(one, two)


def test_stops_ramp_and_substeps_of_a_first_principle_model_come_back() -> None:
    model = FirstPrincipleModel(
        parameters=GROUPS | {"ramp_deg": 1.0, "delay_samples": 1.5}, closed_deg=2.0, open_deg=60.0, substeps=5
    )
    assert FirstPrincipleModel.from_toml(model.to_toml()) == model


def test_a_first_principle_file_that_lacks_a_line_is_refused_by_its_name() -> None:
    text = FirstPrincipleModel(parameters=GROUPS | {"ramp_deg": 0.4}, closed_deg=2.0, substeps=5).to_toml()
    for lost in ("tau_s", "stribeck_drop", "ramp_deg", "delay_samples", "sample_s"):
        rest = "\n".join(line for line in text.splitlines() if not line.startswith(lost))
        with pytest.raises(DataError, match=rf"lacks {lost}: write {lost} = "):
            FirstPrincipleModel.from_toml(rest)


def test_the_delay_of_a_first_principle_model_keeps_its_seconds() -> None:
    model = FirstPrincipleModel(parameters=GROUPS | {"delay_samples": 2.0}, substeps=8)
    fine, coarse = 5e-4 * np.arange(800), 1e-3 * np.arange(400)
    duty = np.where(np.arange(400) < 50, 0.0, 0.3)
    on_fine = model.simulate({"time_s": fine, "duty": np.repeat(duty, 2)})["angle_deg"].to_numpy()[::2]
    on_coarse = model.simulate({"time_s": coarse, "duty": duty})["angle_deg"].to_numpy()
    assert np.ptp(on_coarse) > 10.0
    np.testing.assert_allclose(on_fine, on_coarse, atol=0.02)
    # Longer than the delay line of the core: 10 samples of 0.2 ms, whole ones being the duty itself, later.
    finest = model.simulate({"time_s": 2e-4 * np.arange(2000), "duty": np.repeat(duty, 5)})["angle_deg"].to_numpy()[::5]
    np.testing.assert_allclose(finest, on_coarse, atol=0.05)
    for delay in (4, 5, 6, 19.5):
        late = FirstPrincipleModel(parameters=GROUPS | {"delay_samples": delay}, substeps=8)
        at_once = FirstPrincipleModel(parameters=GROUPS | {"delay_samples": delay % 1.0}, substeps=8)
        shifted = np.concatenate([np.zeros(int(delay)), duty[: -int(delay)]])
        np.testing.assert_array_equal(
            late.simulate({"time_s": coarse, "duty": duty})["angle_deg"],
            at_once.simulate({"time_s": coarse, "duty": shifted})["angle_deg"],
        )
    with pytest.raises(ParameterError, match=r"delay_samples = 20\.5: must be <= 20"):
        FirstPrincipleModel(parameters=GROUPS | {"delay_samples": 20.5})


def test_a_value_outside_its_domain_names_the_file(tmp_path: Path) -> None:
    model, file = FirstPrincipleModel(parameters=GROUPS), tmp_path / "model.toml"
    file.write_text(model.to_toml().replace("tau_s = { value = 0.03", "tau_s = { value = -0.03"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"model\.toml: tau_s = -0\.03: must be > 0"):
        load_throttle_model(file)
    pair = SensorPair().to_toml().replace("adc_bits = { value = 12", "adc_bits = { value = 99")
    with pytest.raises(ParameterError, match=r"^pair\.toml: adc_bits = 99"):
        SensorPair.from_toml(pair, origin="pair.toml")


def test_a_file_of_a_model_is_loaded_whatever_its_kind(tmp_path: Path) -> None:
    for model in (
        FirstPrincipleModel(parameters=GROUPS, closed_deg=2.0, open_deg=60.0, substeps=5),
        PseudoWiener("pw_r", {"delay_samples": 2.0}, switching="measured", friction="tanh"),
        PseudoWiener("pw_w"),
        PseudoWiener("pw_p", {"plays": 3.0}),
    ):
        file = tmp_path / f"{model.kind}.toml"
        file.write_text(model.to_toml(), encoding="utf-8")
        assert load_throttle_model(file) == model


def test_a_sensor_pair_comes_back() -> None:
    pair = SensorPair(closed_v=0.4, span_v=4.1, adc_bits=10, noise_v=0.01, lag_s=1e-3, debounce_s=0.1)
    again = SensorPair.from_toml(pair.to_toml())
    assert again == pair
    run = simulate_throttle(Throttle(), 0.3, duration_s=0.2)
    np.testing.assert_array_equal(pair.sense(run)["first_v"], again.sense(run)["first_v"])
    with pytest.raises(ParameterError, match=r"adc_bits: value = 10\.5: must be a whole number"):
        SensorPair.from_toml(pair.to_toml().replace("value = 10,", "value = 10.5,"))


def lag(_: float, x: Any, u: Any, p: Any) -> Any:
    return (p[0] * u[0] - x) / p[1]


def second(x: Any, _: Any, p: Any) -> Any:
    return 2.0 * x[0] + 0.0 * p[0]


def test_an_ode_model_comes_back_with_its_functions() -> None:
    model = OdeModel(
        derivative=lag, output=second, parameters={"gain": 2.1, "time_s": 1 / 3}, initial_state=(0.1,), substeps=3
    )
    again = OdeModel.from_toml(model.to_toml(), derivative=lag, output=second)
    assert again == model
    inputs = {"time_s": TIME, "u": DUTY}
    xr.testing.assert_identical(again.simulate(inputs), model.simulate(inputs))
    with pytest.raises(ParameterError, match="output = first_states: text was written with second; give that function"):
        OdeModel.from_toml(model.to_toml(), derivative=lag)


LAG = ParameterFile(
    kind="lag",
    tables={
        "parameters": {
            "tau_s": Entry(value=0.1 + 0.2, unit="s", stderr=1e-17, source='log "a", 3 °C\n'),
            "steps": Entry(value=3),
            "on": Entry(value=True),
            "form": Entry(value="a\\b"),
            "row": Entry(value=[1.0, -0.0, 5e-324, 1.7976931348623157e308], unit="m"),
            "grid": Entry(value=[[1.0, math.inf], [2.5, -math.inf]]),
            "names": Entry(value=["], [", "x"]),
            "odd key": Entry(value=1.5),
        }
    },
    notes={"source": "mine", "unidentifiable": ["a", "b"], "empty": []},
)
WANTED = {
    "tau_s": Wanted("s"),
    "steps": Wanted(form="integer"),
    "on": Wanted(form="flag"),
    "form": Wanted(form="text"),
    "row": Wanted("m", "numbers"),
    "grid": Wanted(form="numbers"),
    "names": Wanted(form="texts"),
    "odd key": Wanted(),
}


def test_every_form_of_value_comes_back() -> None:
    again = ParameterFile.from_toml(LAG.to_toml(), origin="x")
    assert again == LAG
    assert math.copysign(1.0, again.tables["parameters"]["row"].value[1]) == -1.0
    values = again.values("parameters", WANTED)
    assert values == {name: entry.value for name, entry in LAG.tables["parameters"].items()}
    text = LAG.to_toml()
    assert tomllib.loads(text)["format"] == 1
    assert 'tau_s = { value = 0.30000000000000004, unit = "s", stderr = 1e-17, source = ' in text


@given(value=st.floats(allow_nan=True, allow_infinity=True), text=st.text(max_size=30))
@settings(max_examples=200)
def test_any_number_and_text_come_back(value: float, text: str) -> None:
    file = dataclasses.replace(LAG, tables={"parameters": {"x": Entry(value=value, source=text)}}, notes={"name": text})
    again = ParameterFile.from_toml(file.to_toml())
    entry = again.tables["parameters"]["x"]
    assert (entry.source, again.notes["name"]) == (text, text)
    assert np.array([entry.value]).tobytes() == np.array([value]).tobytes() or math.isnan(value)


@pytest.mark.parametrize(
    ("old", "new", "error", "match"),
    [
        ('kind = "lag"\n', "", DataError, r"a\.toml: kind = None: say what the file holds"),
        ('"lag"', '"led"', DataError, "a.toml: kind = 'led': must be 'lag'"),
        ("format = 1", "format = 2", DataError, "a.toml: format = 2: this version of mgdd reads format = 1"),
        ("format = 1\n", "", DataError, "format = None: .*write that line"),
        ("tau_s", "tau_ss", ParameterError, r"a\.toml: \[parameters\] tau_ss: unknown key: did you mean 'tau_s'\?"),
        ('"s"', '"ms"', ParameterError, r"tau_s: unit = 'ms': must be 's'; convert the value"),
        (', unit = "s"', "", ParameterError, r"tau_s: unit = None: must be 's'; write tau_s = \{ value"),
        ("value = 3", 'value = "3"', ParameterError, r"steps: value = '3': must be a whole number"),
        ("value = 3", "value = 3.0", ParameterError, r"steps: value = 3\.0: must be a whole number"),
        ("value = 3", "value = true", ParameterError, r"steps: value = True: must be a whole number"),
        ("value = true", "value = 1", ParameterError, r"on: value = 1: must be true or false"),
        ("0.30000000000000004", "[1]", ParameterError, r"tau_s: value = \[1\]: must be a number"),
        ("1e-17", '"small"', ParameterError, r"tau_s: stderr = 'small': must be a number"),
        ("[parameters]", "[parameter]", ParameterError, r"unknown key 'parameter': did you mean '\[parameters\]'\?"),
        ("empty = []", "emptys = []", ParameterError, "unknown key 'emptys': did you mean 'empty'"),
        ("[parameters]", "[parameters", DataError, "a.toml: not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused_with_file_key_and_remedy(old: str, new: str, error: Any, match: str) -> None:
    text = LAG.to_toml()
    assert old in text

    def read(text: str) -> dict[str, Any]:
        file = ParameterFile.from_toml(text, origin="a.toml")
        file.expect(kinds=("lag",), tables=("parameters",), notes=("source", "unidentifiable", "empty"))
        return file.values("parameters", WANTED)

    with pytest.raises(error, match=match):
        read(text.replace(old, new, 1))
    assert read(text)["steps"] == 3


def test_what_is_missing_is_named() -> None:
    file = ParameterFile(kind="lag", tables={"parameters": {}}, origin="a.toml")
    with pytest.raises(DataError, match=r'\[parameters\] lacks tau_s, n: write tau_s = \{ value = \.\.\., unit = "s"'):
        file.values("parameters", {"tau_s": Wanted("s"), "n": Wanted(form="integer"), "m": Wanted(required=False)})
    with pytest.raises(DataError, match=r"a\.toml: no table \[more\]"):
        file.expect(kinds=("lag",), tables=("parameters", "more", "maybe?"))


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such file"):
        ParameterFile.read(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="not a UTF-8 text file"):
        ParameterFile.read(tmp_path / "a.toml")


@pytest.mark.parametrize("name", presets.available())
def test_shipped_files_are_as_the_writer_writes_them(name: str, root: Path) -> None:
    text = (root / "python" / "mgdd" / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    assert presets.load(name).to_toml() == text
