"""Whole files of a test cell: the same trace in every format, cut as one cylinder alone is; wrong channels by name."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mgdd import datasets
from mgdd.errors import DataError, ParameterError
from mgdd.io import read, read_pressure
from mgdd.io.wrong_channel import no_angle, no_pressure
from mgdd.results.labels import ANGLE, check_labels
from pressure_files import CLOSED, CYCLES, FULL, ONE, RUN, Write
from table_files import WRITERS

pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
Array = NDArray[np.float64]
# Beside the first cylinder a second one that fires 240 degrees later at 8 % less, and other channels.
FIRST = CYCLES.ravel()
SECOND = 0.92 * np.roll(FIRST, 480)
MANIFOLD = 141.0 + 3.0 * np.sin(np.deg2rad(RUN) * 1.5) + 0.001 * RUN
TORQUE = 210.0 + 40.0 * np.cos(np.deg2rad(RUN)) - 0.002 * RUN
WHOLE = {"CAD": RUN, "p1": 100.0 * FIRST, "p2": 100.0 * SECOND, "p_intake": MANIFOLD, "torque": TORQUE}
UNITS = {"CAD": "deg", "p1": "kPa", "p2": "kPa", "p_intake": "kPa", "torque": "Nm"}


def whole(write: Write, name: str = "bench.csv") -> Path:
    return write([*WHOLE.values()], ",".join(f"{key} [{UNITS[key]}]" for key in WHOLE), name)


# --- laws --------------------------------------------------------------------------------------------------
def test_the_options_are_those_of_one_cylinder() -> None:
    both = [inspect.signature(reader).parameters for reader in (read, read_pressure)]
    assert [name for name in both[0] if name != "channels"] == [*both[1]]
    for name, parameter in both[1].items():
        assert both[0][name].replace(annotation="") == parameter.replace(annotation=""), name


def test_all_channels_are_cut_at_the_same_place(write: Write) -> None:
    bench = read(whole(write), firing_tdc_deg=360.0)
    check_labels(bench)
    assert dict(bench.sizes) == {"cycle": 5, ANGLE: 1440}
    assert list(bench.data_vars) == ["pressure_1_bar", "pressure_2_bar", "p_intake", "torque"]
    assert all(bench[name].dims == ("cycle", ANGLE) for name in bench.data_vars)
    np.testing.assert_array_equal(bench[ANGLE], FULL)
    for name, values in (("pressure_1_bar", FIRST), ("pressure_2_bar", SECOND)):
        np.testing.assert_allclose(bench[name], values.reshape(5, 1440), rtol=1e-15)
    np.testing.assert_array_equal(bench["p_intake"], MANIFOLD.reshape(5, 1440))
    np.testing.assert_array_equal(bench["torque"], TORQUE.reshape(5, 1440))
    assert [bench[name].attrs["units"] for name in bench.data_vars] == ["bar", "bar", "kPa", "N*m"]
    assert bench["p_intake"].attrs["source"] == "column 'p_intake [kPa]'"
    assert bench["pressure_2_bar"].attrs["long_name"] == "pressure of cylinder 2"
    assert bench.attrs == {"file": "bench.csv", "warnings": ""}


def test_the_later_cylinder_may_stand_first(write: Write) -> None:
    file = write([RUN, SECOND, FIRST], "CAD,cyl_3 [bar],cyl_1 [bar]")
    bench = read(file, firing_tdc_deg=360.0)
    np.testing.assert_array_equal(bench["pressure_3_bar"], SECOND.reshape(5, 1440))
    np.testing.assert_array_equal(bench["pressure_1_bar"], FIRST.reshape(5, 1440))
    assert bench[ANGLE].attrs["source"] == "column 'CAD', 0 at firing TDC of pressure_1_bar"
    alone = read_pressure(file, pressure_column="cyl_1 [bar]", firing_tdc_deg=360.0)
    np.testing.assert_array_equal(bench["pressure_1_bar"], alone["pressure_bar"])


@pytest.mark.parametrize(
    "columns",
    [
        {"angle": FULL, "p [bar]": ONE},
        {"angle": RUN, "p [bar]": FIRST},
        {"angle": RUN[:-333], "p [bar]": FIRST[:-333]},
        {"angle": np.tile(FULL, 5), "p": FIRST},
        {"angle": np.tile(FULL, 5)[100:-30], "p": FIRST[100:-30]},
        {"angle": RUN[:-1440], "p": FIRST[720:-720]},
        {"angle": FULL, **{f"p_{k}": FIRST.reshape(5, 1440)[k] for k in range(5)}},
        {"time_s": RUN / 7200.0, "p": FIRST},
    ],
    ids=["one", "running", "end cut", "stacked", "ends cut", "from firing TDC", "columns", "time"],
)
def test_it_agrees_with_the_reader_of_one_cylinder(write: Write, columns: dict[str, Array]) -> None:
    cut_off = columns.get("angle", RUN).size == RUN.size - 1440
    options = {"firing_tdc_deg": 0.0 if cut_off else 360.0} if "time_s" in columns or columns["angle"][-1] > 400 else {}
    if "time_s" in columns:
        options["speed_rpm"] = 1200.4  # corrected by the period of the record
    file = write([*columns.values()], ",".join(columns))
    assert read(file, **options).drop_attrs().identical(read_pressure(file, **options).drop_attrs())
    more = write(
        [*columns.values(), np.arange(len(next(iter(columns.values())))) ** 1.5], ",".join([*columns, "lift [mm]"])
    )
    bench, alone = read(more, **options), read_pressure(more, **options)
    assert bench[["pressure_bar"]].equals(alone)
    assert bench.attrs == alone.attrs
    assert bench["lift"].dims[-1:] == (ANGLE,)


# --- rasters and cycles ------------------------------------------------------------------------------------
def test_a_column_per_cycle_is_one_channel(write: Write) -> None:
    cycles, torque = FIRST.reshape(5, 1440), TORQUE.reshape(5, 1440)
    header = [*(f"cyl1_cycle{k + 1} [bar]" for k in range(5)), *(f"torque_{k + 1} [Nm]" for k in range(5)), "lift [mm]"]
    bench = read(write([FULL, *cycles, *torque, 0.1 * FULL], "CAD," + ",".join(header)))
    assert bench["torque"].dims == bench["pressure_bar"].dims == ("cycle", ANGLE)
    np.testing.assert_array_equal(bench["torque"], torque)
    assert bench["lift"].dims == (ANGLE,)
    assert bench["torque"].attrs["source"] == "columns 'torque_1 [Nm]' to 'torque_5 [Nm]', one per cycle"
    two = [f"cyl{c}_cycle{k + 1} [bar]" for c in (1, 2) for k in range(5)]
    # As many as the cycles, but not numbered as they are: five thermocouples.
    header = [name.replace("torque_", "t_wall_1") for name in header]
    bench = read(write([FULL, *cycles, *torque, 0.1 * FULL], "CAD," + ",".join(header)))
    np.testing.assert_array_equal(bench["t_wall_13"], torque[2])
    bench = read(write([FULL, *cycles, *SECOND.reshape(5, 1440)], "CAD," + ",".join(two)))
    np.testing.assert_array_equal(bench["pressure_2_bar"], SECOND.reshape(5, 1440))
    assert bench["pressure_2_bar"].attrs["source"].endswith("'cyl2_cycle5 [bar]', one per cycle")
    with pytest.raises(DataError, match=r"the cylinders have 4 and 5 columns .*name those of one, pressure_column="):
        read(write([FULL, *cycles, *SECOND.reshape(5, 1440)[:4]], "CAD," + ",".join(two[:-1])))


def test_columns_from_firing_tdc_join_all_channels_alike(write: Write) -> None:
    late = FIRST[720:-720].reshape(4, 1440)
    torque = TORQUE[720:-720].reshape(4, 1440)
    header = [*(f"p_{k}" for k in range(4)), *(f"torque_{k} [Nm]" for k in range(4)), "lift [mm]"]
    bench = read(write([RUN[:1440], *late, *torque, RUN[:1440]], "angle," + ",".join(header)), firing_tdc_deg=0.0)
    np.testing.assert_array_equal(bench["pressure_bar"], FIRST.reshape(5, 1440)[1:4])
    np.testing.assert_array_equal(bench["torque"], TORQUE.reshape(5, 1440)[1:4])
    np.testing.assert_array_equal(bench["lift"], (FULL + 720.0) % 720.0)


def test_cylinders_over_one_cycle_are_no_cycles(write: Write) -> None:
    bench = read(write([FULL, ONE, 0.92 * np.roll(ONE, 480)], "CAD,p1 [bar],p2 [bar]"))
    assert bench["pressure_2_bar"].dims == (ANGLE,)
    assert float(bench["pressure_2_bar"].idxmax()) == pytest.approx(float(bench["pressure_1_bar"].idxmax()) + 240.0)
    with pytest.raises(DataError, match="may not be cycles of one cylinder"):  # without names nothing says so
        read(write([FULL, ONE, 0.92 * np.roll(ONE, 480)]))


@pytest.mark.parametrize("form", ["hdf5", "mdf"])
def test_slow_rasters_and_one_value_per_cycle(form: str, tmp_path: Path) -> None:
    file, slow = tmp_path / "rasters", np.arange(17.0) * 25.0
    exhaust, imep = 610.0 + slow**1.1, np.array([4.1, 4.4, 4.2, 4.9, 4.6])
    if form == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(file, "w") as content:
            for name, values in (
                *WHOLE.items(),
                ("slow/t_ms", slow),
                ("slow/T_exh", exhaust),
                ("imep", imep),
                ("x", np.zeros(3)),
            ):
                content[name] = values
                content[name].attrs["units"] = {**UNITS, "slow/t_ms": "ms", "slow/T_exh": "°C", "imep": "bar"}.get(
                    name, ""
                )
        names = {"time": "time_1_s", "T_exh": "slow_T_exh"}
    else:
        asammdf = pytest.importorskip("asammdf")
        with asammdf.MDF(version="4.10") as content:
            stamps = np.arange(RUN.size) * 1e-4
            content.append([asammdf.Signal(v, stamps, name=n, unit=UNITS[n]) for n, v in WHOLE.items()])
            content.append([asammdf.Signal(exhaust, slow / 1000.0, name="T_exh", unit="°C")])
            content.save(tmp_path / "r.mf4").rename(file)
        names = {"time": "time_1_s", "T_exh": "T_exh"}
    bench = read(file, firing_tdc_deg=360.0)
    assert bench[names["T_exh"]].dims == (names["time"],)
    np.testing.assert_array_equal(bench[names["T_exh"]], exhaust)
    np.testing.assert_allclose(bench[names["time"]], slow / 1000.0, rtol=1e-15)
    assert (bench["time_1_s"].attrs["units"], bench[names["T_exh"]].attrs["units"]) == ("s", "degC")
    if form == "hdf5":
        assert bench["imep"].dims == ("cycle",)
        np.testing.assert_array_equal(bench["imep"], imep)
        assert bench.attrs["warnings"] == (
            "'x' left out: neither over the crank angle, nor with a time, nor one value per cycle"
        )
        with pytest.raises(DataError, match=r"column 'x' has 3 values: neither .*leave it out of channels"):
            read(file, firing_tdc_deg=360.0, channels=["x"])


def test_a_time_in_minutes_is_not_taken_for_seconds(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "f", "w") as content:
        content["angle"], content["p"] = FULL, ONE
        content["time"], content["T"] = np.arange(7.0), 600.0 + np.arange(7.0)
        content["time"].attrs["units"] = "min"
    bench = read(tmp_path / "f")
    assert list(bench.data_vars) == ["pressure_bar"]
    assert "'T', 'time' left out: neither over the crank angle, nor with a time" in bench.attrs["warnings"]
    with h5py.File(tmp_path / "f", "a") as content:
        content["time"].attrs["units"] = ""
    bench = read(tmp_path / "f")
    np.testing.assert_array_equal(bench["time_1_s"], np.arange(7.0))
    assert "the file gives no unit of column 'time': taken as seconds" in bench.attrs["warnings"]


def test_values_per_cycle_follow_the_cycles_that_are_whole(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "f", "w") as content:
        content["angle"], content["p"] = np.tile(FULL, 5)[100:-30], FIRST[100:-30]
        content["imep"] = np.array([4.1, 4.4, 4.2, 4.9, 4.6])
    np.testing.assert_array_equal(read(tmp_path / "f")["imep"], [4.4, 4.2, 4.9])


# --- names and units ---------------------------------------------------------------------------------------
def test_names_and_units_of_the_file(write: Write) -> None:
    header = "CAD,pcyl [bar],T Oil (°C),flow [kg/h],level [inH2O],2nd lift,lambda [-],cycle,duty [%],T Oil (degC)"
    bench = read(write([FULL, ONE, *(FULL * k for k in range(1, 9))], header))
    units = {name: bench[name].attrs["units"] for name in bench.data_vars}
    assert units == {
        "pressure_bar": "bar", "T_Oil": "degC", "flow": "kg/h", "level": "1", "c_2nd_lift": "1", "lambda": "1",
        "cycle_of_file": "1", "duty_of_file": "percent", "T_Oil_of_file": "degC",
    }  # fmt: skip
    assert bench["level"].attrs["long_name"] == "level, unit of inH2O"
    assert bench.attrs["warnings"] == (
        "the file gives no unit of 'c_2nd_lift', 'cycle_of_file': their numbers are unchanged"
    )


def test_channels_are_chosen_by_either_name(write: Write) -> None:
    file = whole(write)
    bench = read(file, firing_tdc_deg=360.0, channels=["torque [Nm]", "pressure_2_bar"])
    assert list(bench.data_vars) == ["pressure_2_bar", "torque"]
    np.testing.assert_array_equal(bench["torque"], TORQUE.reshape(5, 1440))
    with pytest.raises(DataError, match=r"channels='torqe': did you mean 'torque'\?; there are 'pressure_1_bar'"):
        read(file, firing_tdc_deg=360.0, channels=["torqe"])
    text = file.read_text().replace("\n", ",ok\n").replace("[Nm],ok", "[Nm],note [V]")
    broken = text.replace(f",{float(TORQUE[7])!r},", ",off,")
    file.write_text(broken)
    with pytest.raises(
        DataError, match=r"line 9, column 'torque \[Nm\]': 'off' is not a number.*leave torque out: chan"
    ):
        read(file, firing_tdc_deg=360.0)
    assert list(read(file, firing_tdc_deg=360.0, channels=["p_intake"]).data_vars) == ["p_intake"]


# --- wrong channels ----------------------------------------------------------------------------------------
NOISE = np.random.default_rng(3).normal(0.0, 0.02, RUN.size)
WRONG_ANGLES = {
    "square wave": (5.0 * (RUN % 6.0 < 2.0) + NOISE, "a square wave between"),
    "sine": (2.5 + 2.5 * np.sin(np.deg2rad(RUN) * 60.0 / 3.0) + NOISE, "a wave that rises and falls between"),
    "sawtooth": (5.0 * (RUN % 360.0) / 360.0, "a sawtooth from 0 to 4.99306, as a voltage of an encoder"),
    "noisy sawtooth": (5.0 * (RUN % 360.0) / 360.0 + NOISE, "a wave that rises and falls between"),
    "constant": (np.full(RUN.size, 3.25), "the constant 3.25"),
    "pulses": (np.floor(RUN / 6.0), "a count of pulses from 0 to 599, which stands still in 92% of the samples"),
    "counter": (np.arange(RUN.size) % 3600.0, "a count from 0 to 3599 that starts again"),
}


@pytest.mark.parametrize("kind", WRONG_ANGLES)
@pytest.mark.parametrize("reader", [read, read_pressure])
def test_what_cannot_be_an_angle_is_refused_by_its_values(kind: str, reader: Any, write: Write) -> None:
    values, looks = WRONG_ANGLES[kind]
    file = write([values, FIRST, RUN], "Crank position,p [bar],CAD")
    remedy = "pass angle_column='CAD', or pass angle_step_deg= with the degrees between samples"
    with pytest.raises(DataError, match="column 'Crank position' is not a crank angle: its values are") as caught:
        reader(file, firing_tdc_deg=360.0, pressure_column="p [bar]")
    assert looks in str(caught.value)
    assert str(caught.value).endswith(remedy)
    assert reader(file, firing_tdc_deg=360.0, pressure_column="p [bar]", angle_column="CAD").sizes["cycle"] == 5


WRONG_PRESSURES = {
    "square wave": (WRONG_ANGLES["square wave"][0], "a square wave between"),
    "sine": (30.0 + 20.0 * np.sin(np.deg2rad(RUN) * 20.0), "a wave that rises 199 times in 5 cycle(s)"),
    "constant": (np.full(RUN.size, 30.0), "the constant 30"),
    "angle": (RUN % 360.0, "even steps from 0 to 359.5, as an angle, a time or a count"),
}


@pytest.mark.parametrize("kind", WRONG_PRESSURES)
@pytest.mark.parametrize("reader", [read, read_pressure])
def test_what_cannot_be_a_pressure_is_refused_by_its_values(kind: str, reader: Any, write: Write) -> None:
    values, looks = WRONG_PRESSURES[kind]
    file = write([RUN, values], "CAD,p [bar]")
    with pytest.raises(DataError, match=r"column 'p \[bar\]' is not a cylinder pressure: its values are ") as caught:
        reader(file, firing_tdc_deg=360.0)
    assert looks in str(caught.value)
    assert str(caught.value).endswith("name the pressure, pressure_column=")


def test_angles_and_pressures_are_let_through() -> None:
    for angle in (FULL, RUN, np.tile(FULL, 5), -np.tile(FULL, 5), RUN % 720.0, RUN % 360.0, np.tile(CLOSED, 3)):
        assert no_angle(angle, "deg") is None
    for angle in (np.deg2rad(RUN) % (4.0 * np.pi), np.deg2rad(FULL)):
        assert no_angle(angle, "rad") is None
        assert no_angle(angle, "deg") is None  # said to be in radians elsewhere
    rng = np.random.default_rng(8)
    for trace in datasets.read("hd_diesel_128x144"):
        bar = trace["pressure_bar"].to_numpy()
        for noise in (0.0, 0.3):
            assert no_pressure(bar + noise * rng.standard_normal(bar.size), 1.0) is None
            assert no_pressure(np.tile(bar, 30) + noise * rng.standard_normal(30 * bar.size), 30.0) is None
    assert no_pressure(np.clip(FIRST, 2.0, 60.0), 5.0) is None  # a charge amplifier at its end


@pytest.mark.parametrize("reader", [read, read_pressure])
def test_an_angle_that_counts_turns_is_no_angle_of_cycles(reader: Any, write: Write) -> None:
    file = write([RUN % 360.0, FIRST], "CAD,p [bar]")
    with pytest.raises(
        DataError, match=r"every second turn has another pressure.*pass angle_step_deg=0.5 instead of its"
    ):
        reader(file)
    made = reader(file, angle_step_deg=0.5, firing_tdc_deg=360.0, pressure_column="p [bar]")
    np.testing.assert_array_equal(made["pressure_bar"], FIRST.reshape(5, 1440))
    two_stroke = np.tile(ONE[360:1080], 6) * (1.0 + 0.01 * np.repeat(np.arange(6.0), 720))
    made = reader(write([np.tile(FULL[360:1080], 6), two_stroke], "CAD,p [bar]"))
    np.testing.assert_array_equal(made["pressure_bar"], two_stroke.reshape(6, 720))
    motored = 2.0 + 40.0 * np.exp(-((FULL[360:1080] / 35.0) ** 2))
    late = motored + 43.0 * np.exp(-(((FULL[360:1080] - 45.0) / 20.0) ** 2))  # every second cycle misfires
    made = reader(write([np.tile(FULL[360:1080], 4), np.tile([late, motored], (2, 1)).ravel()], "CAD,p [bar]"))
    assert made.sizes["cycle"] == 4


def test_what_is_said_of_samples_that_are_not_finite(tmp_path: Path) -> None:
    hole = np.where(np.arange(RUN.size) == 154, np.nan, 1.0)
    cases = {
        r"sample 154: crank angle = nan: must be finite": {"angle": hole * RUN, "p": FIRST},
        r"sample 154: pressure = nan: must be finite": {"angle": RUN, "p": hole * FIRST},
        r"column 'p2', row 154: nan: must be finite": {"angle": RUN, "p1": FIRST, "p2": hole * SECOND},
    }
    for message, columns in cases.items():
        WRITERS["npz"](tmp_path / "a.npz", columns, {})
        with pytest.raises(DataError, match=message):
            read(tmp_path / "a.npz", firing_tdc_deg=360.0)
    WRITERS["npz"](tmp_path / "a.npz", {"angle": RUN, "p": FIRST, "lift": hole * RUN}, {})
    assert int(read(tmp_path / "a.npz", firing_tdc_deg=360.0)["lift"].isnull().sum()) == 1


def test_a_step_is_that_of_the_raster_of_the_pressure(tmp_path: Path) -> None:
    columns = {"T_exh": 600.0 + np.arange(9.0) ** 2, "time_s": np.arange(9.0), "p": FIRST, "torque": TORQUE}
    WRITERS["npz"](tmp_path / "a.npz", columns, {})
    options = {"angle_step_deg": 0.5, "firing_tdc_deg": 360.0}
    bench = read(tmp_path / "a.npz", **options)
    assert bench["T_exh"].dims == ("time_1_s",)
    np.testing.assert_array_equal(bench["torque"], TORQUE.reshape(5, 1440))
    assert bench[ANGLE].attrs["source"] == "angle_step_deg=0.5"
    assert (
        bench[["pressure_bar"]]
        .drop_vars("time_1_s", errors="ignore")
        .equals(read_pressure(tmp_path / "a.npz", **options))
    )


def test_a_cylinder_that_is_none_is_named(write: Write) -> None:
    file = write([RUN, FIRST, 0.01 * SECOND], "CAD,p1 [bar],p2 [bar]")
    with pytest.raises(DataError, match=r"column 'p2 \[bar\]': the highest pressure 1.7.*or name the cylinders' press"):
        read(file, firing_tdc_deg=360.0)
    assert read(file, firing_tdc_deg=360.0, pressure_column="p1 [bar]")["p2"].attrs["units"] == "bar"


# --- bad files ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda raw: raw[:0], "the file is empty"),
        (lambda raw: raw[: len(raw) // 2 - 7], "the file is cut off there: remove its last line"),
        (lambda raw: raw.replace(b"Nm", b"N\xb7m").replace(b"CAD", "Kurbelwinkel °".encode()), "damaged UTF-8"),
        (
            lambda raw: raw.replace(b".", b","),
            "5 columns, and the rows have 10 cells: commas are .* decimal marks as well",
        ),
        (lambda raw: raw.replace(b",", b";").replace(b".", b","), "pass decimal=','"),
        (lambda raw: raw.replace(b"[deg]", b"[gon]"), "is in 'gon', which is not known"),
        (lambda raw: raw.replace(b"p1 [kPa]", b"p1 [stone]"), "says 'stone' for the pressure"),
        (lambda raw: raw.replace(b"p1 [kPa]", b"p1 [bar]"), "this looks like"),
        (lambda raw: raw.replace(b"p1 [kPa]", b"torque 1 [Nm]").replace(b"p2 [kPa]", b"torque 2 [Nm]"), "no pressure"),
        (lambda raw: raw.replace(b"\n", b"\n1,2,3,4,5\n", 1), "line 2: the line counts its cells, 1 to 5"),
        (lambda raw: raw.replace(b"\n", b"\n0x1,K2,K3,K4,K5\n", 1), "line 2, .* a further one of the header, start it"),
        (lambda raw: raw.replace(b"CAD", b"angle").replace(b"p2 [kPa]", b"p1 [kPa]"), "pressure_1_bar|p1"),
    ],
    ids=[
        "empty",
        "cut off",
        "encodings",
        "commas",
        "decimal",
        "gon",
        "stone",
        "bar",
        "no pressure",
        "ids",
        "hex",
        "twice",
    ],
)
def test_bad_files_are_refused_with_the_cause(change: Any, message: str, write: Write) -> None:
    file = whole(write)
    file.write_bytes(change(file.read_bytes()))
    if "p1" in message:  # the same name twice is two channels
        assert list(read(file, firing_tdc_deg=360.0).data_vars)[:2] == ["pressure_1_bar", "pressure_2_bar"]
        return
    with pytest.raises(DataError, match=message) as caught:
        read(file, firing_tdc_deg=360.0)
    assert "bench.csv" in str(caught.value)


def test_a_folder_and_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="this is a folder"):
        read(tmp_path)
    with pytest.raises(FileNotFoundError, match="no such file"):
        read(tmp_path / "none.csv")
