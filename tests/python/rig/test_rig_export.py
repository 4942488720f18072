"""A record in the formats of other tools, read back by those tools."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import ParameterError, RigError
from mgdd.results.labels import check_labels
from mgdd.rig import Recorder, export_record, read_record
from mgdd.rig.can.python_can import frame_of, message_of
from mgdd.rig.realtime import Frame

CLASSIC = [
    Frame(id=0x120, data=bytes(range(8)), monotonic_ns=1_000_000_000),
    Frame(id=0x1ABCDEF0, extended=True, data=b"\xfe", received=True, channel=1, monotonic_ns=1_005_000_000),
    Frame(id=0x121, remote=True, data=bytes(4), received=True, monotonic_ns=1_010_000_000),
]
FD = Frame(id=0x300, fd=True, bit_rate_switch=True, data=bytes(range(200, 248)), monotonic_ns=1_015_000_000)


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / "run.rec"
    with Recorder(path) as written:
        for frame in [*CLASSIC, FD]:
            written.frame(frame)
        for i in range(5):
            written.sample(
                "controller", {"angle_deg": 10 + 0.1 * i, "duty": np.nan if i == 2 else -0.25}, monotonic_ns=i
            )
        written.sample("engine/bench", {"speed_rpm": 1200}, monotonic_ns=8)
        written.event("state", "ARMED → RUN, again", monotonic_ns=9)
    return path


def test_messages_and_back() -> None:
    for frame in [*CLASSIC, FD, Frame(id=0x40, error=True, data=bytes(8))]:
        back = frame_of(message_of(frame), monotonic_ns=frame.monotonic_ns, channel=frame.channel)
        assert back == frame
    assert frame_of(message_of(FD, timestamp_s=12.5), monotonic_ns=0, received=True).bus_ns == 12_500_000_000


@pytest.mark.parametrize(("kind", "reader"), [("blf", "BLFReader"), ("asc", "ASCReader"), ("log", "CanutilsLogReader")])
def test_logs_of_frames(record: Path, tmp_path: Path, kind: str, reader: str) -> None:
    io = pytest.importorskip("can.io")
    target = tmp_path / f"run.{kind}"
    assert export_record(record, target) == [target]
    with getattr(io, reader)(target) as log:
        messages = list(log)
    frames = [*CLASSIC, FD]
    assert [m.arbitration_id for m in messages] == [frame.id for frame in frames]
    assert [m.is_extended_id for m in messages] == [frame.extended for frame in frames]
    assert [m.is_remote_frame for m in messages] == [frame.remote for frame in frames]
    assert [m.is_fd for m in messages] == [frame.fd for frame in frames]
    assert [bytes(m.data) for m in messages] == [b"" if frame.remote else frame.data for frame in frames]
    assert [m.is_rx for m in messages] == [frame.received for frame in frames]
    stamps = [m.timestamp for m in messages]
    assert np.allclose(np.diff(stamps), 0.005, atol=2e-6)
    run = read_record(record)
    if kind == "log":  # the one that keeps the wall clock to the microsecond
        assert stamps[0] == pytest.approx(run.started.timestamp() + float(run.frames["time_s"][0]), abs=1e-5)
    assert list(tmp_path.glob(".*.part")) == []


def test_mf4_holds_everything(record: Path, tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    target = tmp_path / "run.mf4"
    assert export_record(record, target) == [target]
    run = read_record(record)
    with asammdf.MDF(target) as mdf:
        angle = mdf.get("angle_deg")
        assert np.array_equal(angle.samples, run.samples["controller"]["angle_deg"].values)
        assert np.array_equal(angle.timestamps, run.samples["controller"]["time_s"].values)
        assert angle.unit == "deg"
        assert mdf.get("speed_rpm").samples.tolist() == [1200.0]
        assert [text.decode() for text in mdf.get("event").samples] == ["state: ARMED → RUN, again"]
        assert abs((mdf.header.start_time - run.started).total_seconds()) < 1e-3


def test_mf4_is_a_bus_log_for_others(record: Path, tmp_path: Path) -> None:
    reader = pytest.importorskip("can.io.mf4").MF4Reader
    with reader(export_record(record, tmp_path / "run.mf4")[0]) as log:
        messages = {(m.arbitration_id, bytes(m.data), m.is_fd, m.is_rx, m.is_remote_frame) for m in log}
    assert messages == {
        (f.id, b"" if f.remote else f.data, f.fd, f.received, f.remote) for f in [*CLASSIC, FD]
    }  # fmt: skip


def test_netcdf(record: Path, tmp_path: Path) -> None:
    files = export_record(record, tmp_path / "run", kind="netcdf")
    assert [file.name for file in files] == ["controller.nc", "engine_bench.nc", "events.nc", "frames.nc"]
    run = read_record(record)
    for file, data in zip(files, [*run.samples.values(), run.events, run.frames], strict=True):
        with xr.open_dataset(file) as back:
            check_labels(back)
            assert set(back.variables) == set(data.variables)
            for name, variable in data.variables.items():
                assert np.array_equal(back[name].values, variable.values, equal_nan=variable.dtype.kind == "f"), name


def csv_rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_csv(record: Path, tmp_path: Path) -> None:
    files = {file.stem: file for file in export_record(record, tmp_path / "run", kind="csv")}
    rows = csv_rows(files["controller"])
    run = read_record(record)
    assert [float(row["angle_deg"]) for row in rows] == run.samples["controller"]["angle_deg"].values.tolist()
    assert rows[2]["duty"] == "nan"
    frames = csv_rows(files["frames"])
    assert [bytes.fromhex(row["data"]) for row in frames][0::3] == [CLASSIC[0].data, FD.data]
    assert [row["received"] for row in frames] == ["False", "True", "True", "False"]
    assert csv_rows(files["events"])[0]["text"] == "ARMED → RUN, again"


def test_parquet(record: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    files = {file.stem: file for file in export_record(record, tmp_path / "run", kind="parquet")}
    table = parquet.read_table(files["controller"])
    run = read_record(record)
    for name in ("time_s", "angle_deg"):
        assert table[name].to_numpy().tolist() == run.samples["controller"][name].values.tolist()
    assert table.schema.field("angle_deg").metadata == {b"units": b"deg", b"long_name": b"plate angle"}
    assert parquet.read_table(files["frames"])["data"].to_pylist()[3] == FD.data
    assert parquet.read_table(files["events"])["text"].to_pylist() == ["ARMED → RUN, again"]


@pytest.mark.parametrize("kind", ["csv", "netcdf", "parquet", "mf4", "blf", "asc", "log"])
def test_a_record_without_anything(tmp_path: Path, kind: str) -> None:
    Recorder(tmp_path / "run.rec").close()
    assert all(file.is_file() for file in export_record(tmp_path / "run.rec", tmp_path / "out", kind=kind))


def test_refused_targets_leave_nothing(record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ParameterError, match="kind = 'dat': must be one of blf"):
        export_record(record, tmp_path / "run.dat")
    with pytest.raises(ParameterError, match="kind = '': must be one of"):
        export_record(record, tmp_path / "run")
    with pytest.raises(RigError, match="exists already"):
        export_record(record, tmp_path, kind="csv")
    with pytest.raises(FileNotFoundError):
        export_record(tmp_path / "no.rec", tmp_path / "run.csv", kind="csv")
    for module, kind, extra in (("pyarrow", "parquet", "parquet"), ("asammdf", "mf4", "mdf"), ("can", "blf", "can")):
        for name in [name for name in sys.modules if name.partition(".")[0] == module]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=rf'needs {module}: pip install "mgdd\[{extra}\]"'):
            export_record(record, tmp_path / "out", kind=kind)
    assert sorted(tmp_path.iterdir()) == before


def test_an_old_file_stays_when_the_new_one_fails(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "run.log"
    target.write_text("yesterday")

    def breaks(*_: object) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr("can.io.CanutilsLogWriter.on_message_received", breaks)
    with pytest.raises(OSError, match="No space left"):
        export_record(record, target)
    assert target.read_text() == "yesterday"
    assert list(tmp_path.glob(".*.part")) == []
