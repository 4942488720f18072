"""Maps of other hands: grids of spreadsheets, tables of points, and what is neither."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import AXES, FUEL, SPEED, VALUES, read, timing_table
from mgdd.errors import DataError, ParameterError
from mgdd.maps import CalibrationMap, read_map, smooth_map, write_map

DATA = Path(__file__).parents[2] / "data"


def grid(corner: str, mark: str = ";", decimal: str = ".", above: str = "", values: np.ndarray = VALUES) -> str:
    """A grid with the speed down and the fuel across."""

    def said(number: float) -> str:
        return "" if np.isnan(number) else f"{number:g}".replace(".", decimal)

    rows = [[corner, *map(said, FUEL)], *([said(n), *map(said, row)] for n, row in zip(SPEED, values, strict=True))]
    return above + "".join(mark.join(row) + "\n" for row in rows)


# --- grids --------------------------------------------------------------------------------------------------
CORNERS = [
    (r"rpm\mg", {}, ("rpm", "rpm"), ("mg", "mg")),
    (r"rpm\\mg", {}, ("rpm", "rpm"), ("mg", "mg")),
    (r"speed [rpm] \ fuel [mg]", {}, ("speed", "rpm"), ("fuel", "mg")),
    ("x: mg y: rpm", {}, ("rpm", "rpm"), ("mg", "mg")),
    ("y = Drehzahl (1/min), x = Menge (mg)", {}, ("Drehzahl", "rpm"), ("Menge", "mg")),
    ("rpm v / mg >", {}, ("rpm", "rpm"), ("mg", "mg")),
    ("mg > / rpm v", {}, ("rpm", "rpm"), ("mg", "mg")),
    ("mg → Drehzahl [1/min] ↓", {}, ("Drehzahl", "rpm"), ("mg", "mg")),
    ("n/m", {"rows": "n"}, ("n", "not given"), ("m", "not given")),
    ("n/M", {"columns": "M"}, ("n", "not given"), ("M", "not given")),
    ("n/M", {"rows": "speed_rpm", "columns": "fuel_mg"}, ("speed_rpm", "rpm"), ("fuel_mg", "mg")),
    ("n/M", {"columns": "n"}, ("M", "not given"), ("n", "not given")),  # the words say so, whatever stands below
    ("fuel [mg] / speed [rpm]", {"rows": "speed"}, ("speed", "rpm"), ("fuel", "mg")),
    ("fuel [mg] / speed [rpm]", {"columns": "fuel_mg"}, ("speed", "rpm"), ("fuel_mg", "mg")),
    ("fuel [mg] / speed [rpm]", {"rows": "speed_rpm"}, ("speed_rpm", "rpm"), ("fuel", "mg")),
    ("n [1/min] / m [mg/Hub]", {"rows": "n"}, ("n", "rpm"), ("m", "mg/Hub")),
    ("", {"rows": "speed_rpm", "columns": "fuel_mg"}, ("speed_rpm", "rpm"), ("fuel_mg", "mg")),
]  # fmt: skip


@pytest.mark.parametrize(("corner", "options", "down", "across"), CORNERS)
def test_the_corner_names_the_axes(
    corner: str, options: dict[str, str], down: Any, across: Any, tmp_path: Path
) -> None:
    found = read(grid(corner), tmp_path, **options)
    assert [(name, found.labels[name].units) for name in found.axes] == [down, across]
    first, second = found.axes.values()
    np.testing.assert_array_equal(first, SPEED)
    np.testing.assert_array_equal(second, FUEL)
    np.testing.assert_array_equal(found.values, VALUES)
    assert set(found.cells["source"].ravel()) == {"given"}


@pytest.mark.parametrize(
    ("corner", "options", "said"),
    [
        (
            "n/M",
            {},
            "line 1: the corner names 'n' and 'M' and not which axis runs down: pass rows='n' if n runs down, or",
        ),
        ("speed [rpm] / fuel [mg]", {}, r"pass rows='speed \[rpm\]' if speed \[rpm\] runs down"),
        ("speed [rpm]", {}, "names one axis, and not whether it runs down or across"),
        ("speed [rpm] / fuel [mg]", {"rows": "load_percent"}, "not which axis runs down"),
        (r"rpm\mg", {"rows": "fuel_mg"}, "states that rpm runs down and mg across: correct it, or leave rows and"),
        (r"speed_rpm [1/s]\mg", {}, "unit of speed_rpm = '1/s': must be 'rpm'"),
    ],
)
def test_an_open_corner_is_refused_with_the_choice(
    corner: str, options: dict[str, str], said: str, tmp_path: Path
) -> None:
    with pytest.raises(DataError, match=said) as raised:
        read(grid(corner), tmp_path, **options)
    assert str(raised.value).startswith(str(tmp_path / "map.txt"))


def test_two_axes_of_one_label_have_two_names(tmp_path: Path) -> None:
    found = read(grid(r"q\q"), tmp_path)
    assert [(name, found.labels[name].long_name) for name in found.axes] == [("q", "q"), ("x", "q")]


def test_axes_without_a_name_are_doubted_aloud(tmp_path: Path) -> None:
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        found = read(grid(""), tmp_path)
    assert list(found.axes) == ["y", "x"]
    assert [str(doubt.message).partition("; ")[2] for doubt in doubts] == [
        "name it with rows='speed_rpm'", "name it with columns='fuel_mg'",
    ]  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(
    mark=st.sampled_from([";", "\t", ","]),
    decimal=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]),
    above=st.sampled_from(["", "Öldruck [bar]\n", "\n\nÖldruck [bar]\n\n", "# bench 7\nÖldruck\nEinheit: {m} bar\n"]),
    end=st.sampled_from(["\n", "\r\n"]),
    padding=st.integers(0, 2),
)
def test_a_spreadsheet_writes_the_same_map_in_many_ways(
    mark: str, decimal: str, encoding: str, above: str, end: str, padding: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:  # fmt: skip
    mark = ";" if mark == decimal else mark
    text = grid(r"Drehzahl [1/min]\mg", mark, decimal, above.replace("{m} ", mark)).replace("\n", mark * padding + end)
    found = read(text.encode(encoding), tmp_path_factory.mktemp("grid"), decimal=decimal)
    assert list(found.axes) == ["Drehzahl", "mg"]
    np.testing.assert_array_equal(found.values, VALUES)
    titled = (found.name, found.unit, found.labels[found.name].long_name)
    assert titled == (("Oeldruck", "bar", "Öldruck") if above else ("value", "not given", "value"))


def test_title_units_and_remarks_of_a_grid(tmp_path: Path) -> None:
    above = "Engine;B7;;;;\nBSFC [g/kWh];;;;;\n;fuel [mg];;;;\n"
    found = read(grid("speed [1/min]", above=above), tmp_path)
    assert list(found.axes) == ["speed", "fuel"]
    assert (found.name, found.unit, found.provenance["remarks"]) == ("BSFC", "g/kWh", "Engine B7")
    text = grid(r"n\m").replace("\n", "\n[1/min];mm;mm;mm;mm;mm\n", 1)
    below = read(text, tmp_path, name="lift_mm")
    assert [below.labels[name].units for name in ("lift_mm", "n", "m")] == ["mm", "rpm", "not given"]
    with pytest.raises(DataError, match="line 2: unit 'mm' of lift_s: its name or label gives 's'"):
        read(text, tmp_path, name="lift_s")
    with pytest.raises(DataError, match="line 2: units 'cm', 'mm': the values have one"):
        read(text.replace("mm", "cm", 1), tmp_path)
    arrows = read(grid("speed [1/min] v", above=above.replace("fuel [mg]", "fuel [mg] >")), tmp_path)
    assert arrows.labels == found.labels


def test_empty_cells_are_named_and_can_be_filled(tmp_path: Path) -> None:
    pytest.importorskip("clarabel", reason="clarabel is not installed: pip install 'mgdd[maps]'")
    plane = 10.0 + 1e-3 * SPEED[:, None] + 0.25 * FUEL
    holed = plane.copy()
    holed[1, 2] = holed[1, 3] = np.nan
    found = read(grid(r"rpm\mg", values=holed), tmp_path)
    assert found.cells["source"][1].tolist() == ["given", "given", "unattainable", "unattainable", "given"]
    filled = smooth_map(found, fill=True, tolerance=0)
    np.testing.assert_allclose(filled.values, plane, atol=1e-4)


def test_the_last_row_of_a_grid_may_not_be_cut_off(tmp_path: Path) -> None:
    whole = grid(r"rpm\mg")
    *rows, last = whole.rstrip("\n").split("\n")
    breakpoint_alone = last.partition(";")[0]
    for cut in (breakpoint_alone, f"{breakpoint_alone};"):
        with pytest.raises(DataError, match=f"line {len(rows) + 1}: .* may be cut off here"):
            read("\n".join([*rows, cut]), tmp_path)
    empty = read("\n".join([*rows, breakpoint_alone + ";" * len(FUEL)]), tmp_path)
    assert set(empty.cells["source"][-1]) == {"unattainable"}


@pytest.mark.parametrize("axis", ["n", "s", "m", "N", "load_a", "row_k", "pos_l"])
def test_a_letter_that_ends_a_name_is_no_unit(axis: str, tmp_path: Path) -> None:
    made = read(f"{axis};load;val\n" + "".join(f"{i};{j};{i + j}\n" for i in (1, 2) for j in (1, 2)), tmp_path)
    assert made.axes.keys() == {axis, "load"}
    assert made.labels[axis].units == "not given"
    given = CalibrationMap({axis: [1.0, 2.0]}, [3.0, 4.0], name="gain", labels={axis: ("-", "of its own")})
    assert given.labels[axis].units == "-"
    assert CalibrationMap({"coil_current_a": [1.0, 2.0]}, [3.0, 4.0], name="gain").labels["coil_current_a"].units == "A"


BAD = [
    (grid(r"rpm\mg").replace("14", "10"), "line 1: mg = 10 after 10: breakpoints must increase and stand once"),
    (grid(r"rpm\mg").replace("3000;", "1000;"), "line 4: rpm = 1000 after 1400"),
    (grid(r"rpm\mg").replace("1400;", ";"), "line 3: the breakpoint of rpm is empty"),
    (grid(r"rpm\mg").replace(";14;", ";nan;"), "line 1, cell 4: the breakpoint of mg is empty"),
    (grid(r"rpm\mg").replace("1400;", "inf;"), "line 3: 'inf' is not a breakpoint of rpm"),
    (grid(r"rpm\mg").replace("3000;", "3,000;"), "'3,000' .*',' looks like a separator of thousands: remove it, or"),
    (grid(r"rpm\mg").replace("3000;", "3'000;"), '"3\'000" is not a finite number for rpm: "\'" looks like a'),
    (grid(r"rpm\mg").replace("5.25", "5,25"), "line 3: '5,25' .* pass decimal=',' if the comma is a decimal mark"),
    (grid(r"rpm\mg").replace("5.25", "5.25;7"), "line 3: 6 values: 5 are needed"),
    (grid(r"rpm\mg").replace(";5.25", ""), "line 3: 4 values: 5 are needed"),
    (grid(r"rpm\mg").replace("5.25", "#DIV/0!"), "line 3: '#DIV/0!' is not a finite number for a value"),
    (grid(r"rpm\mg") + "measured by hand\n", "line 5: 'measured by hand' is not a breakpoint of rpm"),
    (grid(r"rpm\mg")[: grid(r"rpm\mg").index("1400")], "rpm has one breakpoint: a map needs two along each axis"),
    ("rpm\\mg;10\n900;1\n1400;2\n", "'10' stands where a column has its name"),
    (grid("0"), "the columns have no names"),
    ("", "the file is empty"),
    (b"\0" * 40, "binary file|cannot be read"),
    ("just words\nand more of them\n", "no numeric rows"),
    ("<html><body/></html>", "begins with <html>"),
    ("speed_rpm,fuel_mg,x\n900,6,1\n900,10,2\n1400,6,3\n", "no point at speed_rpm = 1400, fuel_mg = 10: 1 of 4 cells"),
    ("speed_rpm,fuel_mg,x\n900,6,1\n,10,2\n1400,6,3\n", "line 3: the breakpoint of 'speed_rpm' is empty"),
    ("a,b,c,d\n900,6,1,0\n900,10,2,0\n", "4 columns with numbers .* choose one with rows='…', columns='…', name='…'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), BAD, ids=[said[:30] for _, said in BAD])
def test_what_is_no_map_is_refused_with_place_and_remedy(text: str | bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=said) as raised:
        read(text, tmp_path)
    assert str(raised.value).startswith(str(tmp_path))


def test_a_folder_and_arguments_that_do_not_act(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="this is a folder"):
        read_map(tmp_path)
    write_map(timing_table(), tmp_path / "map.nc")
    with pytest.raises(ParameterError, match="names its axes itself: leave rows out"):
        read_map(tmp_path / "map.nc", rows="speed_rpm")
    with pytest.raises(DataError, match="no column 'speed' for rows: did you mean 'speed_rpm'"):
        read("speed_rpm,fuel_mg,x\n900,6,1\n900,10,2\n", tmp_path, rows="speed")


# --- tables of points ---------------------------------------------------------------------------------------
POINTS = {"speed_rpm": np.repeat(SPEED, 5), "fuel_mg": np.tile(FUEL, 3), "soc_cad": VALUES.ravel()}


def as_csv(file: Path, columns: dict[str, np.ndarray]) -> None:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    file.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]))


def as_xlsx(file: Path, columns: dict[str, np.ndarray]) -> None:
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed: pip install 'mgdd[formats]'")
    book = openpyxl.Workbook()
    for row in [list(columns), *zip(*(column.tolist() for column in columns.values()), strict=True)]:
        book.active.append(list(row))
    book.save(file)


def as_parquet(file: Path, columns: dict[str, np.ndarray]) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed: pip install 'mgdd[parquet]'")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: pip install 'mgdd[parquet]'")
    parquet.write_table(pyarrow.table(columns), file)


def as_hdf5(file: Path, columns: dict[str, np.ndarray]) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: pip install 'mgdd[formats]'")
    with h5py.File(file, "w", track_order=True) as content:
        for name, column in columns.items():
            content[name] = column


def as_mat(file: Path, columns: dict[str, np.ndarray]) -> None:
    from scipy.io import savemat

    savemat(file, columns)


def as_npz(file: Path, columns: dict[str, np.ndarray]) -> None:
    with file.open("wb") as stream:
        np.savez(stream, **columns)


NAMED = {"rows": "speed_rpm", "columns": "fuel_mg", "name": "soc_cad"}


@pytest.mark.parametrize("write", [as_csv, as_xlsx, as_parquet, as_hdf5, as_mat, as_npz])
def test_points_of_any_format_make_the_map(
    write: Callable[[Path, dict[str, np.ndarray]], None], tmp_path: Path
) -> None:
    order = np.random.default_rng(2).permutation(15)
    write(tmp_path / "points.bin", {name: column[order] for name, column in POINTS.items()})
    found = read_map(tmp_path / "points.bin", **NAMED)
    assert list(found.axes) == ["speed_rpm", "fuel_mg"]
    np.testing.assert_array_equal(found.values, VALUES)
    assert (found.cells["support"] == 1.0).all()
    assert (found.unit, found.provenance) == ("°CA aTDC", {})


@pytest.mark.parametrize("write", [as_mat, as_npz, as_hdf5])
def test_vectors_and_a_matrix_make_the_map(
    write: Callable[[Path, dict[str, np.ndarray]], None], tmp_path: Path
) -> None:
    write(tmp_path / "map.bin", {"speed_rpm": SPEED, "fuel_mg": FUEL, "soc_cad": VALUES})
    assert read_map(tmp_path / "map.bin") == CalibrationMap(AXES, VALUES, name="soc_cad")
    square = {"a": SPEED, "b": FUEL[:3], "soc_cad": VALUES[:, :3]}
    write(tmp_path / "map.bin", square)
    with pytest.raises(DataError, match="soc_cad is 3 x 3, and of length 3 are a, b: name the axis with rows='…'"):
        read_map(tmp_path / "map.bin")


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_the_order_of_the_points_does_not_matter(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Nor which of them are repeated: the mean does not depend on it, to the last bit."""
    file = tmp_path_factory.mktemp("points") / "points.csv"
    again = data.draw(st.lists(st.integers(0, 14), max_size=6))
    rows = [*range(15), *again]
    extra = np.array(data.draw(st.lists(st.floats(-1e3, 1e3), min_size=len(again), max_size=len(again))))
    columns = {name: column[rows] for name, column in POINTS.items()}
    columns["soc_cad"] = np.concatenate([VALUES.ravel(), extra])
    as_csv(file, columns)
    straight = read_map(file)
    order = data.draw(st.permutations(range(len(rows))))
    as_csv(file, {name: column[list(order)] for name, column in columns.items()})
    turned = read_map(file)
    assert turned == straight
    for cell in range(15):
        own = columns["soc_cad"][np.array(rows) == cell]
        assert turned.values.ravel()[cell] == pytest.approx(own.mean(), rel=1e-12, abs=1e-9)
        assert turned.cells["support"].ravel()[cell] == own.size
    assert ("repeated" in turned.provenance) == bool(again)


def test_a_point_without_a_value_is_a_cell_to_fill(tmp_path: Path) -> None:
    text = "speed [1/min];fuel [mg];soc [°KW]\n900;6;1\n900;10;\n1400;6;3\n1400;10;4\n"
    found = read(text, tmp_path)
    assert found.cells["source"].tolist() == [["given", "unattainable"], ["given", "given"]]
    assert [found.labels[name].units for name in ("speed", "fuel", "soc")] == ["rpm", "mg", "°CA"]
    scattered = "n,m,x\n" + "".join(f"{900 + 0.1 * k},{6 + 0.01 * k},{k}\n" for k in range(80))
    with pytest.raises(DataError, match=r"80 points with 80 values of n x 80 values of .* are no grid: fit them"):
        read(scattered.replace("m", "q_mg", 1), tmp_path)


def test_a_list_of_points_in_netcdf(tmp_path: Path) -> None:
    import xarray as xr

    from mgdd.io.binary_files import write_netcdf

    units = dict(zip(POINTS, ("rpm", "mg", "degree"), strict=True))
    columns = {name: ("point", column, {"units": units[name], "long_name": name}) for name, column in POINTS.items()}
    write_netcdf(xr.Dataset(columns), tmp_path / "points.nc")
    np.testing.assert_array_equal(read_map(tmp_path / "points.nc", **NAMED).values, VALUES)


def test_a_grid_on_a_sheet(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed: pip install 'mgdd[formats]'")
    book = openpyxl.Workbook()
    for row in [["BSFC [g/kWh]"], [r"rpm\mg", *FUEL], *([n, *v] for n, v in zip(SPEED, VALUES.tolist(), strict=True))]:
        book.active.append(list(row))
    book.active["C4"] = None
    book.save(tmp_path / "map.xlsx")
    found = read_map(tmp_path / "map.xlsx")
    assert (found.name, found.unit, list(found.axes)) == ("BSFC", "g/kWh", ["rpm", "mg"])
    assert np.flatnonzero(np.isnan(found.values)).tolist() == [6]
    whole = (tmp_path / "map.xlsx").read_bytes()
    with pytest.raises(DataError, match="cut off or damaged"):
        read(whole[:1500], tmp_path, "cut.xlsx")


@pytest.mark.parametrize("ending", ["csv", "nc", "dcm", "cdfx"])
def test_the_content_says_the_form_and_not_the_name(ending: str, tmp_path: Path) -> None:
    table = CalibrationMap(AXES, VALUES, name="soc_cad")
    write_map(table, tmp_path / f"map.{ending}")
    raw = (tmp_path / f"map.{ending}").read_bytes()
    for name in ("map", "map.txt", "map.csv", "map.CSV"):
        assert read(raw, tmp_path, name) == table
    if ending in ("csv", "dcm"):  # as a spreadsheet or an editor saves it
        for encoding in ("utf-16", "utf-8-sig", "cp1252"):
            assert read(raw.decode().encode(encoding), tmp_path, "map.txt") == table
