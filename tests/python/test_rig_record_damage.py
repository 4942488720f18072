"""What a kill, a full disk and damage leave of a record, and its repair."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest

from mgdd._core.rig import RecordReader
from mgdd.errors import DataError, RigError
from mgdd.rig import Recorder, export_record, read_record, repair_record
from mgdd.rig.exchange import RigRecord
from mgdd.rig.realtime import Frame
from recorded_rig import write
from sample_files import sample_file

WRITER = """
import sys
from mgdd.rig import Recorder
from mgdd.rig.realtime import Frame
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
from mgdd.rig import Recorder, read_record
from mgdd.rig.realtime import Frame
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
