"""DCM and CDFX of other hands: odd labels, older encodings, damage, and maps that come back alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import AXES, FUEL, VALUES, read
from mgdd.errors import DataError, ParameterError
from mgdd.maps import CalibrationMap, read_dcm, read_map, write_map

DATA = Path(__file__).parents[2] / "data"


def test_odd_labels_of_a_dcm_file() -> None:
    found = read_dcm(DATA / "odd_labels.dcm")
    assert found.values == {"Öl%Anteil": (12.5, "%")}
    assert found.breakpoints == {
        "Grid.n[0]": ((900.0, 1400.0, 3000.0), "rpm"), "Grid.q%rel": ((10.0, 60.0), "%"),
    }  # fmt: skip
    assert list(found.maps) == ["KF_Öl.soll[1]", "T%max.K", "OhneStuetzstellen", "Fest.Linie"]
    oil, line, table, fixed = found.maps.values()
    assert oil.labels[oil.name] == ("bar", "Öldruck, soll (warm)")
    assert oil.values.tolist() == [[1.5, 2.0], [2.5, 3.0], [4.0, 5.5]]
    assert list(oil.axes) == ["Grid.n[0]", "Grid.q%rel"]
    assert (list(line.axes), line.unit, line.labels["Grid.n[0]"].units) == (["Grid.n[0]"], "degC", "rpm")
    assert line.values.tolist() == [80.0, 95.0, 110.0]
    assert table.values.tolist() == [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]]
    assert [table.axes[name].size for name in ("Grid.n[0]", "Grid.q%rel")] == [3, 2]
    assert (fixed.unit, fixed.labels["x"].units) == ("°CA", "mg/Hub")
    assert found.skipped == (
        "line 4: VERSION: unknown keyword",
        "line 24: ROBUSTHEIT in GRUPPENKENNFELD KF_Öl.soll[1]: unknown keyword",
        "FESTWERT Motor.Variante",
        "KENNLINIE Gang.Text 2",
        "line 72: MATRIX: unknown keyword",
    )


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "cp1252"])
def test_a_dcm_file_in_older_encodings(encoding: str, tmp_path: Path) -> None:
    text = (DATA / "odd_labels.dcm").read_text(encoding="utf-8")
    file = tmp_path / "odd.dcm"
    file.write_bytes(text.encode(encoding))
    assert read_dcm(file) == read_dcm(DATA / "odd_labels.dcm")


def test_a_cdfx_file_of_other_hands() -> None:
    found = read_dcm(DATA / "tool.cdfx")
    assert found.values == {"N.Idle": (850.0, "rpm")}
    assert found.breakpoints == {"Grid.n": ((900.0, 1400.0, 3000.0), "rpm")}
    assert list(found.maps) == ["KF.Torque", "KL.Fest"]
    torque = found.maps["KF.Torque"]
    assert torque.values.tolist() == [[80.0, 110.0], [95.0, 120.5], [70.5, 101.0]]
    assert {name: label.units for name, label in torque.labels.items()} == {
        "Grid.n": "rpm", "y": "degC", "KF.Torque": "N m",
    }  # fmt: skip
    assert torque.labels["KF.Torque"].long_name == "Drehmoment, größter Wert"
    assert found.maps["KL.Fest"].axes["x"].tolist() == [0.0, 16.0]
    assert found.skipped == (
        "Cube: category CUBOID: only VALUE, CURVE, MAP, COM_AXIS are read",
        "Text: its values are texts, or not there",
        "KL.Away: the breakpoints of its axis Elsewhere are not in the file",
    )
    with pytest.raises(ParameterError, match="no map 'Cube': Cube: category CUBOID: only VALUE, CURVE, MAP"):
        read_map(DATA / "tool.cdfx", "Cube")


TEXT = st.text(st.characters(codec="latin-1", exclude_categories=("C", "Z"), exclude_characters='"'), max_size=12)


@st.composite
def whole_maps(draw: st.DrawFn) -> CalibrationMap:
    sizes = draw(st.sampled_from([(3,), (3, 5), (2, 4)]))
    numbers = st.floats(-1e300, 1e300)
    axes = {
        name: sorted(draw(st.lists(numbers, min_size=size, max_size=size, unique=True)))
        for name, size in zip(("speed_rpm", "y[0].b%"), sizes, strict=False)
    }
    count = int(np.prod(sizes))
    values = np.array(draw(st.lists(numbers, min_size=count, max_size=count))).reshape(sizes)
    unit = draw(st.sampled_from(["-", "bar", "°CA", "g/kWh", "not given", "not given (%!)"]))
    return CalibrationMap(axes, values, name="Z.w%", labels={"Z.w%": (unit, draw(TEXT) or "Z.w")})


@settings(max_examples=80, deadline=None)
@given(table=whole_maps(), encoding=st.sampled_from(["utf-8", "latin-1", "cp1252"]))
def test_any_map_comes_back_from_dcm_and_cdfx_alike(
    table: CalibrationMap, encoding: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("labels")
    other = CalibrationMap(AXES, VALUES, name="soc_cad", provenance={"from": "run -- 7 -"})
    files = [folder / "labels.dcm", folder / "labels.cdfx"]
    try:
        for file in files:
            write_map([table, other], file, values={"n": (0.1, "rpm")}, encoding=encoding)
    except DataError as error:
        assert "is not a letter of" in str(error) or "would be read as others" in str(error)  # noqa: PT017
        return
    first, second = map(read_dcm, files)
    assert first == second
    assert first.maps["Z.w%"] == table
    assert first.maps["soc_cad"] == CalibrationMap(AXES, VALUES, name="soc_cad")
    assert first.values == {"n": (0.1, "rpm")}


@pytest.mark.parametrize("ending", ["dcm", "cdfx"])
def test_a_letter_that_does_not_fit_is_named_before_anything_is_written(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"map.{ending}"
    table = CalibrationMap({"fuel_mg": FUEL}, 1.0, name="air_ratio", labels={"air_ratio": ("-", "air ratio λ")})
    write_map(table, file)
    before = file.read_bytes()
    with pytest.raises(DataError, match=r"line \d+: 'λ' in .* is not a letter of latin-1: .* with encoding='utf-8'"):
        write_map(table, file, encoding="latin-1")
    assert file.read_bytes() == before
    with pytest.raises(DataError, match="encoding = 'ascii': must be one of"):
        write_map(table, file, encoding="ascii")
    with pytest.raises(ParameterError, match="encoding = "):
        write_map(table, tmp_path / "map.csv", encoding="latin-1")
    assert [each.name for each in tmp_path.iterdir()] == [file.name]


def test_letters_that_would_be_read_as_others_are_refused(tmp_path: Path) -> None:
    table = CalibrationMap({"fuel_mg": FUEL}, 1.0, name="air_ratio", labels={"air_ratio": ("-", "Â°")})
    with pytest.raises(DataError, match="its letters in latin-1 would be read as others"):
        write_map(table, tmp_path / "map.dcm", encoding="latin-1")
    spaced = {"two words": CalibrationMap({"fuel_mg": FUEL}, 1.0, name="z")}
    with pytest.raises(DataError, match="a label of a DCM file is one word"):
        write_map(spaced, tmp_path / "map.dcm")
    assert not any(tmp_path.iterdir())


BOMB = "<!DOCTYPE m [" + "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9)) + "]><MSRSW>&e9;</MSRSW>"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "line 1: has declarations in its DOCTYPE"),
        ('<!DOCTYPE m SYSTEM "/etc/passwd"><MSRSW>&e;</MSRSW>', "declares or names an entity"),
        ("<MSRSW>&e;</MSRSW>", "not valid XML: undefined entity"),
        ("<a>" * 5000, "nests more than 64 levels deep"),
        ("<MSRSW><SW-SYSTEMS>", "not valid XML: no element found: the file was cut off"),
        ('<?xml version="1.0" encoding="no-such"?><MSRSW/>', "not valid XML"),
        ("<MSRSW><CATEGORY>CDF10</CATEGORY></MSRSW>", "'CDF10': only CDF20"),
    ],
)
def test_xml_that_is_not_read(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=said) as raised:
        read(text, tmp_path, "map.cdfx")
    assert str(raised.value).startswith(str(tmp_path / "map.cdfx"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<V>10.0</V>", "", "soc_cad: speed_rpm|4 VG|breakpoints|has 5 VG for 4 breakpoints of y"),
        ("<V>0.25</V>", "", "has 2 values in VG 1: 3 are needed|3 are needed"),
        ("<V>0.25</V>", "<V>x</V>", r"line \d+: 'x' is not a number"),
        ("<V>0.25</V>", "<V>NaN</V>", r"line \d+: 'NaN' is not a finite number"),
        ("<V>1400.0</V>", "<V>900.0</V>", r"speed_rpm\[1\] = 900: must be above"),
        ("<CATEGORY>MAP", "<CATEGORY>CURVE", "has 2 SW-AXIS-CONT: a CURVE has 1"),
    ],
)
def test_a_damaged_cdfx_file_is_named(old: str, new: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "map.cdfx"
    write_map(CalibrationMap(AXES, VALUES, name="soc_cad"), file)
    text = file.read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(DataError, match=said):
        read(text.replace(old, new, 1), tmp_path, "map.cdfx")
    assert read(text, tmp_path, "map.cdfx").name == "soc_cad"
