"""Pressure traces: what is read is what was written; every refusal says where, what and how to mend it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mgdd.errors import DataError, ShapeError
from mgdd.io import pressure_trace, read_pressure, write_csv
from mgdd.io.point_table import read_conditions
from mgdd.io.pressure_checks import check_trace
from mgdd.results.labels import ANGLE, check_labels

ANGLES = np.arange(-143.0, 124.0)
BAR = 1.5 + 120.0 * np.exp(-((ANGLES - 6.0) ** 2) / 1500.0)


def text(angle=ANGLES, pressure=BAR, *, mark=",", header=""):
    count = min(len(angle), len(pressure))
    pairs = np.column_stack([angle[:count], pressure[:count]]).tolist()
    rows = [f"{a!r}{mark}{p!r}" for a, p in pairs]
    return header + "\n".join(rows) + "\n"


@pytest.fixture
def file(tmp_path):
    def write(content, name="mean.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.mark.parametrize("mark", [",", ";", "\t", "  ", " , ", " \t "])
@pytest.mark.parametrize("header", ["", "# a comment\n\n", "angle{m}p\n", "angle{m}p\n[deg]{m}[bar]\n"])
def test_layouts(file, mark, header):
    trace = read_pressure(file(text(mark=mark, header=header.format(m=mark))))
    check_labels(trace)
    np.testing.assert_array_equal(trace[ANGLE], ANGLES)
    np.testing.assert_array_equal(trace["pressure_bar"], BAR)
    assert trace.attrs == {"file": "mean.csv", "warnings": ""}


def test_columns_by_name_and_by_number(file):
    rows = "".join(f"{i},{p},{a}\n" for i, (a, p) in enumerate(zip(ANGLES, BAR, strict=True)))
    path = file("sample,p_cyl,phi\n" + rows)
    by_name = read_pressure(path, angle_column="phi", pressure_column="p_cyl")
    assert by_name.equals(read_pressure(path, angle_column=2, pressure_column=1))
    np.testing.assert_array_equal(by_name["pressure_bar"], BAR)


def test_decimal_comma(file):
    path = file(text(mark=";").replace(".", ","))
    np.testing.assert_array_equal(read_pressure(path, decimal=",")["pressure_bar"], BAR)
    with pytest.raises(DataError, match=r"line 1, column 0: '-143,0' is not a number: pass decimal=','"):
        read_pressure(file("-143,0;1,0\n" + text(mark=";")), decimal=".")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1", "utf-16"])
def test_encodings(file, encoding):
    path = file(text(header="Winkel °KW,Druck\n").encode(encoding))
    assert read_pressure(path, angle_column="Winkel °KW").sizes[ANGLE] == ANGLES.size


pascal = st.lists(st.integers(1_000, 3_000_000), min_size=267, max_size=267).map(lambda p: [*p[:143], 3e7, *p[144:]])


@given(pascal)
def test_units_agree_to_the_last_digit(values):
    in_pa = np.array(values, dtype=float)
    _, from_pa = check_trace(ANGLES, in_pa, unit="Pa")
    np.testing.assert_array_equal(from_pa, [float(f"{int(v)}e-5") for v in in_pa])
    _, from_kpa = check_trace(ANGLES, in_pa / 1000.0, unit="kPa")
    np.testing.assert_allclose(from_kpa, from_pa, rtol=4e-16)


def test_radians():
    angle, pressure = check_trace(np.deg2rad(ANGLES), BAR, angle_unit="rad")
    np.testing.assert_allclose(angle, ANGLES, atol=1e-12)
    np.testing.assert_array_equal(pressure, BAR)


@given(
    st.lists(st.floats(-2.0, 90.0), min_size=150, max_size=250),
    st.floats(0.1, 1.2),
    st.floats(-60.0, -5.0),
)
def test_write_then_read_is_exact(tmp_path_factory, values, step, start):
    path = tmp_path_factory.mktemp("trace") / "trace.csv"
    angle = start + step * np.arange(len(values))
    pressure = np.array(values)
    pressure[np.argmin(np.abs(angle))] = 100.0  # somewhere near TDC it must look like an engine
    trace = pressure_trace(angle, pressure, name="trace.csv")
    write_csv(trace, path)
    found = read_pressure(path)
    assert found.drop_attrs(deep=False).identical(trace.drop_attrs(deep=False))
    # Each names the remedy that the function called takes.
    assert len(found.attrs["warnings"].splitlines()) == len(trace.attrs["warnings"].splitlines())


def test_nothing_of_the_caller_is_changed_or_kept():
    angle, bar = ANGLES.copy(), BAR.copy()
    angle.flags.writeable = bar.flags.writeable = False
    trace = pressure_trace(angle, bar)
    trace["pressure_bar"][0] = 99.0
    turned = pressure_trace(angle + 360.0, bar, firing_tdc_deg=360.0)
    turned["pressure_bar"][0] = 99.0
    np.testing.assert_array_equal(angle, ANGLES)
    np.testing.assert_array_equal(bar, BAR)


@given(st.floats(0.0, 720.0))
def test_0_720_puts_firing_tdc_at_zero(tdc):
    angle = np.arange(0.0, 720.0, 1.0)
    past = (angle - tdc + 360.0) % 720.0 - 360.0
    trace = pressure_trace(angle, 2.0 + 100.0 * np.cos(np.deg2rad(past) / 4.0) ** 2, firing_tdc_deg=tdc)
    cad, reordered = trace[ANGLE].to_numpy(), trace["pressure_bar"].to_numpy()
    assert cad.min() >= -360.0
    assert cad.max() <= 360.0
    assert np.all(np.diff(cad) >= 0.0)
    np.testing.assert_allclose(reordered, 2.0 + 100.0 * np.cos(np.deg2rad(cad) / 4.0) ** 2, atol=1e-9)


def test_btdc_converts(file):
    trace = pressure_trace(-ANGLES, BAR, before_tdc=True)
    np.testing.assert_array_equal(trace[ANGLE], ANGLES)
    np.testing.assert_array_equal(trace["pressure_bar"], BAR)
    assert read_pressure(file(text(-ANGLES)), before_tdc=True).drop_attrs(deep=False).equals(trace)
    with pytest.raises(DataError, match="one convention: give one of them"):
        pressure_trace(ANGLES, BAR, firing_tdc_deg=0.0, before_tdc=True)


def replaced(array, index, value):
    changed = array.copy()
    changed[index] = value
    return changed


def without(index):
    return np.delete(ANGLES, index), np.delete(BAR, index)


ARRAY_FAULTS = {
    "short": (ANGLES[:19], BAR[:19], {}, "bench: 19 samples; at least 20 are needed"),
    "nan": (ANGLES, replaced(BAR, 7, np.nan), {}, "bench, sample 7: pressure = nan: must be finite"),
    "infinite": (replaced(ANGLES, 3, np.inf), BAR, {}, "bench, sample 3: crank angle = inf: must be finite"),
    "unsorted": (
        replaced(ANGLES, 5, -150.0),
        BAR,
        {},
        "sample 5: crank angle -150 follows -139: .*sort the rows",
    ),
    "repeated": (replaced(ANGLES, 5, -139.0), BAR, {}, "sample 5: crank angle -139 is repeated: keep one"),
    "cycles": (
        np.concatenate([np.arange(-360.0, 360.0)] * 2),
        np.tile(np.interp(np.arange(-360.0, 360.0), ANGLES, BAR), 2),
        {},
        "sample 720: crank angle -360 follows 359: .*another cycle",
    ),
    "gap": (*without(100), {}, "sample 100: gap in the crank angle from -44 to -42: the usual step is 1;"),
    "falling": (
        -ANGLES,
        BAR,
        {},
        "looks like °bTDC; .*firing TDC = 0, compression negative; pass before_tdc=True",
    ),
    "0..720": (ANGLES + 360.0, BAR, {}, "run from 217 to 483: .*0..720 record; .*firing_tdc_deg="),
    "wrong TDC": (
        np.arange(0.0, 361.0),
        2.0 + 100.0 * np.exp(-((np.arange(0.0, 361.0) - 355.0) ** 2) / 900.0),
        {},
        "102 bar is at 355, far from firing TDC: .*firing_tdc_deg=",
    ),
    "radians": (np.deg2rad(ANGLES), BAR, {}, r"span only 4\.64\d+ degrees: this looks like radians; .*'rad'"),
    "degrees": (ANGLES, BAR, {"angle_unit": "rad"}, "span 266 rad: this looks like degrees; .*'deg'"),
    "unit": (
        ANGLES,
        BAR,
        {"unit": "inHg"},
        "pressure_unit = 'inHg': must be one of 'bar', 'mbar', 'kPa', 'Pa', 'MPa', ",
    ),
    "angle unit": (ANGLES, BAR, {"angle_unit": "grad"}, "angle_unit = 'grad': must be one of 'deg', 'rad'"),
    "all zero": (ANGLES, 0.0 * BAR, {}, "highest pressure 0 bar .*no unit of bar, mbar, kPa, Pa, MPa, psi fits"),
}


@pytest.mark.parametrize("fault", ARRAY_FAULTS)
def test_array_faults(fault):
    angle, pressure, options, message = ARRAY_FAULTS[fault]
    with pytest.raises(DataError, match=message):
        check_trace(angle, pressure, source="bench", **options)


@pytest.mark.parametrize(
    ("said", "factor", "likely"),
    [("bar", 1e5, "Pa"), ("bar", 1e2, "kPa"), ("kPa", 1e3, "Pa"), ("kPa", 1e-2, "bar"), ("Pa", 1e-3, "kPa"),
     ("Pa", 1e-5, "bar")],
)  # fmt: skip
@pytest.mark.parametrize("peak", [20.0, 126.5, 300.0])
def test_a_unit_that_magnitude_excludes(said, factor, likely, peak):
    bar = 1.0 + (BAR - BAR.min()) * (peak - 1.0) / np.ptp(BAR)
    per_bar = {"bar": 1.0, "kPa": 100.0, "Pa": 1e5}
    check_trace(ANGLES, bar * per_bar[said], unit=said)
    with pytest.raises(DataError, match=f"looks like .*{likely}.*; pass pressure_unit=.*'{likely}'"):
        check_trace(ANGLES, bar * per_bar[said] * factor, unit=said)


def test_a_piezo_offset_is_no_unit_error():
    check_trace(ANGLES, BAR - 3.0)


def test_shapes():
    with pytest.raises(ShapeError, match=r"crank angle has shape \(267,\) and pressure \(266,\)"):
        check_trace(ANGLES, BAR[1:])
    with pytest.raises(ShapeError, match="one-dimensional"):
        pressure_trace(ANGLES[None], BAR[None])


FILE_FAULTS = {
    "empty": ("", {}, "the file is empty"),
    "only comments": ("# nothing\n\n", {}, "the file is empty"),
    "only a header": ("angle,p\n", {}, "no numeric rows"),
    "binary": (b"\x00\x01\x02", {}, "binary file: export it as text"),
    "short": (text(ANGLES[:10], BAR[:10]), {}, "10 samples; at least 20"),
    "word": (text().replace("-139.0,", "-139.0,a"), {}, r"line 5, column 1: 'a.*' is not a number: correct"),
    "slip in row 1": ("-144.0,l.5\n" + text(), {}, "line 1, column 1: 'l.5' is not a number: correct it"),
    "slips in row 1": ("-144.0a,1.5b\n" + text(), {}, "line 1, column 0: '-144.0a' is not a number"),
    "nan": (text(header="a,p\n").replace("-140.0,", "-140.0,nan #").replace(" #", "\n#"), {},
            r"line 5, column 'p': 'nan' is not finite: remove"),
    "blank cell": (text().replace("-141.0,", "-141.0,\n#"), {}, "line 3, column 1: the cell is empty"),
    "ragged": (text().replace("-141.0,", "-141.0,7,"), {}, r"line 3: 3 cell\(s\) where line 1 has 2"),
    "no such name": (text(header="a,p\n"), {"pressure_column": "P"}, "no column 'P': .* has 'a', 'p'"),
    "two of a name": (text(header="a,a\n"), {"pressure_column": "a"}, "more than one column 'a'"),
    "no header": (text(), {"angle_column": "a"}, "without a header no column can be called 'a': .*, 0 to 1, or"),
    "no such number": (text(), {"pressure_column": 2}, r"no column 2: the 2 column\(s\) are numbered from 0"),
    "negative number": (text(), {"pressure_column": -1}, "no column -1"),
    "one column": ("\n".join(map(str, ANGLES)), {}, "one column only: .* pass angle_step_deg= with"),
    "units row": (text(header="a,p\ndeg,kPa\n"), {}, "looks like bar; the file says kPa: correct it there"),
    "decimal": (text(), {"decimal": "x"}, "decimal = 'x': must be '.' or ','"),
    "delimiter": (text(), {"delimiter": ""}, "delimiter = ''"),
    "percent": (text(header="a,x [%]\n"), {"pressure_column": "x [%]"}, r"'x \[%\]' is in %, which is not a pressure"),
    "rpm": (text(header="a,x\ndeg,rpm\n"), {"pressure_column": 1}, "'x' is in rpm, which is not a pressure"),
    "time": (text(header="a,x [s]\n"), {"pressure_column": 1, "pressure_unit": "bar"}, "in s, which is not a pressure"),
    "gap": (text(*without(9), header="# c\na,p\n"), {}, "line 12: gap in the crank angle from -135 to -133"),
    "unsorted": (text(replaced(ANGLES, 4, -150.0)), {}, "line 5: crank angle -150 follows -140"),
    "pascal": (text(pressure=BAR * 1e5), {}, "looks like Pa; pass pressure_unit='Pa'"),
    "firing TDC": (text(), {"firing_tdc_deg": -1.0}, r"firing_tdc_deg = -1: must be in \[0, 720\]"),
    "unsorted 0..720": (text(ANGLES[::-1]), {"firing_tdc_deg": 0.0}, "must rise"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FILE_FAULTS)
def test_file_faults_name_the_file(file, fault):
    content, options, message = FILE_FAULTS[fault]
    with pytest.raises(DataError, match=message) as caught:
        read_pressure(file(content), **options)
    assert "mean.csv" in str(caught.value) or fault in {"decimal", "delimiter"}


def test_a_missing_file_is_an_oserror_with_its_path(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file: check the path") as caught:
        read_pressure(tmp_path / "lost.csv")
    assert caught.value.filename.endswith("lost.csv")


def test_a_refused_write_leaves_the_old_file(file):
    path = file("old")
    trace = pressure_trace(ANGLES, BAR)
    with pytest.raises(DataError, match="highest pressure"):
        write_csv(trace.assign(pressure_bar=trace["pressure_bar"] * 0.0), path)
    with pytest.raises(DataError, match=r"no pressure_bar\(crank_angle_cad\) and no time_s: make a trace with"):
        write_csv(trace.drop_vars("pressure_bar"), path)
    assert path.read_text() == "old"


def test_conditions(file):
    path = file("file,speed_rpm,trapped_mass_g,soi_cad\na.csv,1200,3.1,-5.06\nb.csv,1500,,\n")
    assert read_conditions(path) == {
        "a.csv": {"speed_rpm": 1200.0, "trapped_mass_g": 3.1, "soi_cad": -5.06},
        "b.csv": {"speed_rpm": 1500.0},
    }


def test_conditions_of_the_whole_bench(file):
    path = file(
        "file,spark_cad,intake_pressure_kpa,intake_temperature_k,fuel_mg,bmep_bar,brake_torque_nm\n"
        "a.csv,-25,95,313,0,-0.6,-12\n"
    )
    assert read_conditions(path)["a.csv"] == {
        "spark_cad": -25.0,
        "intake_pressure_kpa": 95.0,
        "intake_temperature_k": 313.0,
        "fuel_mg": 0.0,
        "bmep_bar": -0.6,
        "brake_torque_nm": -12.0,
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a.csv,1200\n", "needs a column 'file'"),
        (
            "file,speed\na.csv,1200\n",
            "unknown or repeated column .*known are 'file', 'load_percent', 'speed_rpm'",
        ),
        ("file,speed_rpm\na.csv,1\na.csv,2\n", "line 3: file = 'a.csv': name every trace, each once"),
        ("file,speed_rpm\na.csv,1\nb.csv,fast\n", "line 3: speed_rpm = 'fast': must be a finite number"),
        ("file,speed_rpm\na.csv,-1200\n", "line 2: speed_rpm = -1200: must be between 0 and 30000"),
        ("file,spark_cad\na.csv,335\n", "spark_cad = 335: must be between -90 and 40; .*firing TDC = 0"),
        ("file,intake_temperature_k\na.csv,40\n", "intake_temperature_k = 40: must be between 200 and 1000"),
        ("file,fuel_mg\na.csv,-1\n", "fuel_mg = -1: must be between 0 and 100000"),
        ("file,intake_pressure_kpa\na.csv,0\n", "intake_pressure_kpa = 0: must be between 0 and 2000"),
        ("file,soi_cad\na.csv,355\n", "soi_cad = 355: .*firing TDC = 0, compression negative"),
    ],
)
def test_condition_faults(file, content, message):
    with pytest.raises(DataError, match=message):
        read_conditions(file(content))


def test_what_the_angles_are_too_large_by_is_taken_off_in_every_convention() -> None:
    angle = np.arange(-360.0, 360.0, 0.5)
    pressure = 1.0 + 60.0 * np.exp(-(((angle - 7.0) / 30.0) ** 2))  # not the same on both sides
    ways = ((1.0, 0.0, {}), (1.0, 360.0, {"firing_tdc_deg": 360.0}), (-1.0, 0.0, {"before_tdc": True}))
    for (turn, base, said), offset in itertools.product(ways, (1.5, -1.0)):
        trace = pressure_trace(turn * (angle + offset) + base, pressure, tdc_offset_cad=offset, **said)
        near = trace.sel(crank_angle_cad=slice(-200.1, 200.1))
        np.testing.assert_allclose(near["crank_angle_cad"], angle[np.abs(angle) <= 200.0], atol=1e-9)
        np.testing.assert_array_equal(near["pressure_bar"], pressure[np.abs(angle) <= 200.0])
    with pytest.raises(DataError, match="tdc_offset_cad = 21: must be within ±20"):
        pressure_trace(angle, pressure, tdc_offset_cad=21.0)
    with pytest.raises(DataError, match="tdc_offset_cad = nan"):
        pressure_trace(angle, pressure, tdc_offset_cad=np.nan)


def test_a_whole_cycle_may_begin_a_little_off() -> None:
    angle = np.arange(-358.8, 361.01, 0.6)
    trace = pressure_trace(angle, 1.0 + 60.0 * np.exp(-((angle / 30.0) ** 2)))
    np.testing.assert_allclose(trace["crank_angle_cad"], angle)
    with pytest.raises(DataError, match=r"looks like a 0\.\.720 record"):
        pressure_trace(angle + 400.0, 1.0 + 60.0 * np.exp(-((angle / 30.0) ** 2)))
