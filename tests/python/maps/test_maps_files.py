"""Files of maps: exact round trips, DCM against files and a reader of other hands, damage."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import FUEL, SPEED, sweep, timing_table
from mgdd.errors import DataError, Error, ParameterError
from mgdd.io.files import write_whole
from mgdd.maps import CalibrationMap, optimize_map, read_dcm, read_map, smooth_map, write_map

FOREIGN = Path(__file__).parents[2] / "data" / "foreign.dcm"


def curve() -> CalibrationMap:
    return CalibrationMap({"fuel_mg": FUEL}, [-1.0, -2.0 / 3.0, 0.1, 3e-17, 1e22], name="soc_cad")


def optimised() -> CalibrationMap:
    return optimize_map(
        sweep(), "efficiency_gross", limits={"p_max_bar": 110.0 / 3.0 * 3.0}, max_loss=0.002, infeasible="keep",
        sd={"efficiency_gross": 1e-4}, provenance={"from": "sweep 12; second half", "date": "2024-05-17"},
    )  # fmt: skip


# --- round trips --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("made", [curve, timing_table, optimised], ids=lambda made: made.__name__)
def test_everything_comes_back_bit_for_bit(made: Callable[[], CalibrationMap], tmp_path: Path) -> None:
    table, file = made(), tmp_path / "map.nc"
    for write, read in ((write_map, read_map), (CalibrationMap.save, CalibrationMap.load)):
        write(table, file)
        back = read(file)
        assert back == table
        assert back.provenance == table.provenance
        assert back.task == table.task
        assert [item.name for item in tmp_path.iterdir()] == [file.name]  # nothing left beside it
        file.unlink()


def whole(table: CalibrationMap) -> CalibrationMap:
    return CalibrationMap(table.axes, table.values, name=table.name, labels=table.labels)


def test_a_dcm_file_gives_axes_values_and_units_back(tmp_path: Path) -> None:
    table = whole(curve())
    other = CalibrationMap({"speed_rpm": SPEED, "fuel_mg": FUEL}, np.arange(15.0).reshape(3, 5) / 3.0, name="torque_nm")
    write_map([table, other], tmp_path / "all.dcm", values={"idle_rpm": (850.0, "rpm")})
    back = read_dcm(tmp_path / "all.dcm")
    assert list(back.maps) == ["soc_cad", "torque_nm"]
    np.testing.assert_array_equal(back.maps["torque_nm"].values, other.values)
    assert back.maps["soc_cad"] == table
    assert back.values == {"idle_rpm": (850.0, "rpm")}
    assert back.skipped == ()
    assert read_map(tmp_path / "all.dcm", "torque_nm") == other
    with pytest.raises(ParameterError, match="holds soc_cad, torque_nm: give the name"):
        read_map(tmp_path / "all.dcm")
    with pytest.raises(ParameterError, match="did you mean 'soc_cad'"):
        read_map(tmp_path / "all.dcm", "soc_cat")


TEXT = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=12)


@st.composite
def tables(draw: st.DrawFn) -> CalibrationMap:
    sizes = draw(st.lists(st.integers(2, 4), min_size=1, max_size=2))
    numbers = st.floats(-1e300, 1e300)
    axes = {
        name: sorted(draw(st.lists(numbers, min_size=size, max_size=size, unique=True)))
        for name, size in zip(("x", "y[0].b"), sizes, strict=False)
    }
    count = int(np.prod(sizes))
    values = np.array(draw(st.lists(numbers, min_size=count, max_size=count))).reshape(sizes)
    empty = np.array(draw(st.lists(st.booleans(), min_size=count, max_size=count))).reshape(sizes)
    cells = {
        "source": np.where(empty, draw(st.sampled_from(["infeasible", "unattainable"])), "measured"),
        "sd": np.array(draw(st.lists(st.floats(0.0, 1e9) | st.just(np.nan), min_size=count, max_size=count))).reshape(
            sizes
        ),
        "active_limit": np.array(draw(st.lists(TEXT, min_size=count, max_size=count))).reshape(sizes),
    }
    labels = {"z": (draw(st.sampled_from(["-", "bar", "°CA", "g/kWh"])), draw(TEXT))}
    provenance = draw(st.dictionaries(st.sampled_from(["from", "date", "who"]), TEXT))
    return CalibrationMap(
        axes, np.where(empty, np.nan, values), name="z", labels=labels, cells=cells, provenance=provenance
    )


@settings(max_examples=60, deadline=None)
@given(table=tables())
def test_any_map_comes_back(table: CalibrationMap, tmp_path_factory: pytest.TempPathFactory) -> None:
    file = tmp_path_factory.mktemp("maps") / "map.nc"
    write_map(table, file)
    assert read_map(file) == table


@settings(max_examples=40, deadline=None)
@given(table=tables(), ending=st.sampled_from(["dcm", "csv"]))
def test_axes_and_values_of_any_map_come_back(
    table: CalibrationMap, ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    plain = CalibrationMap(table.axes, np.nan_to_num(table.values), name="z", labels={"z": ("g/kWh", "z")})
    file = tmp_path_factory.mktemp("maps") / f"map.{ending}"
    write_map(plain, file)
    back = read_map(file)
    assert back.replaced(cells={"support": 0.0}) == plain  # points of a curve count as one each


def test_the_csv_of_a_map_is_the_grid_of_a_spreadsheet(tmp_path: Path) -> None:
    write_map(timing_table(), tmp_path / "map.csv")
    rows = [line.split(",") for line in (tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()]
    assert rows[:2] == [
        ["soc_cad [°CA aTDC]", *[""] * 5],
        [r"speed_rpm [rpm] \ fuel_mg [mg]", "6.0", "10.0", "14.0", "25.0", "40.0"],
    ]
    assert rows[4][-1] == ""  # a cell without a value
    back = read_map(tmp_path / "map.csv")
    np.testing.assert_array_equal(back.values, timing_table().values)
    assert set(back.cells["source"].ravel()) == {"given", "unattainable"}


# --- what others write --------------------------------------------------------------------------------------
def test_the_layout_of_other_tools_is_read() -> None:
    found = read_dcm(FOREIGN)
    assert found.values == {"N_Idle": (850.0, "rpm")}
    assert list(found.maps) == ["Soc.Warm[0]", "Soc_cad", "Torque"]
    warm, soc, torque = found.maps.values()
    assert warm.axes["x"].tolist() == [6.0, 10.0, 14.0, 25.5, 40.0]
    assert warm.values.tolist() == [-1.25, -2.5, -3.0, -6.0, -9.0]
    assert (warm.unit, warm.labels["x"].units) == ("°CA", "mg")  # where the angle counts from, the file does not say
    assert warm.labels[warm.name].long_name == "start of combustion, warm"
    assert soc.unit == "°CA aTDC"  # here the name does
    assert {name: entries.tolist() for name, entries in soc.axes.items()} == {
        "speed_rpm": [900.0, 1400.0, 3000.0], "fuel_mg": [6.0, 40.0]
    }  # fmt: skip
    assert soc.values.tolist() == [[-1.0, -5.0], [-2.0, -7.0], [-4.0, -12.0]]
    assert torque.values.tolist() == [[80.0, 110.0], [95.0, 120.5]]
    assert [torque.unit, *(label.units for label in torque.labels.values())] == ["N m", "degC", "bar", "N m"]
    assert found.skipped == ("FUNKTIONEN", "FESTWERT Variant", "FESTWERTEBLOCK Ratios 4")
    assert found.breakpoints == {"Grid": ((1.0, 2.0, 3.0), "mm")}


def test_labels_and_axes_that_no_map_can_be_called_cost_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "tool.dcm"
    write_map({"Soc-Warm/2": whole(curve()), "SocBase": whole(curve())}, file)
    text = file.read_text(encoding="utf-8").replace("*SSTX   fuel_mg", "*SSTX   m fuel / 2", 1)
    head, tail = text.rsplit("*SSTX   fuel_mg", 1)
    file.write_text(f"{head}*SSTX   fuel quantity (mg){tail}", encoding="utf-8")
    found = read_dcm(file)
    assert list(found.maps) == ["SocBase"]
    assert found.skipped == ("Soc-Warm/2: a map is named by letters, digits, _ . % [ and ]: rename the label",)
    assert list(found.maps["SocBase"].axes) == ["x"]
    assert found.maps["SocBase"].labels["x"] == ("mg", "fuel quantity (mg)")
    assert read_map(file) == found.maps["SocBase"]
    with pytest.raises(ParameterError, match="no map 'Soc-Warm/2': Soc-Warm/2: a map is named by letters"):
        read_map(file, "Soc-Warm/2")


READER = """
import json, logging, sys
logging.basicConfig = lambda **_: None
from dcmReader.dcm_reader import DcmReader
read = DcmReader()
read.read(sys.argv[1])
if len(sys.argv) > 2:
    read.write(sys.argv[2], sort_entries=False)
lines, maps = read.get_characteristic_lines(), read.get_characteristic_maps()
print(json.dumps({
    "values": {p.name: [p.value, p.unit] for p in read.get_parameters()},
    "lines": {c.name: [list(c.values), list(c.values.values()), c.unit_x, c.unit_values, c.description] for c in lines},
    "maps": {c.name: [[[y, x, z] for y, row in c.values.items() for x, z in row.items()], c.unit_x, c.unit_y,
                      c.unit_values, c.x_mapping, c.y_mapping, c.x_dimension, c.y_dimension] for c in maps},
}))
"""


def test_a_reader_of_other_hands_reads_ours_and_we_read_what_it_writes(tmp_path: Path) -> None:
    pytest.importorskip("dcmReader", reason="dcmreader is not installed: see the group test")
    best = optimize_map(sweep(), "efficiency_gross", provenance={"from": 'the "closed form"'})
    one, two = tmp_path / "ours.dcm", tmp_path / "theirs.dcm"
    write_map({"SocBase": best, "SocWarm": curve()}, one, values={"N_Idle": (850.5, "1/min")})
    run = subprocess.run([sys.executable, "-c", READER, str(one), str(two)], check=True, capture_output=True, text=True)
    found = json.loads(run.stdout)
    assert found["values"] == {"N_Idle": [850.5, "1/min"]}
    assert found["lines"]["SocWarm"] == [
        FUEL.tolist(),
        curve().values.tolist(),
        "mg",
        "°CA aTDC",
        "start of combustion",
    ]
    cells, *rest = found["maps"]["SocBase"]
    assert rest == ["rpm", "mg", "°CA aTDC", "speed_rpm", "fuel_mg", 3, 5]
    grid = [[m, n, best.values[i, j]] for j, m in enumerate(FUEL) for i, n in enumerate(SPEED)]
    assert cells == grid
    back = read_dcm(two)
    assert back.maps["SocBase"] == read_dcm(one).maps["SocBase"]
    assert back.maps["SocWarm"] == read_dcm(one).maps["SocWarm"]
    assert back.values == {"N_Idle": (850.5, "rpm")}


# --- damage -------------------------------------------------------------------------------------------------
def text_of(tmp_path: Path) -> str:
    write_map(whole(curve()), tmp_path / "good.dcm")
    return (tmp_path / "good.dcm").read_text(encoding="utf-8")


def edited(old: str, new: str) -> Callable[[str], str]:
    def edit(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return edit


def without(*words: str) -> Callable[[str], str]:
    return lambda text: "\n".join(line for line in text.splitlines() if not line.strip().startswith(words)) + "\n"


DAMAGE = [
    (lambda text: text[: text.index("END")], "has no END: the file was cut off"),
    (edited("KONSERVIERUNG_FORMAT 2.0", "KONSERVIERUNG_FORMAT 1.0"), "only 2.0 is read"),
    (edited("KONSERVIERUNG_FORMAT 2.0", "FORMAT 2.0"), "begins with KONSERVIERUNG_FORMAT"),
    (edited("KENNLINIE soc_cad 5", "KENNLINIE soc_cad 6"), "has 5 ST/X: its head states 6"),
    (edited("   25.0", ""), "has 4 ST/X: its head states 5"),
    (edited("WERT          -1.0", "WERT          "), "has 4 values: its head states 5"),
    (without("ST/X"), "has 0 ST/X: its head states 5"),
    (edited("10.0", "6.0"), r"soc_cad: fuel_mg\[1\] = 6: must be above"),
    (edited('EINHEIT_X     "mg"', 'EINHEIT_X     "kg"'), "unit of fuel_mg = 'kg': must be 'mg'"),
    (edited("10.0", "1O.0"), "line 9: '1O.0' is not a number"),
    (edited("KENNLINIE", "KENNLINE"), "did you mean 'KENNLINIE'"),
    (edited("WERT", "VALUE"), "'VALUE' inside of KENNLINIE soc_cad"),
    (lambda text: text + text[text.index("KENNLINIE") :], "stands in the file twice"),
    (lambda _: "", "the file is empty"),
]  # fmt: skip


@pytest.mark.parametrize(("damage", "said"), DAMAGE, ids=[said[:28] for _, said in DAMAGE])
def test_a_damaged_file_is_named_and_the_whole_one_still_reads(
    damage: Callable[[str], str], said: str, tmp_path: Path
) -> None:
    good = text_of(tmp_path)
    file = tmp_path / "map.dcm"
    file.write_text(damage(good), encoding="utf-8")
    with pytest.raises(DataError, match=said) as raised:
        read_map(file)
    assert str(raised.value).startswith(str(file))
    file.write_text(good, encoding="utf-8")
    assert read_map(file).name == "soc_cad"


@settings(max_examples=225, deadline=None)
@given(data=st.data())
def test_a_file_cut_anywhere_is_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("cut")
    file = folder / f"map.{data.draw(st.sampled_from(['dcm', 'nc', 'cdfx']))}"
    write_map(whole(curve()), file)
    raw = file.read_bytes().rstrip()
    file.write_bytes(raw[: data.draw(st.integers(0, len(raw) - 1))])
    with pytest.raises(Error):
        read_map(file)


@pytest.mark.parametrize("ending", ["nc", "csv"])
def test_a_netcdf_or_text_that_is_none(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"map.{ending}"
    file.write_bytes(b"\x00\x01 nothing")
    with pytest.raises(DataError, match=file.name):
        read_map(file)


@pytest.mark.parametrize("ending", ["csv", "dcm", "nc"])
def test_a_write_that_fails_leaves_the_old_file(ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / f"map.{ending}"
    write_map(whole(curve()), file)
    before = file.read_bytes()

    def fails(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fails)
    with pytest.raises(OSError, match="No space"):
        write_map(whole(curve()).replaced(curve().values + 1.0), file)
    assert file.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == [file.name]


def test_what_cannot_be_written_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"1 cells have no value.*smooth the map with fill=True"):
        write_map(timing_table(), tmp_path / "map.dcm")
    quoted = CalibrationMap({"fuel_mg": FUEL}, 1.0, name="z", labels={"z": ("-", 'the "z"')})
    with pytest.raises(DataError, match="no quotes"):
        write_map(quoted, tmp_path / "map.dcm")
    with pytest.raises(DataError, match="twice"):
        write_map([curve(), curve()], tmp_path / "map.dcm")
    with pytest.raises(DataError, match="value idle = nan"):
        write_map([], tmp_path / "map.dcm", values={"idle": (np.nan, "rpm")})
    with pytest.raises(ParameterError, match=r"map\.xls: a map is written to and read from \.nc"):
        write_map(curve(), tmp_path / "map.xls")
    for several in ({"table": [curve(), curve()]}, {"table": curve(), "values": {"idle": (850.0, "rpm")}}):
        with pytest.raises(ParameterError, match=r"holds one map; several, and single values, go into a \.dcm file"):
            write_map(**several, path=tmp_path / "map.csv")
    with pytest.raises(FileNotFoundError):
        read_map(tmp_path / "map.csv")
    assert list(tmp_path.iterdir()) == []


def test_the_writer_of_whole_files(tmp_path: Path) -> None:
    link, real = tmp_path / "link.txt", tmp_path / "real.txt"
    real.write_text("old")
    link.symlink_to(real)
    write_whole(link, lambda path: path.write_text("new"))
    assert link.is_symlink()
    assert real.read_text() == "new"
    with pytest.raises(RuntimeError):
        write_whole(real, lambda path: (path.write_text("half"), (_ for _ in ()).throw(RuntimeError("no")))[1])
    assert real.read_text() == "new"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["link.txt", "real.txt"]
    write_whole("/dev/null", lambda path: path.write_text("gone"))


def test_a_smoothed_map_travels_too(tmp_path: Path) -> None:
    pytest.importorskip("clarabel", reason="clarabel is not installed: pip install 'mgdd[maps]'")
    with pytest.warns(UserWarning, match="extrapolated 3 cells"):
        found = smooth_map(optimised(), slope_limits={"fuel_mg": 0.9}, fill=True)
    write_map(found, tmp_path / "map.nc")
    assert read_map(tmp_path / "map.nc") == found
    write_map(found, tmp_path / "map.dcm")
    np.testing.assert_array_equal(read_map(tmp_path / "map.dcm").values, found.values)
