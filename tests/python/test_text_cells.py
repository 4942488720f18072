"""Cells of a text or a sheet that are empty, units that are none, and rows that are cycles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli.main import main
from mgdd.errors import DataError
from mgdd.io import pressure_chunks, read, read_pressure, read_throttle_log
from mgdd.io.any_table import read_any_table
from mgdd.io.column_names import heading
from mgdd.io.row_text import Rows
from mgdd.io.table import text_table
from mgdd.maps import read_map

ANGLE = np.arange(-180.0, 181.0)
BAR = 1.0 + 50.0 * np.exp(-((ANGLE / 30.0) ** 2))
TIME = np.arange(1500) * 2e-3
DUTY, TRAVEL = 0.2 * np.sin(6.0 * TIME), 30.0 + 15.0 * np.sin(6.0 * TIME - 0.5)


def log_text(mark: str, units: str, end: str = "") -> str:
    rows = (mark.join((f"{t:.3f}", f"{u:.5f}", f"{y:.5f}", "0")) for t, u, y in zip(TIME, DUTY, TRAVEL, strict=True))
    return "\n".join((mark.join(("t", "duty", "tps", "fan")), units, *(row + end for row in rows))) + "\n"


@pytest.mark.parametrize(
    ("mark", "units"),
    [
        ("\t", "s\t-\t%\t"),
        ("\t", "s\t-\t%"),
        ("\t", "\t\t%\t"),
        (";", "s;-;%;"),
        (";", "s;-;%"),
        (",", "s,-,%,"),
    ],
)
def test_an_empty_unit_leaves_the_others_where_they_are(mark: str, units: str, tmp_path: Path) -> None:
    (tmp_path / "log.msl").write_text(log_text(mark, units))
    log = read_throttle_log(tmp_path / "log.msl", time="t", duty="duty", angle="tps")
    np.testing.assert_allclose(log["angle_deg"], 0.9 * TRAVEL, atol=1e-4)


def test_units_that_blanks_do_not_place_are_refused(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text(log_text(" ", "s - %"))
    with pytest.raises(DataError, match="line 2: 3 units below 4 names, and blanks do not tell which column has none"):
        read_throttle_log(tmp_path / "log.txt", time="t", duty="duty", angle="tps")


@pytest.mark.parametrize(
    ("text", "header", "rows"),
    [
        ("a\tb\tc\n1\t2\t\n3\t4\t\n", ("a", "b", "c"), ["1\t2\t", "3\t4\t"]),  # a column with a name stays
        ("a\tb\n1\t2\t\n3\t4\t\n", ("a", "b"), ["1\t2", "3\t4"]),
        ("\ta\tb\n\t1\t5\n\t3\t4\n", ("a", "b"), ["1\t5", "3\t4"]),
        ("a\tb\tc\n\t1\t5\n\t3\t4\n", ("a", "b", "c"), ["\t1\t5", "\t3\t4"]),
        ("a,b\r\n1,2\r# no row\r\n\r\n  \n3,4", ("a", "b"), ["1,2", "3,4"]),
    ],
)
def test_empty_columns_at_the_ends(text: str, header: tuple[str, ...], rows: list[str]) -> None:
    table = text_table("t", text)
    assert (table.header, [row for _, row in table.rows]) == (header, rows)


def test_a_shifted_cell_is_no_other_column() -> None:
    table = text_table("t", "a\tb\tc\n1\t2\t3\n\t5\t6\n7\t8\t\n")
    assert table.numbers(1).tolist() == [2.0, 5.0, 8.0]
    with pytest.raises(DataError, match="line 3, column 'a': the cell is empty"):
        table.numbers(0)
    with pytest.raises(DataError, match="line 4, column 'c': the cell is empty"):
        table.numbers(2)


def test_numbers_of_a_text_are_those_of_python() -> None:
    rng = np.random.default_rng(5)
    bits = rng.integers(0, 2**63, 4000, dtype=np.int64).view(np.float64)
    values = [*bits[np.isfinite(bits)].tolist(), 5e-324, 1.7976931348623157e308, -0.0, 0.1, 1e23, 9007199254740993.0]
    written = [form.format(value) for form in ("{!r}", "{:.17g}", "{:+.6E}", '"{!r}"', " {:.3f} ") for value in values]
    table = text_table("t", "v;w\n" + "".join(f"{text};1\n" for text in written))
    expected = np.array([float(text.strip().strip('"')) for text in written])
    np.testing.assert_array_equal(table.numbers(0), expected)
    comma = text_table("t", "v;w\n" + "".join(f"{text.replace('.', ',')};1\n" for text in written), decimal=",")
    np.testing.assert_array_equal(comma.numbers(0), expected)
    for odd in ("1_000", "0x1p3", "1e999", "nan", "inf", "1,5", "--1", "+-1", "1 2", "", ".", "e5", "1e", "\u2153"):
        values, plain = Rows.of(f"{odd};1").numbers([0, 1], ";", ".")
        assert (plain.tolist(), values[1].tolist()) == ([False, True], [1.0]), odd


@pytest.mark.parametrize("letter", "ABCKLGJ")
def test_a_letter_above_a_row_of_units_is_a_name(letter: str, tmp_path: Path) -> None:
    rows = "\n".join(f"{a:g},{p:.6f}" for a, p in zip(ANGLE, BAR, strict=True))
    kilo = "\n".join(f"{a:g},{100 * p:.6f}" for a, p in zip(ANGLE, BAR, strict=True))
    (tmp_path / "scope.csv").write_text(f"Angle,Channel {letter}\n(deg),(kPa)\n\n{kilo}\n")
    np.testing.assert_allclose(read_pressure(tmp_path / "scope.csv")["pressure_bar"], BAR, atol=1e-6)
    (tmp_path / "scope.csv").write_text(f"Angle [deg],Signal {letter}\n{rows}\n")  # no units below: who reads it knows
    found = read_pressure(tmp_path / "scope.csv", pressure_column=1, pressure_unit="bar")
    np.testing.assert_allclose(found["pressure_bar"], BAR, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "row", "unit", "gauge"),
    [
        ("p [bar(a)]", None, "bar", False),
        ("p", "bar(a)", "bar", False),
        ("p", "[bar (abs)]", "bar", False),
        ("p (kPa(g))", None, "kPa", True),
        ("p_cyl [mbar abs]", None, "mbar", False),
        ("p", "(psi(g))", "psi", True),
        ("p [barg]", None, "bar", True),
        ("p_a", None, None, False),
        ("p [Pa]", None, "Pa", False),
    ],
)
def test_what_a_pressure_is_above(name: str, row: str | None, unit: str | None, gauge: bool) -> None:
    units = None if row is None else text_table("t", f"{name};x\n{row};-\n1;2\n").unit(0)
    found = heading(name, units)
    assert (found.unit, found.gauge, found.strange) == (unit, gauge, None)


# --- workbooks ---------------------------------------------------------------------------------------------------
def book(file: Path, sheets: dict[str, list[list[Any]]]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    made = openpyxl.Workbook()
    made.remove(made.active)
    for title, rows in sheets.items():
        own = made.create_sheet(title)
        for row in rows:
            own.append(row)
    made.save(file)
    return file


def test_a_side_block_of_a_sheet_is_left_out_and_said(tmp_path: Path) -> None:
    side = [["Engine"], ["bore_mm", 95.8], ["cr", 14.6]]
    rows = [["TEST 7"], ["angle", "pcyl", "inj"], ["deg", "kPa", "-"]]
    rows += [[a, 100.0 * p, 0.0] for a, p in zip(ANGLE.tolist(), BAR.tolist(), strict=True)]
    for gap in ([None, None], []):
        wide = [
            [*row, *[None] * (3 - len(row)), *gap, *side[k - 1]] if 1 <= k < 4 else row for k, row in enumerate(rows)
        ]
        file = book(tmp_path / "side.xlsx", {"Data": wide})
        with pytest.warns(UserWarning, match=r"sheet 'Data': column\(s\) \w, \w left out: less than half as long"):
            found = read_pressure(file, pressure_column="pcyl")
        np.testing.assert_allclose(found["pressure_bar"], BAR, rtol=1e-12)


def test_a_sheet_may_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def cycle(factor: float) -> list[list[Any]]:
        return [["angle", "p [bar]"], *zip(ANGLE.tolist(), (factor * BAR).tolist(), strict=True)]

    grid = [["rpm\\mg", 10, 20], [1000, 1.0, 2.0], [2000, 3.0, 4.0]]
    file = book(tmp_path / "b.xlsx", {"first": cycle(1.0), "second": cycle(2.0), "map": grid})
    assert float(read_pressure(file, sheet="second")["pressure_bar"].max()) == 2.0 * BAR.max()
    assert float(read(file, sheet="second")["pressure_bar"].max()) == 2.0 * BAR.max()
    (chunk,) = pressure_chunks(file, sheet="second")
    assert float(chunk["pressure_bar"].max()) == 2.0 * BAR.max()
    assert read_map(file, sheet="map").values.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    with pytest.raises(DataError, match="sheet='seconds': no such sheet: did you mean 'second'"):
        read_pressure(file, sheet="seconds")
    (tmp_path / "t.csv").write_text("angle,p\n" + "\n".join(f"{a},{p}" for a, p in zip(ANGLE, BAR, strict=True)))
    for reader in (read_pressure, read, read_map):
        with pytest.raises(DataError, match="no workbook: leave sheet out"):
            reader(tmp_path / "t.csv", sheet="first")
    assert main(["engine", "check", str(file), "--sheet", "second"]) in (0, 1)
    assert "--sheet" not in capsys.readouterr().err


# --- a cycle per row -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("names", [None, ("crank angle", "a", "b", "c"), ("cycle", "1", "2", "3")])
@pytest.mark.parametrize("as_sheet", [False, True])
def test_a_row_per_cycle(names: tuple[str, ...] | None, as_sheet: bool, tmp_path: Path) -> None:
    cycles = BAR * np.array([[1.0], [1.1], [0.9]])
    rows = [[*([names[k]] if names else []), *row.tolist()] for k, row in enumerate((ANGLE, *cycles))]
    if as_sheet:
        file = book(tmp_path / "rows.xlsx", {"a": rows})
    else:
        file = tmp_path / "rows.csv"
        file.write_text("\n".join(";".join(map(str, row)) for row in rows))
    for reader in (read_pressure, read):
        with pytest.raises(DataError, match="if each row is a cycle, pass cycle_per_row=True"):
            reader(file)
        np.testing.assert_allclose(reader(file, cycle_per_row=True)["pressure_bar"], cycles, rtol=1e-14)
    (chunk,) = pressure_chunks(file, cycle_per_row=True)
    np.testing.assert_allclose(chunk["pressure_bar"], cycles, rtol=1e-14)


def test_a_row_per_cycle_without_angles(tmp_path: Path) -> None:
    cycles = BAR * np.array([[1.0], [1.1]])
    (tmp_path / "rows.csv").write_text("\n".join(",".join(map(str, row)) for row in cycles.tolist()))
    found = read_pressure(tmp_path / "rows.csv", cycle_per_row=True, angle_step_deg=1.0, angle_start_deg=-180.0)
    np.testing.assert_array_equal(found["pressure_bar"], cycles)
    np.save(tmp_path / "rows.npy", cycles)
    with pytest.raises(DataError, match="a matrix is turned as it needs to be: leave cycle_per_row out"):
        read_any_table(tmp_path / "rows.npy", cycle_per_row=True)
