"""Parameter records and presets: equality, hash, pickle, text, and TOML there and back for every field."""

from __future__ import annotations

import copy
import math
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd import presets
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError
from mgdd.presets.preset import Preset
from mgdd.throttle import Throttle

RECORDS = (Cylinder, OperatingPoint, Throttle)
CHANGES = [(kind, name) for kind in RECORDS for name in kind.fields()]


def another(kind, name):
    """A valid value of the field that is not its default."""
    field = kind.fields()[name]
    if "choices" in field:
        return next(choice for choice in field["choices"] if choice != field["default"])
    if field["default"] is None:
        return 17.25
    return field["default"] * 1.01 + (0.015625 if field["default"] == 0.0 else 0.0)


@pytest.mark.parametrize(("kind", "name"), CHANGES, ids=[f"{k.__name__}.{n}" for k, n in CHANGES])
def test_every_field_survives_every_way_round(kind, name, tmp_path):
    value = another(kind, name)
    changed, default = kind(**{name: value}), kind()
    assert getattr(changed, name) == value
    assert changed == default.replace(**{name: value})
    assert changed != default
    assert hash(changed) == hash(kind(**{name: value}))
    assert hash(changed) != hash(default)
    assert changed.to_dict()[name] == value
    for copied in (pickle.loads(pickle.dumps(changed)), copy.deepcopy(changed), eval(repr(changed))):
        assert copied == changed
        assert hash(copied) == hash(changed)
    assert repr(changed) == f"{kind.__name__}({name}={value!r})"
    table = {Cylinder: "cylinder", OperatingPoint: "point", Throttle: "throttle"}[kind]
    engine = {} if kind is Throttle else {"cylinder": Cylinder(), "point": OperatingPoint()}
    preset = Preset(name="mine", title='a "title", °CA', **{**engine, table: changed})
    file = tmp_path / "mine.toml"
    file.write_text(preset.to_toml(), encoding="utf-8")
    back = presets.load(file)
    assert (back.name, back.title) == (preset.name, preset.title)
    assert back.records == preset.records
    assert back.records == preset.records
    assert getattr(back, table) == changed


def test_records_are_immutable_and_equal_to_their_own_kind_only():
    cylinder = Cylinder()
    with pytest.raises(AttributeError):
        cylinder.bore_mm = 90.0
    assert cylinder != OperatingPoint()
    assert cylinder != "Cylinder()"
    assert repr(cylinder) == "Cylinder()"
    assert len({cylinder, Cylinder(), Cylinder(bore_mm=90.0)}) == 2
    with pytest.raises(TypeError):
        Cylinder(90.0)


@pytest.mark.parametrize("name", presets.available())
def test_a_preset_survives_pickle_copy_and_a_worker(name):
    preset = presets.load(name)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as workers:
        returned = workers.submit(presets.load, name).result()
    for back in (pickle.loads(pickle.dumps(preset)), copy.copy(preset), copy.deepcopy(preset), returned):
        assert back == preset
        assert back.sources == preset.sources
        assert back.to_toml() == preset.to_toml()
        with pytest.raises(TypeError):
            back.sources["cylinder.bore_mm"] = "elsewhere"
        with pytest.raises(TypeError):
            back.records["point"] = OperatingPoint()


def test_a_preset_keeps_its_own_sources():
    sources = {"cylinder.bore_mm": "drawing"}
    preset = Preset(name="mine", title="mine", cylinder=Cylinder(), sources=sources)
    sources["cylinder.bore_mm"] = "guess"
    assert preset.sources == {"cylinder.bore_mm": "drawing"}


@given(
    bore=st.floats(20.0, 500.0), ratio=st.floats(5.0, 30.0), scale=st.floats(0.0, 3.0), slope=st.floats(-1.0e-4, 1.0e-4)
)
@settings(max_examples=50)
def test_any_number_survives_exactly(bore, ratio, scale, slope, tmp_path_factory):
    cylinder = Cylinder(bore_mm=bore, compression_ratio=ratio, wall_heat_scale=scale, gamma_linear_slope_per_k=slope)
    assert pickle.loads(pickle.dumps(cylinder)) == cylinder
    assert eval(repr(cylinder)) == cylinder
    file = tmp_path_factory.mktemp("preset") / "x.toml"
    file.write_text(Preset(name="x", title="x", cylinder=cylinder, point=OperatingPoint()).to_toml())
    assert presets.load(file).cylinder == cylinder


@pytest.mark.parametrize("name", presets.available())
def test_shipped_presets_state_a_source_for_every_value(name, tmp_path):
    preset = presets.load(name)
    assert preset.name == name
    for table, record in preset.records.items():
        for key, value in record.to_dict().items():
            if value is not None:
                assert len(preset.sources[f"{table}.{key}"]) > 3, key
    file = tmp_path / "copy.toml"
    file.write_text(preset.to_toml(), encoding="utf-8")
    assert presets.load(file) == preset


def test_the_two_engines_are_what_they_say():
    puma, hd = presets.load("puma_single"), presets.load("hd_diesel_128x144")
    assert puma.cylinder == Cylinder()
    assert puma.point == OperatingPoint()
    assert "plausible" in puma.title.lower()
    assert (hd.cylinder.bore_mm, hd.cylinder.stroke_mm, hd.cylinder.connecting_rod_mm) == (128.0, 144.0, 241.5)
    assert (hd.cylinder.compression_ratio, hd.cylinder.ivc_cad, hd.cylinder.evo_cad) == (20.3, -143.0, 125.0)
    assert hd.point.speed_rpm == 1200.0


def test_the_three_throttles_are_what_they_say():
    p1, p2, p3 = (presets.load(name).throttle for name in presets.available("throttle"))
    assert p1 == Throttle()
    assert (p2.friction, p2.stiction_nm / p2.coulomb_nm) == ("stribeck", pytest.approx(1.1))
    assert p2 == p1.replace(
        spring_above_nm_per_rad=0.819, spring_below_nm_per_rad=0.819, preload_above_nm=0.2, preload_below_nm=0.2,
        coulomb_nm=0.1, stiction_nm=0.11, friction="stribeck",
    )  # fmt: skip
    assert (p3.limp_home_deg, p3.torque_constant_nm_per_a / p3.resistance_ohm) == (12.0, 0.24)
    for name in presets.available("throttle"):  # the only place of rest is limp-home
        throttle = presets.load(name).throttle
        assert min(throttle.preload_above_nm, throttle.preload_below_nm) > throttle.stiction_nm
        assert "not read" in presets.load(name).sources["throttle.inertia_kgm2"] or name == "P3"


def test_engines_and_throttles_are_kept_apart():
    assert presets.available() == tuple(sorted(presets.available("engine") + presets.available("throttle")))
    assert [presets.load(name).kind for name in ("P1", "puma_single")] == ["throttle", "engine"]
    with pytest.raises(ParameterError, match="'P1' is a throttle, not an engine: shipped engines are hd_diesel"):
        _ = presets.load("P1").cylinder
    with pytest.raises(ParameterError, match="'P1' is a throttle, not an engine"):
        _ = presets.load("P1").point
    with pytest.raises(ParameterError, match="'puma_single' is an engine, not a throttle: shipped throttles are P1"):
        _ = presets.load("puma_single").throttle
    with pytest.raises(ParameterError, match="'puma_single' is an engine, not a throttle"):
        presets.load("puma_single", kind="throttle")
    with pytest.raises(ParameterError, match="no preset 'P4': shipped are P1, P2, P3; or pass a path"):
        presets.load("P4", kind="throttle")
    with pytest.raises(ParameterError, match="kind = 'car': must be one of engine, throttle"):
        presets.available("car")
    for nothing in ({}, {"point": OperatingPoint()}, {"cylinder": Cylinder(), "throttle": Throttle()}):
        with pytest.raises(ParameterError, match=r"preset 'x': give a cylinder \(and its point\), or a throttle"):
            Preset(name="x", title="x", **nothing)
    assert Preset(name="x", title="x", cylinder=Cylinder()).point == OperatingPoint()


def written(tmp_path, text):
    kind = "throttle" if text.startswith("[throttle]") else "engine"
    file = tmp_path / "bad.toml"
    file.write_text(f'kind = "{kind}"\nformat = 1\n{text}', encoding="utf-8")
    return file


BORE = 'bore_mm = { value = 90.0, unit = "mm", source = "mine" }'


def spoilt(old, new):
    return "[cylinder]\n" + BORE.replace(old, new)


@pytest.mark.parametrize(
    ("text", "error", "match"),
    [
        (spoilt("bore", "bohr"), ParameterError, "bohr_mm: unknown key: did you mean 'bore_mm'"),
        (spoilt("90.0", "-90.0"), ParameterError, "bore_mm = -90 mm: must be > 0"),
        (spoilt("90.0", "nan"), ParameterError, "bore_mm = nan"),
        (spoilt('"mm"', '"cm"'), ParameterError, "unit = 'cm': must be 'mm'"),
        ('[cylinder]\nbore_mm = { value = 90.0, source = "mine" }', ParameterError, "unit = None: must be 'mm'"),
        ("[cylinder]\nbore_mm = 90.0", ParameterError, 'bore_mm: unit = None: .*write bore_mm = .* unit = "mm"'),
        (spoilt("source", "origin"), ParameterError, "bore_mm: .*; write bore_mm"),
        (spoilt("90.0", '"wide"'), ParameterError, "bore_mm"),
        (f"[cylinder]\n{BORE}\n[motor]\nx = 1", ParameterError, "unknown key 'motor'"),
        (f"[cylinder]\n{BORE}\n[throttle]\n", ParameterError, "unknown key 'throttle'"),
        ("[throttle]\n", DataError, r"\[throttle\] lacks inertia_kgm2, .*a motor has no default"),
        (
            '[throttle]\ncoulomb_nm = { value = 0.3, unit = "N cm", source = "mine" }',
            ParameterError,
            "coulomb_nm: unit = 'N cm': must be 'N m'",
        ),
        (
            '[throttle]\ncoulomb_nm = { value = -0.3, unit = "N m", source = "mine" }',
            ParameterError,
            r"coulomb_nm = -0.3 N m: must be in \[0, 100\]",
        ),
        ("[point]\n", DataError, r"no table \[cylinder\]"),
        ("cylinder = 3", ParameterError, r"unknown key 'cylinder': did you mean '\[cylinder\]'"),
        ("[cylinder", DataError, "not valid TOML"),
        ("", DataError, r"no table \[cylinder\]"),
        (
            '[cylinder]\nburn_shape = { value = "square", unit = "-", source = "mine" }',
            ParameterError,
            "burn_shape = 'square'.*triangle",
        ),
    ],
)
def test_a_bad_preset_is_refused_with_file_field_and_remedy(text, error, match, tmp_path):
    file = written(tmp_path, text)
    with pytest.raises(error, match=match) as caught:
        presets.load(file)
    assert "bad.toml" in str(caught.value)


def test_an_unknown_preset_suggests_the_nearest(tmp_path):
    with pytest.raises(ParameterError, match="did you mean 'puma_single'"):
        presets.load("puma_singel")
    with pytest.raises(FileNotFoundError):
        presets.load(tmp_path / "none.toml")


def test_a_partial_preset_keeps_the_defaults(tmp_path):
    fields = {**Cylinder.fields(), "bore_mm": {"unit": "mm", "default": 90.0}}
    rows = [
        f'{name} = {{ value = {fields[name]["default"]}, unit = "{fields[name]["unit"]}", source = "mine" }}'
        for name in ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
    ]
    preset = presets.load(written(tmp_path, "[cylinder]\n" + "\n".join(rows)))
    with pytest.raises(DataError, match="lacks evo_cad"):
        presets.load(written(tmp_path, "[cylinder]\n" + "\n".join(rows[:-1])))
    assert preset.cylinder == Cylinder(bore_mm=90.0)
    assert preset.point == OperatingPoint()
    assert preset.name == "bad"
    assert preset.sources["cylinder.bore_mm"] == "mine"
    assert math.isclose(preset.cylinder.swept_volume_l, math.pi / 4.0 * 0.9**2 * 0.86)
