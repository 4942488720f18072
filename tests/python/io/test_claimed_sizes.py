"""Files that claim more than they have: refused within limits of memory and time, in one short sentence."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_chunks, read_pressure
from mgdd.io.any_table import read_any_table
from mgdd.io.files import read_plain_text

_HUGE = 10**10


def hdf5_unwritten(file: Path) -> None:
    import h5py

    with h5py.File(file, "w") as content:
        for name in ("crank_angle_cad", "p_bar"):
            content.create_dataset(name, (_HUGE,), "f8", chunks=(10**6,), compression="gzip", fillvalue=1.0)


def npz_head(file: Path) -> None:
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (_HUGE,)})
    with zipfile.ZipFile(file, "w") as archive:
        for name in ("crank_angle_cad", "p_bar"):
            archive.writestr(f"{name}.npy", head.getvalue() + bytes(80))


def npz_of_zeros(file: Path) -> None:
    np.savez_compressed(file.with_suffix(".npz"), crank_angle_cad=np.zeros(20_000_000), p_bar=np.zeros(3))
    file.with_suffix(".npz").replace(file)


def matlab_of_zeros(file: Path) -> None:
    from scipy.io import savemat

    savemat(file, {"crank_angle_cad": np.zeros(20_000_000, "f8"), "p_bar": np.zeros(3)}, do_compression=True)


def parquet_of_zeros(file: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    zeros = pa.array(np.zeros(20_000_000))
    parquet.write_table(pa.table({"crank_angle_cad": zeros, "p_bar": zeros}), file)


@pytest.mark.parametrize("make", [hdf5_unwritten, npz_head, npz_of_zeros, matlab_of_zeros, parquet_of_zeros])
@pytest.mark.parametrize("read", [read_pressure, read_any_table, lambda file: next(pressure_chunks(file))])
def test_a_small_file_with_many_numbers_is_refused(
    make: Callable[[Path], None], read: Callable[[Path], object], tmp_path: Path
) -> None:
    make(tmp_path / "a.bin")
    with pytest.raises(DataError, match=r"a\.bin: .*(claims|needs more than) \d+ MB.*MGDD_READ_LIMIT_MB") as refused:
        read(tmp_path / "a.bin")
    assert len(str(refused.value)) < 400


def test_the_remedy_of_a_refused_size_lets_it_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    npz_of_zeros(tmp_path / "a.npz")
    monkeypatch.setenv("MGDD_READ_LIMIT_MB", "153")
    assert read_any_table(tmp_path / "a.npz").lengths == (20_000_000, 3)
    monkeypatch.setenv("MGDD_READ_LIMIT_MB", "many")
    with pytest.raises(DataError, match="MGDD_READ_LIMIT_MB = 'many': must be a number > 0"):
        read_any_table(tmp_path / "a.npz")


def test_as_many_numbers_as_a_file_has_are_read(tmp_path: Path) -> None:
    import h5py

    values = np.random.default_rng(1).normal(size=20_000_000)  # 160 MB, above what a small file may claim
    with h5py.File(tmp_path / "a.h5", "w") as content:
        content["p_bar"] = values
    np.testing.assert_array_equal(read_any_table(tmp_path / "a.h5").numbers(0), values)


@pytest.mark.parametrize("kind", ["external", "virtual"])
def test_numbers_of_hdf5_in_other_files_are_not_read(kind: str, tmp_path: Path) -> None:
    import h5py

    (tmp_path / "secret").write_bytes(bytes(800))
    with h5py.File(tmp_path / "b.h5", "w") as content:
        content["p"] = np.arange(100.0)
    with h5py.File(tmp_path / "a.h5", "w") as content:
        if kind == "external":
            content.create_dataset("p_bar", (100,), "f8", external=[(tmp_path / "secret", 0, 800)])
        else:
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource(tmp_path / "b.h5", "p", (100,))
            content.create_virtual_dataset("p_bar", layout)
    with pytest.raises(DataError, match=r"a\.h5: the numbers of data set 'p_bar' stand in other files"):
        read_any_table(tmp_path / "a.h5")


def test_a_stray_cell_far_away_is_no_table_of_that_size(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["crank_angle_cad", "p_bar"])
    for angle in range(-180, 181):
        book.active.append([angle, 1.0 + 40.0 * np.exp(-((angle / 30.0) ** 2))])
    book.active.cell(3, 16384).value = "x"
    book.save(tmp_path / "a.xlsx")
    assert read_pressure(tmp_path / "a.xlsx").sizes == {"crank_angle_cad": 361}
    book.active.cell(1048576, 16384).value = "x"
    book.save(tmp_path / "a.xlsx")
    with pytest.raises(DataError, match="the cell is empty"):
        read_pressure(tmp_path / "a.xlsx")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a system without devices as files")
@pytest.mark.parametrize("path", ["/dev/zero", "/dev/urandom", "/proc/self/maps", "/proc/self/mem", "pipe"])
@pytest.mark.parametrize("read", [read_pressure, read_plain_text, lambda file: next(pressure_chunks(file))])
def test_what_has_no_end_is_not_read(path: str, read: Callable[[str], object], tmp_path: Path) -> None:
    if path == "pipe":
        os.mkfifo(tmp_path / path)
    with pytest.raises(ParameterError, match="must be a plain file, and this"):
        read(os.fspath(tmp_path / path))


@pytest.mark.parametrize("head", [b"", b"crank_angle_cad,p_bar\n"])
@pytest.mark.parametrize("read", [read_pressure, read_plain_text, lambda file: next(pressure_chunks(file))])
def test_a_file_of_holes_is_refused_before_it_is_in_memory(
    head: bytes, read: Callable[[Path], object], tmp_path: Path
) -> None:
    with (tmp_path / "a.csv").open("wb") as file:
        file.write(head)
        file.truncate(1 << 40)
    with pytest.raises(DataError, match=r"a\.csv: this is a binary file"):
        read(tmp_path / "a.csv")


# --- the process that reads ---------------------------------------------------------------------------------
@pytest.fixture
def log(tmp_path: Path) -> Path:
    np.savez(tmp_path / "log.npz", time_s=np.arange(50.0), duty=np.linspace(0.0, 1.0, 50))
    return tmp_path / "log.npz"


def test_threads_read_at_once(log: Path) -> None:
    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(lambda _: read_any_table(log).numbers(1), range(24)))
    for each in found:
        np.testing.assert_array_equal(each, np.linspace(0.0, 1.0, 50))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a fork")
def test_a_forked_process_reads_too(log: Path) -> None:
    """As workers of multiprocessing and Dask do, while their parent goes on."""
    script = (
        "import os, sys; from mgdd.io.any_table import read_any_table as read\n"
        "read(sys.argv[1]); pid = os.fork()\n"
        "total = sum(read(sys.argv[1]).numbers(1).sum() for _ in range(3))\n"
        "if pid: os._exit(0 if os.waitpid(pid, 0)[1] == 0 and round(total) == 75 else 1)\n"
        "os._exit(0 if round(total) == 75 else 1)"
    )
    assert subprocess.run([sys.executable, "-c", script, str(log)], timeout=60, check=False).returncode == 0


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes in /proc")
def test_ctrl_c_leaves_no_process(tmp_path: Path) -> None:
    """While a reader walks in a circle."""
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as content:
        content["duty"] = np.arange(20.0)
    whole = (tmp_path / "a.h5").read_bytes()
    node = whole.index(b"TREE")
    (tmp_path / "a.h5").write_bytes(whole[: node + 16] + node.to_bytes(8, "little") + whole[node + 24 :])
    script = "import sys; from mgdd.io.any_table import read_any_table as read; print(1, flush=True); read(sys.argv[1])"
    caller = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "a.h5")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"MGDD_READ_LIMIT_S": "60"},
    )  # fmt: skip
    with caller:
        assert caller.stdout is not None
        assert caller.stderr is not None
        caller.stdout.readline()
        readers: set[int] = set()
        while not any(_forked(each) for each in readers):
            readers = _children(caller.pid)
            time.sleep(0.05)
        started = readers | {each for reader in readers for each in _children(reader)}
        caller.send_signal(signal.SIGINT)
        assert b"KeyboardInterrupt" in caller.stderr.read()
    ended = threading.Event()
    for _ in range(200):
        if not any(_runs(each) for each in started):
            break
        ended.wait(0.05)
    assert not any(_runs(each) for each in started)


def _children(pid: int) -> set[int]:
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
    except OSError:
        return set()
    return set(map(int, text.split()))


def _forked(pid: int) -> bool:
    return bool(_children(pid))


def _runs(pid: int) -> bool:
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except OSError:
        return False
