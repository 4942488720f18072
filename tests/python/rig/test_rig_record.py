"""The record of a run: what comes back and is refused, what a kill, a full disk and damage leave, and its repair."""

import os
import signal
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mgdd._core.rig import RecordReader
from mgdd.errors import DataError, ParameterError, RigError, ShapeError
from mgdd.results.labels import check_labels
from mgdd.rig import Recorder, export_record, read_record, repair_record
from mgdd.rig.exchange import RigRecord
from mgdd.rig.realtime import Frame
from recorded_rig import FRAMES, independent, write
from sample_files import sample_file


def test_a_reader_of_its_own_finds_the_same(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    record = write(path)
    assert record.written == 11
    header, *bodies = independent(path)
    assert header[1].hex() == record.run_id
    assert abs(header[2] - time.time_ns()) < 60e9
    assert abs(header[3] - time.monotonic_ns()) < 60e9
    assert header[4]["config"] == {"rig": "Prüfstand", "gain": 2.5}
    assert bodies[0] == ("frame", 0, 0, 8, 0x120, 5_000_000_000, 1_700_000_000_000_000_123, bytes(range(8)))
    assert bodies[1] == ("frame", 0b101, 3, 0, 0x1ABCDEF0, -7, 0, b"")
    assert bodies[2][1:5] == (0b11100, 0, 48, 0x7FF)
    assert bodies[3][1] == 0b110
    assert bodies[4] == ("frame", 0b100000, 0, 4, 0x121, 0, 0, b"")
    assert bodies[5][::3] == ("columns", ["controller", "angle_deg", "duty"])
    assert bodies[6] == ("sample", 0, 1_000, (10.25, -0.5))
    assert bodies[7][3][0] == 11.5
    assert bodies[8][::3] == ("columns", ["engine", "speed_rpm"])
    assert bodies[9:] == [("sample", 1, 1_500, (1200.0,)), ("event", 3_000, "state", "ARMED → RUN"), ("ignored", 0)]


def test_frames_come_back_as_they_were(tmp_path: Path) -> None:
    write(tmp_path / "run.rec")
    reader = RecordReader(str(tmp_path / "run.rec"))
    records = list(reader)
    assert records[:5] == FRAMES
    assert records[5] == ("sample", 1_000, "controller", {"angle_deg": 10.25, "duty": -0.5})
    assert records[-1] == ("event", 3_000, "state", "ARMED → RUN")
    assert (reader.ignored_bytes, reader.incomplete) == (0, False)


def test_datasets(tmp_path: Path) -> None:
    write(tmp_path / "run.rec")
    run = read_record(tmp_path / "run.rec")
    for data in (run.frames, run.events, *run.samples.values()):
        check_labels(data)
    assert run.config == {"rig": "Prüfstand", "gain": 2.5}
    assert run.samples.keys() == {"controller", "engine"}
    plate = run.samples["controller"]
    assert plate["angle_deg"].values.tolist() == [10.25, 11.5]
    assert plate["angle_deg"].attrs["units"] == "degree"
    assert plate["duty"].values[0] == -0.5
    assert np.isnan(plate["duty"].values[1])
    start = run.header["monotonic_ns"]
    assert plate["time_s"].values.tolist() == [(1_000 - start) * 1e-9, (2_000 - start) * 1e-9]
    assert run.samples["engine"]["speed_rpm"].attrs["units"] == "rpm"
    assert run.frames["id"].values.tolist() == [frame.id for frame in FRAMES]
    assert run.frames["data"].shape == (5, 48)
    assert run.frames["data"].dtype == np.uint8
    assert run.frames["data"].values[2].tolist() == list(range(200, 248))
    assert run.frames["received"].values.tolist() == [False, True, True, True, False]
    assert run.frames["bus_time_s"].values[0] == 0.0
    assert np.isnan(run.frames["bus_time_s"].values[1])
    assert run.frames.attrs["bus_start_ns"] == "1700000000000000123"
    assert run.events["text"].values.tolist() == ["ARMED → RUN"]
    assert (run.records, run.unknown, run.damaged_bytes, run.ignored_bytes) == (11, 0, 0, 0)
    assert run.summary().splitlines()[1:] == [
        "5 frames, 1 events", "table controller: 2 samples of 2", "table engine: 1 samples of 1",
    ]  # fmt: skip


def test_an_empty_record(tmp_path: Path) -> None:
    Recorder(tmp_path / "run.rec").close()
    run = read_record(tmp_path / "run.rec")
    assert (run.frames.sizes["frame"], run.events.sizes["event"], run.samples) == (0, 0, {})
    assert run.started.tzinfo is not None


@settings(max_examples=50)
@given(st.dictionaries(st.text(min_size=1, max_size=20), st.floats(), min_size=1, max_size=5), st.text(max_size=50))
def test_any_names_numbers_and_words(
    tmp_path_factory: pytest.TempPathFactory, row: dict[str, float], text: str
) -> None:
    path = tmp_path_factory.mktemp("any") / "run.rec"
    if "time_s" in row or any("\ud800" <= letter <= "\udfff" for letter in text + "".join(row)):
        return
    with Recorder(path) as record:
        record.sample("t", row, monotonic_ns=3)
        record.event("note", text, monotonic_ns=4)
    sample, event = RecordReader(str(path))
    assert np.array(list(sample[3].values())).tobytes() == np.array(list(row.values())).tobytes()
    assert list(sample[3]) == list(row)
    assert event == ("event", 4, "note", text)
    assert read_record(path).ignored_bytes == 0


def test_refused_calls_change_nothing(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    with Recorder(path) as record:
        record.sample("plate", {"angle_deg": 1.0, "duty": 0.0})
        size = path.stat().st_size
        with pytest.raises(ParameterError, match="did you mean 'angle_deg'"):
            record.sample("plate", {"angel_deg": 1.0, "duty": 0.0})
        with pytest.raises(ParameterError, match="values = 'duty': must be given in every row of table plate"):
            record.sample("plate", {"angle_deg": 1.0})
        with pytest.raises(ParameterError, match="its own time_s"):
            record.sample("other", {"time_s": 1.0})
        with pytest.raises(ParameterError, match="angle_deg = 'wide': must be one number"):
            record.sample("plate", {"angle_deg": "wide", "duty": 0.0})  # type: ignore[dict-item]
        with pytest.raises(ParameterError, match="columns"):
            record.sample("other", {})
        with pytest.raises(ParameterError, match="category"):
            record.event("", "text")
        assert path.stat().st_size == size
    with pytest.raises(RigError, match="the record is closed"):
        record.event("note", "late")
    with pytest.raises(RigError, match="never overwritten"):
        Recorder(path)
    with pytest.raises(RigError, match="make the folder first"):
        Recorder(tmp_path / "no" / "run.rec")
    with pytest.raises(FileNotFoundError, match=r"run\.rec"):
        read_record(tmp_path / "run.rce")
    (tmp_path / "text.rec").write_text("no record")
    for refused in (read_record, repair_record):
        with pytest.raises(DataError, match="not a record of mgdd"):
            refused(tmp_path / "text.rec")


def test_an_exception_stands_in_the_record(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "run.rec"):
        _ = 1 / 0
    assert read_record(tmp_path / "run.rec").events["text"].values.tolist() == ["ZeroDivisionError: division by zero"]


def test_many_threads_write_whole_records(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.rec") as record:

        def work(name: str) -> None:
            for i in range(200):
                record.sample(name, {"i": i})
                record.frame(Frame(id=i))

        threads = [threading.Thread(target=work, args=(f"t{n}",)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    run = read_record(tmp_path / "run.rec")
    assert run.ignored_bytes == 0
    assert run.frames.sizes["frame"] == 800
    for n in range(4):
        assert run.samples[f"t{n}"]["i"].values.tolist() == list(range(200))


def test_refused_frames() -> None:
    with pytest.raises(ParameterError, match=r"id = 2048: must be in \[0, 2047\]"):
        Frame(id=0x800)
    with pytest.raises(ParameterError, match="id = 536870912"):
        Frame(id=0x20000000, extended=True)
    with pytest.raises(ShapeError, match="payload has 65 bytes: must be at most 64"):
        Frame(id=1, data=bytes(65))
    assert Frame(id=1, data=memoryview(bytes(range(8)))[::2]).data == bytes([0, 2, 4, 6])
    assert Frame(**FRAMES[2].to_dict()) == FRAMES[2]


WRITER = """
import sys
from mgdd.rig.realtime import Frame; from mgdd.rig import Recorder
record = Recorder(sys.argv[1])
i = 0
while True:
    record.frame(Frame(id=i % 2048, data=i.to_bytes(8, "little")))
    record.sample("count", {"i": i})
    i += 1
    if i % 100 == 0:
        print(i, flush=True)
"""


@pytest.mark.parametrize("after_s", [0.0, 0.013, 0.05, 0.21])
def test_a_killed_process_loses_at_most_the_record_it_was_writing(tmp_path: Path, after_s: float) -> None:
    path = tmp_path / "run.rec"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        told = int(process.stdout.readline())
        time.sleep(after_s)
        os.kill(process.pid, signal.SIGKILL)
        for line in process.stdout:
            told = int(line)
    assert process.returncode == -signal.SIGKILL
    run = read_record(path)
    counted = run.samples["count"]["i"].values
    frames = [int.from_bytes(row.tobytes(), "little") for row in run.frames["data"].values]
    assert counted.tolist() == list(range(len(counted)))
    assert frames == list(range(len(frames)))
    assert len(counted) >= told
    assert len(frames) - len(counted) in (0, 1)
    assert run.ignored_bytes < 8 + 16 + 8 + 8
    whole = path.stat().st_size
    assert repair_record(path)["damaged_bytes"] == run.ignored_bytes
    assert (path.stat().st_size == whole) == (run.ignored_bytes == 0)


FULL = """
import resource, sys
from mgdd.errors import RigError
from mgdd.rig.realtime import Frame; from mgdd.rig import Recorder, read_record
record = Recorder(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
written = 0
try:
    while True:
        record.frame(Frame(id=written, data=bytes(7)))
        written += 1
except RigError as error:
    print(error)
assert read_record(sys.argv[1]).frames.sizes["frame"] == written
assert (record.written, record.refused) == (written, 1)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
record.event("note", "there is room again")
record.close()
run = read_record(sys.argv[1])
assert (run.frames.sizes["frame"], run.events.sizes["event"], run.ignored_bytes) == (written, 1, 0)
"""


def test_a_file_that_may_not_grow(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FULL, str(tmp_path / "run.rec")]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert (
        "run.rec: File too large: the file reached the limit of its size; what was written stays readable" in run.stdout
    )


def test_a_full_disk(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    mount = tmp_path / "small"
    mount.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(mount)], capture_output=True, text=True
    )
    if mounted.returncode != 0:
        pytest.skip(f"no small disk can be mounted: {mounted.stderr.strip()}")
    try:
        record = Recorder(mount / "run.rec")

        def fill() -> None:
            while True:
                record.frame(Frame(id=0x120, data=bytes(8)))

        with pytest.raises(RigError, match=r"No space left on device: free some space or record elsewhere"):
            fill()
        assert read_record(mount / "run.rec").frames.sizes["frame"] == record.written
        assert read_record(mount / "run.rec").ignored_bytes == 0
        with pytest.raises(RigError, match="No space left"):
            repair_record(_damaged(mount / "run.rec"))
        record.close()
        assert [path.name for path in mount.iterdir()] == ["run.rec"]
    finally:
        subprocess.run(["umount", str(mount)], check=True)


def _damaged(path: Path) -> Path:
    with path.open("r+b") as file:
        file.seek(-20, os.SEEK_END)
        file.write(b"\xff\xff")
    return path


def test_repair_finds_what_stands_behind_the_damage(tmp_path: Path) -> None:
    path, target = tmp_path / "run.rec", tmp_path / "mended.rec"
    write(path)
    whole = path.read_bytes()
    at = whole.rindex(b"\xe8\x03\0\0\0\0\0\0")  # stamp 1000, as that of the names before it: the first sample
    path.write_bytes(whole[: at + 3] + b"\x77" + whole[at + 4 :])
    run = read_record(path)
    assert run.records == 6
    assert run.ignored_bytes > 0
    assert "repair_record looks behind them" in run.summary()
    assert repair_record(path, target) == {
        "records": 10, "damaged_bytes": 8 + 16 + 16, "places": 1, "header_lost": False,
    }  # fmt: skip
    mended = read_record(target)
    assert mended.samples["controller"]["angle_deg"].values.tolist() == [11.5]
    assert mended.events["text"].values.tolist() == ["ARMED → RUN"]
    assert (mended.damaged_bytes, mended.ignored_bytes) == (40, 0)
    assert "40 bytes were damaged" in mended.summary()
    damage = [record for record in RecordReader(str(target)) if isinstance(record, tuple) and record[0] == "damage"]
    assert damage == [("damage", path.read_bytes()[at - 16 : at + 24])]


def test_a_header_that_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    write(path)
    data = bytearray(path.read_bytes())
    data[50] ^= 1
    path.write_bytes(data)
    with pytest.raises(DataError, match="the header is damaged"):
        read_record(path)
    assert repair_record(path)["header_lost"] is True
    run = read_record(path)
    assert run.records == 12
    assert run.samples["controller"].sizes["time_s"] == 2
    assert run.header["repaired"] == "the header was damaged"


def test_a_record_can_be_read_while_it_is_written(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.rec") as record:
        for i in range(3):
            record.event("note", str(i))
            assert read_record(tmp_path / "run.rec").events["text"].values.tolist() == [str(n) for n in range(i + 1)]


def test_an_identifier_that_no_bus_has(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    write(path)
    whole = path.read_bytes()
    at = whole.index(b"\x20\x01\0\0") - 4  # 0x120, behind the four bytes that a body begins with
    length = int.from_bytes(whole[at - 8 : at - 4], "little")
    body = whole[at : at + 7] + b"\xff" + whole[at + 8 : at + length]
    path.write_bytes(whole[: at - 4] + zlib.crc32(body).to_bytes(4, "little") + body + whole[at + length :])
    with pytest.raises(DataError, match=r"run\.rec: frame 0 has the identifier 0xff000120: it has at most 29 bits"):
        read_record(path)


@pytest.mark.parametrize("kind", ["csv", "netcdf", "log"])
def test_an_export_of_what_is_left_says_what_is_missing(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "run.rec"
    write(path)
    with path.open("ab") as file:
        file.write(bytes(30))
    with pytest.warns(UserWarning, match=r"run\.rec: 30 bytes at its end are not readable and left out: mgdd"):
        export_record(path, tmp_path / f"out.{kind}", kind=kind)
    repair_record(path)
    export_record(path, tmp_path / f"mended.{kind}", kind=kind)  # without a warning, which would be an error here


def test_exchanges_that_are_lost_are_missed(tmp_path: Path) -> None:
    path = sample_file("rig.RigRecord.read", tmp_path)
    whole = RigRecord.read(path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.warns(UserWarning, match="bytes at its end are not readable"):
        assert len(RigRecord.read(path)) == len(whole) - 1
