"""Files of every format, written by its own library, read back equal; text with what stands above the rows."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.errors import DataError, ParameterError
from mgdd.io import read_pressure, read_throttle_log
from mgdd.io.any_table import read_any_table
from mgdd.io.array_table import ArrayTable, Named, Samples, columns_of
from table_files import WITHOUT_UNITS, WRITERS

# asammdf closes twice what it could not open.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
ANGLE = np.arange(-180.0, 180.0, 0.5)
CYCLES = np.array([40.0 + 0.1 * k + (20.0 + k) * np.exp(-(((ANGLE - 8.0) / 30.0) ** 2)) for k in range(3)])
TIME = np.arange(0.0, 2.0, 0.001)
LOG = {"time_s": TIME, "duty": 0.1 + 0.05 * np.sin(9.0 * TIME), "angle_deg": 20.0 + 3.0 * np.cos(9.0 * TIME)}


@pytest.fixture(scope="module", autouse=True)
def nothing_is_left_for_other_tests() -> Iterator[None]:
    yield
    gc.collect()  # files that asammdf could not open, whose warnings are ignored here alone


@pytest.mark.parametrize("form", WRITERS)
def test_cycles_of_a_pressure_read_back_equal(form: str, tmp_path: Path) -> None:
    file = tmp_path / "last_night"  # without an ending: by content alone
    WRITERS[form](file, {"angle": ANGLE, "pcyl": 1e5 * CYCLES.T}, {"angle": "deg", "pcyl": "Pa"})
    unit = "Pa" if form in WITHOUT_UNITS else None
    trace = read_pressure(
        file, angle_column="angle", pressure_unit=unit, pressure_column=[f"pcyl {k}" for k in (1, 2, 3)]
    )
    np.testing.assert_allclose(trace["pressure_bar"], CYCLES, rtol=1e-12)
    np.testing.assert_allclose(trace["crank_angle_cad"], ANGLE, rtol=1e-12)


@pytest.mark.parametrize("form", WRITERS)
def test_a_log_of_a_throttle_reads_back_equal(form: str, tmp_path: Path) -> None:
    file = tmp_path / "log"
    WRITERS[form](file, LOG, {"time_s": "s", "duty": "-", "angle_deg": "deg"})
    names = {"time": "time"} if form == "mdf" else {}
    log = read_throttle_log(file, **names)
    for name in ("duty", "angle_deg"):
        np.testing.assert_allclose(log[name], LOG[name], rtol=1e-12)
    np.testing.assert_allclose(log["time_s"], TIME, rtol=1e-12)


def test_a_waveform_of_tdms_gets_its_time(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    properties = {"wf_increment": 0.001, "wf_start_offset": 0.0, "wf_samples": len(TIME)}
    channels = [nptdms.ChannelObject("g", name, LOG[name], properties=properties) for name in ("duty", "angle_deg")]
    with nptdms.TdmsWriter(str(tmp_path / "w.tdms")) as writer:
        writer.write_segment(channels)
    table = read_any_table(tmp_path / "w.tdms")
    assert table.header == ("time", "duty", "angle_deg")
    np.testing.assert_allclose(table.numbers(0), TIME, rtol=1e-12)


def test_a_channel_called_time_keeps_its_name_beside_a_waveform(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    timed = nptdms.ChannelObject("g", "duty", LOG["duty"], properties={"wf_increment": 0.001, "wf_start_offset": 0.0})
    with nptdms.TdmsWriter(str(tmp_path / "w.tdms")) as writer:
        writer.write_segment([timed, nptdms.ChannelObject("g", "time", np.arange(3.0))])
    table = read_any_table(tmp_path / "w.tdms")
    assert table.header == ("time (duty)", "duty", "time")
    assert table.numbers(table.index("time")).tolist() == [0.0, 1.0, 2.0]


def test_an_index_of_tdms_that_is_of_another_record_changes_nothing(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    for name, values in (("b.tdms", np.arange(9.0)), ("a.tdms", np.arange(7, dtype="i4"))):
        with nptdms.TdmsWriter(str(tmp_path / name), index_file=True) as writer:
            writer.write_segment([nptdms.ChannelObject("g", "v", values)])
    (tmp_path / "b.tdms_index").replace(tmp_path / "a.tdms_index")
    assert read_any_table(tmp_path / "a.tdms").numbers(0).tolist() == list(range(7))


def test_rasters_of_mdf_keep_their_own_times(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as content:
        content.append([asammdf.Signal(samples=LOG["duty"], timestamps=TIME, name="duty")])
        content.append([asammdf.Signal(samples=np.arange(5.0), timestamps=np.arange(5.0), name="speed", unit="rpm")])
        content.save(tmp_path / "two.mf4")
    table = read_any_table(tmp_path / "two.mf4")
    assert table.header == ("time", "duty", "time 1", "speed")
    assert [len(table.numbers(k)) for k in range(4)] == [2000, 2000, 5, 5]
    with pytest.raises(DataError, match=r"columns of different rasters, column 'duty' has 2000, column 'speed' has 5"):
        table.matrix([1, 3])


def test_an_array_of_numpy_has_columns_by_number(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([ANGLE, *CYCLES]))
    trace = read_pressure(tmp_path / "a.npy", pressure_column=[1, 2, 3])
    np.testing.assert_array_equal(trace["pressure_bar"], CYCLES)


def test_decimals_and_empty_truths_of_parquet_are_numbers(tmp_path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    held = {"d": arrow.array([Decimal("1.25"), None]), "b": arrow.array([None, True]), "n": arrow.array(["a", "b"])}
    parquet.write_table(arrow.table(held), tmp_path / "a.parquet")
    table = read_any_table(tmp_path / "a.parquet")
    assert table.header == ("d", "b")
    np.testing.assert_array_equal(table.matrix([0, 1]), [[1.25, np.nan], [np.nan, 1.0]])


@pytest.mark.parametrize("above", [[], [["Operator", "Öz"]], [["Operator", "Öz"], ["Run", 17]]])
def test_a_sheet_may_be_indented_below_remarks(above: list[list[Any]], tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    rows = [[None, "angle", "p", "note"], *([None, a, a + 0.5, None] for a in range(5))]
    for row in (*above, *rows):
        book.active.append(row)
    book.save(tmp_path / "a.xlsx")
    table = read_any_table(tmp_path / "a.xlsx")
    assert [table.numbers(table.index(name)).tolist() for name in ("angle", "p")] == [
        [*range(5)],
        [0.5, 1.5, 2.5, 3.5, 4.5],
    ]
    assert table.numeric(range(table.width)) == [1, 2]


def test_a_stray_cell_far_away_is_no_table_of_that_size(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["crank_angle_cad", "p_bar"])
    for angle, pressure in zip(ANGLE, CYCLES[0], strict=True):
        book.active.append([angle, pressure])
    book.active.cell(3, 16384).value = "x"
    book.save(tmp_path / "a.xlsx")
    assert read_pressure(tmp_path / "a.xlsx").sizes == {"crank_angle_cad": ANGLE.size}


# --- what is refused ---------------------------------------------------------------------------------------
def test_more_numbers_than_the_machine_has_memory_for_are_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as content:
        for name in ("crank_angle_cad", "p_bar"):
            content.create_dataset(name, (10**13,), "f8", chunks=(10**6,))
    with pytest.raises(DataError, match=r"a\.h5: 76293946 MB of numbers, and this machine has \d+ MB"):
        read_pressure(tmp_path / "a.h5")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a system without devices as files")
@pytest.mark.parametrize("path", ["/dev/zero", "pipe"])
def test_what_has_no_end_is_not_read(path: str, tmp_path: Path) -> None:
    if path == "pipe":
        os.mkfifo(tmp_path / path)
    with pytest.raises(ParameterError, match="must be a plain file, no pipe or device"):
        read_pressure(os.fspath(tmp_path / path))


@pytest.mark.parametrize("form", WRITERS)
def test_a_cut_file_is_refused_by_name(form: str, tmp_path: Path) -> None:
    file = tmp_path / "whole"
    WRITERS[form](file, LOG, {"time_s": "s"})
    whole = file.read_bytes()
    for share in (0.3, 0.9):
        file.write_bytes(whole[: int(share * len(whole))])
        if form == "tdms":  # it is written piece by piece, and keeps what is whole
            with pytest.warns(UserWarning, match="the record was cut off: its last samples are missing"):
                table = read_any_table(file)
            for name in table.header or ():
                values = table.numbers(table.index(name))
                np.testing.assert_allclose(values, LOG[name][: len(values)])
        else:
            with pytest.raises(DataError, match=f"{file}.*: "):
                read_any_table(file)


def test_a_missing_reader_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "x.tdms").write_bytes(b"TDSm" + bytes(200))
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(ImportError, match=r'a TDMS file needs nptdms: pip install "mgdd\[formats\]"'):
        read_any_table(tmp_path / "x.tdms")


# --- text ---------------------------------------------------------------------------------------------------
ROWS = "\n".join(f"{a:.1f};{p:.6f}" for a, p in zip(ANGLE, CYCLES[0], strict=True))
LABVIEW = """\
LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
X_Columns\tOne
***End_of_Header***\t
\t
Channels\t2\t
Samples\t4\t4\t
Date\t2018/01/01\t2018/01/01\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.001000\t0.001000\t
***End_of_Header***\t\t
X_Value\tduty\tangle_deg\tComment
0.000000\t0.10\t20.0
0.001000\t0.12\t20.5
0.002000\t0.14\t21.0
0.003000\t0.16\t21.5
"""


@pytest.mark.parametrize(
    ("above", "header", "units"),
    [
        ("", None, None),
        ("angle;p\n", ("angle", "p"), None),
        ("angle;p\ndeg;bar\n", ("angle", "p"), ("deg", "bar")),
        ("angle;p\ndeg;bar\nencoder;sensor 2\n", ("angle", "p"), ("deg", "bar")),
        ("Test 4\nangle;p\n[deg];[bar]\n", ("angle", "p"), ("[deg]", "[bar]")),
        ("Operator;Smith\nEngine;V8\nangle;p\ndeg;bar\n", ("angle", "p"), ("deg", "bar")),
        ("speed = 1500\nload = 40 %\nangle;p\ndeg;bar\n", ("angle", "p"), ("deg", "bar")),
        ("Date;2018-01-01;3\nRun;17\n\nangle;p\n", ("angle", "p"), None),
        ("Test 4\nangle;fuel\ndeg;g/kWh\n", ("angle", "fuel"), ("deg", "g/kWh")),
    ],
)
def test_what_stands_above_the_rows(above: str, header: Any, units: Any, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(above + ROWS)
    table = read_any_table(tmp_path / "t.csv")
    assert (table.header, table.units) == (header, units)
    np.testing.assert_allclose(table.numbers(1), CYCLES[0], atol=1e-6)
    assert table.lines is not None
    assert len(table.lines) == len(ANGLE)


def test_labview_text(tmp_path: Path) -> None:
    (tmp_path / "t.lvm").write_text(LABVIEW)
    table = read_any_table(tmp_path / "t.lvm")
    assert table.header == ("X_Value", "duty", "angle_deg")
    assert table.matrix([0, 2]).tolist() == [[0.0, 0.001, 0.002, 0.003], [20.0, 20.5, 21.0, 21.5]]


def test_labview_text_with_commas(tmp_path: Path) -> None:
    (tmp_path / "t.lvm").write_text(LABVIEW.replace("Header***\t\t", "Header***\t\t\t").replace("\t", ","))
    table = read_any_table(tmp_path / "t.lvm")
    assert table.header == ("X_Value", "duty", "angle_deg")
    assert table.matrix([0, 2]).tolist() == [[0.0, 0.001, 0.002, 0.003], [20.0, 20.5, 21.0, 21.5]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (";1.5;2\n;2;3\n;3;4\n;4;5\nend;a;b\n;5;6\n", "line 5, column 1: 'a' is not a number"),
        ("angle;p\n1;2;3\n2;3\n3;4\n4;5\n", "line 3: 2 cell(s) where line 2 has 3"),
        (
            "angle p\n1,5 2,25\n2,5 -3,5\n",
            "line 2: '5 2' between commas: they are decimal marks and blanks",
        ),
        ("angle;p\n1;2\n2;x\n3;4\n4;5\n", "line 3, column 'p': 'x' is not a number"),
        ("angle;p\nP1;20;35\nP2;3.5\nP3;4.5\nP4;5.5\n", "line 3: 2 cell(s) where line 2 has 3"),
    ],
)
def test_a_bad_row_is_never_taken_for_a_preamble(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(DataError) as error:
        read_any_table(tmp_path / "t.csv").numbers(1)
    assert message in str(error.value)


@pytest.mark.parametrize("row", ["70,25  55,5 -1,0", '"-0,35"  "+0,5"', "5 833,0", "0,0 17 81,5 2,0"])
def test_decimal_commas_between_blanks_are_no_separators(row: str, tmp_path: Path) -> None:
    """The first and the last column would be numbers, of half a cell."""
    (tmp_path / "t.csv").write_text(f"{row}\n" * 3)
    with pytest.raises(DataError, match=r"line 1: .* are decimal marks and blanks separate .*: pass decimal=','"):
        read_any_table(tmp_path / "t.csv")
    first = float(row.split()[0].strip('"').replace(",", "."))
    assert read_any_table(tmp_path / "t.csv", decimal=",").numbers(0).tolist() == [first] * 3


@pytest.mark.parametrize("row", ["1, 2, 3", "1 2 3,5.5", "2026-11-28 01:02:03,4", "1,7 b,3"])
def test_blanks_beside_commas_are_no_matter(row: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"a,b,c\n{row}\n" if row.count(",") == 2 else f"a,b\n{row}\n")
    assert read_any_table(tmp_path / "t.csv").mark == ","


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_a_damaged_mdf_file_never_ends_the_process(version: str, tmp_path: Path) -> None:
    """In its C code asammdf believes the sizes in a file: of a channel within its record, of a large block."""
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version=version) as content:
        content.append([asammdf.Signal(samples=LOG["duty"], timestamps=TIME, name="duty")])
        file = Path(content.save(tmp_path / "a"))
        channel = content.groups[0].channels[1]
        at = channel.address + (186 if version < "4" else 92)  # bytes, or bits, from the start of a record
        assert read_any_table(file).header == ("time", "duty")
    whole = bytearray(file.read_bytes())
    whole[at : at + 2] = b"\xf0\xff"
    file.write_bytes(whole)
    with pytest.raises(
        DataError, match=r"cannot be read \(ValueError channel 'duty' ends at byte \d+ of a record of 16"
    ):
        read_any_table(file)


def test_two_data_sets_of_hdf5_may_come_to_one_name(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as content:
        content["a/b"], content["a.b"] = np.arange(3.0), np.arange(3.0) + 7.0
    table = read_any_table(tmp_path / "a.h5")
    assert table.header == ("a.b", "a.b")
    assert sorted(table.matrix([0, 1])[:, 0].tolist()) == [0.0, 7.0]


def test_a_unit_of_hdf5_that_is_no_text_is_not_read(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as content:
        for name, unit in {"a": "bar", "b": np.bytes_("bar"), "c": np.array(["bar"], dtype=object), "d": 7.0}.items():
            content[name] = np.arange(3.0)
            content[name].attrs["units"] = unit
        content["e"] = np.arange(3.0)
        content["e"].attrs.create("units", [np.arange(2), np.arange(3)], dtype=h5py.vlen_dtype("i4"))
    assert read_any_table(tmp_path / "a.h5").units == ("bar", "bar", "bar", "", "")


def test_what_matlab_wrote_is_read_as_far_as_scipy_reads_it() -> None:
    """Objects, functions, strings and tables of MATLAB stand in the files of SciPy's own tests."""
    import scipy.io.matlab

    files = sorted((Path(scipy.io.matlab.__file__).parent / "tests" / "data").glob("*.mat"))
    if not files:
        pytest.skip("this SciPy comes without the files of its tests")
    assert len(files) > 80
    refused = {file.stem: said for file in files if "no column of numbers" not in (said := _refusal(file))}
    hdf5 = "testhdf5_7.4_GLNX86"
    assert {name for name, said in refused.items() if said} == {
        "bad_miuint32", "bad_miutf8_array_name", "corrupted_zlib_checksum", "corrupted_zlib_data",
        "debigged_m4", "malformed1", hdf5,
    }  # fmt: skip


def _refusal(file: Path) -> str:
    try:
        read_any_table(file)
    except DataError as error:
        return str(error)
    return ""


def test_an_unfinalised_bus_log_of_a_vehicle() -> None:
    folder = os.environ.get("MGDD_DATA_DIR")
    file = Path(folder or "", "j1939_mf4", "00000001.MF4")
    if not folder or not file.is_file():
        pytest.skip("the folder j1939_mf4 is not in MGDD_DATA_DIR")
    pytest.importorskip("asammdf")
    table = read_any_table(file)
    column = {name: table.numbers(at) for at, name in enumerate(table.header or ())}
    assert table.height == 57849
    identifier = column["CAN_DataFrame.ID"].astype(np.int64)
    speed = (identifier >> 8) & 0xFFFF == 61444  # electronic engine controller 1
    low, high = (column[f"CAN_DataFrame.DataBytes {k}"][speed] for k in (4, 5))
    rpm = 0.125 * (low + 256.0 * high)
    assert (int(speed.sum()), rpm.min(), rpm.max()) == (12719, 646.5, 653.75)
    assert rpm.mean() == pytest.approx(650.05, abs=0.005)


def test_fewer_numbers_than_a_file_told_are_refused(tmp_path: Path) -> None:
    """NumPy would repeat one number in all rows."""
    columns = columns_of([Named("v", Samples(5, float, lambda: np.ones(1)))])
    table = ArrayTable("a", ("v",), None, (columns[0][2],), tmp_path / "a")
    for read in (table.loaded, lambda: table.numbers(0)):
        with pytest.raises(DataError, match=r"numbers where the head states \((1, )?5,?\)"):
            read()


def test_a_misspelt_column_is_told_the_near_one(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("angle;p\n" + ROWS)
    with pytest.raises(DataError, match=r"no column 'angel': did you mean 'angle'\? the header has 'angle', 'p'"):
        read_pressure(tmp_path / "t.csv", angle_column="angel")


@pytest.mark.parametrize("kind", ["external", "virtual"])
def test_numbers_of_hdf5_in_other_files_are_not_read(kind: str, tmp_path: Path) -> None:
    """A missing one would give its fill value."""
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as content:
        if kind == "external":
            content.create_dataset("p_bar", (100,), "f8", external=[(tmp_path / "gone", 0, 800)])
        else:
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(tmp_path / "gone.h5", "p", (100,))
            content.create_virtual_dataset("p_bar", layout)
    with pytest.raises(DataError, match=r"a\.h5: the numbers of data set 'p_bar' are in other files"):
        read_any_table(tmp_path / "a.h5")
