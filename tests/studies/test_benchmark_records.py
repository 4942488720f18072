"""Records of the benchmarks: fetched once, checked, and read as what they are."""

import hashlib
import http.server
import os
import sys
import threading
from functools import partial
from pathlib import Path

import pytest

from mgdd.errors import DataError, ParameterError
from mgdd_studies.benchmarks import records
from mgdd_studies.benchmarks.records import ORIGINS, Origin, names, read


def test_the_tanks_are_sampled_every_four_seconds(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    (tmp_path / "cascaded_tanks").mkdir()
    rows = '"uEst","uVal","yEst","yVal","Ts",\n3.2,0.9,5.2,4.9,4,\n3.3,1.0,5.3,4.8,,\n3.4,1.1,5.4,4.7,,\n'
    (tmp_path / "cascaded_tanks" / "dataBenchmark.csv").write_text(rows)
    first, second = read("cascaded_tanks")
    assert first["time_s"].values.tolist() == second["time_s"].values.tolist() == [0.0, 4.0, 8.0]
    assert (first["pump_v"].values[1], second["level_v"].values[2]) == (3.3, 4.7)


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        """Say nothing."""


class Server:
    """A folder on this machine, served over HTTP."""

    def __init__(self, folder):
        handler = partial(Quiet, directory=str(folder))
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self.server.server_port}"


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A set of two files with known hashes, and an empty cache."""
    pytest.importorskip("pooch")
    folder = tmp_path / "served"
    folder.mkdir()
    files = {"a.csv": b"t,u\n0,1\n", "b.csv": b"t,u\n0,2\n"}
    for file, content in files.items():
        (folder / file).write_bytes(content)
    server = Server(folder)
    origins = {
        "moon": {f: Origin(f"{server.url}/{f}", hashlib.sha256(content).hexdigest()) for f, content in files.items()}
    }
    monkeypatch.setattr(records, "ORIGINS", origins)
    monkeypatch.setattr(records, "_READERS", {"moon": lambda *files: files})
    monkeypatch.setenv("MGDD_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path / "own"))
    yield folder
    server.server.shutdown()
    server.server.server_close()


def test_a_set_is_fetched_once_and_found(served, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"or fetch it: .*records\.read\('moon', fetch=True\)"):
        read("moon")
    assert names() == ()
    kept = tmp_path / "cache" / "moon"
    assert read("moon", fetch=True) == (kept / "a.csv", kept / "b.csv")
    assert (kept / "a.csv").read_bytes() == b"t,u\n0,1\n"
    assert names() == ("moon",)
    for file in served.iterdir():
        file.unlink()
    assert read("moon", fetch=True) == read("moon") == (kept / "a.csv", kept / "b.csv")
    own = tmp_path / "own" / "moon" / "a.csv"
    own.parent.mkdir(parents=True)
    own.write_text("mine")
    assert read("moon") == (own, kept / "b.csv")


def test_another_file_is_refused_and_a_right_one_follows(served):
    good = (served / "b.csv").read_bytes()
    (served / "b.csv").write_bytes(b"changed")
    with pytest.raises(DataError, match=r"b\.csv: is not the known file"):
        read("moon", fetch=True)
    assert names() == ()
    (served / "b.csv").unlink()
    with pytest.raises(DataError, match=r"b\.csv: cannot be fetched: .*put the file into \$MGDD_DATA_DIR/moon by hand"):
        read("moon", fetch=True)
    (served / "b.csv").write_bytes(good)
    read("moon", fetch=True)
    assert names() == ("moon",)


@pytest.mark.usefixtures("served")
def test_without_pooch_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(ImportError, match=r"pip install 'mgdd\[datasets\]'"):
        read("moon", fetch=True)
    assert names() == ()


@pytest.mark.parametrize(("name", "file"), [(name, file) for name, files in ORIGINS.items() for file in files])
def test_the_known_hashes_are_those_of_the_records_at_hand(name, file):
    folder = os.environ.get("MGDD_DATA_DIR")
    if not folder or not (Path(folder) / name / file).is_file():
        pytest.skip(f"{name}/{file} is not at hand")
    assert hashlib.sha256((Path(folder) / name / file).read_bytes()).hexdigest() == ORIGINS[name][file].sha256
    assert ORIGINS[name][file].url.endswith(file)


def test_an_unknown_set_is_refused():
    with pytest.raises(ParameterError, match="must be one of cascaded_tanks, emps, wh2009"):
        read("h2df_502")
