"""Figures of chunks of cycles are those of the whole record, also of one that memory does not hold."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.cli.main import main
from mgdd.engine import Indicating, analyze, simulate
from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_chunks, pressure_trace, read_pressure
from mgdd.results.labels import ANGLE

COUNT = 31


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Fired cycles with two that do not burn, and one whose level is off; too long to be read at once."""
    monkeypatch.setattr("mgdd.io.chunks._ROWS", 1000)
    monkeypatch.setattr("mgdd.io.chunks._BLOCK", 5000)
    fuel = [0.0 if k in (4, 25) else 20.0 + 0.3 * (k % 7) for k in range(COUNT)]
    runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0) for mg in fuel]
    pressure = np.array([run["pressure_bar"] for run in runs])
    pressure[20, 210] += 3.0
    rows = np.column_stack([np.tile(runs[0][ANGLE], COUNT), pressure.ravel()])
    np.savetxt(tmp_path / "bench.csv", rows, delimiter=",", header="angle,p", comments="")
    return tmp_path / "bench.csv"


def test_figures_of_chunks_are_those_of_the_whole(record: Path) -> None:
    options: dict[str, Any] = {"keep_traces": False, "gamma": 1.2, "fuel_mg": 40.0, "quiet": True}
    whole = analyze(read_pressure(record), "puma_single", **options)
    parts = analyze(pressure_chunks(record, cycles=8), "puma_single", **options)
    xr.testing.assert_identical(parts, whole)
    assert np.flatnonzero(whole["misfire"]).tolist() == [4, 25]
    assert "1 of 31 cycles: the sample at" in whole.attrs["warnings"]
    assert "(cycle 21)" in whole.attrs["warnings"]


def test_the_spectrum_of_chunks_is_that_of_the_whole() -> None:
    """The second chunk alone rings."""
    run = simulate("puma_single", {"fuel_mg": 20.0}, soc_cad=-5.0, step_cad=0.2)
    ms = np.maximum(run[ANGLE].to_numpy() - 4.0, 0.0) / 9.0
    wave = np.exp(-ms) * np.sin(2.0 * np.pi * 6.5 * ms)
    loud = np.array([0.0, 0.0, 0.0, 1.0, 2.0])[:, None]
    whole = pressure_trace(run[ANGLE], run["pressure_bar"].to_numpy() + loud * wave).assign_attrs(speed_rpm=1500.0)
    options: dict[str, Any] = {"keep_traces": False, "quiet": True, "knock_threshold_bar": 0.5}
    figures = [
        analyze(each, "puma_single", **options)
        for each in (whole, iter([whole.isel(cycle=slice(0, 3)), whole.isel(cycle=slice(3, None))]))
    ]
    assert float(figures[0]["ringing_frequency_khz"]) == pytest.approx(6.5, rel=0.01)
    assert float(figures[0]["knock_share_percent"]) == 40.0
    xr.testing.assert_allclose(figures[1], figures[0], rtol=1e-12)


def test_chunks_give_no_traces(record: Path) -> None:
    with pytest.raises(ParameterError, match=r"keep_traces = True: .*pass keep_traces=False"):
        analyze(pressure_chunks(record), "puma_single")
    with pytest.raises(DataError, match="no chunk: each must be pressure_bar"):
        analyze(iter([]), "puma_single", keep_traces=False)
    other = [next(pressure_chunks(record, cycles=4)).isel({ANGLE: slice(k, None)}) for k in (0, 1)]
    with pytest.raises(DataError, match="the chunk from cycle 5 on has other crank angles"):
        analyze(iter(other), "puma_single", keep_traces=False)


def test_a_cycle_that_is_refused_is_counted_from_the_first_chunk_on(record: Path) -> None:
    chunks = list(pressure_chunks(record, cycles=8))
    chunks[2]["pressure_bar"][3, 40] = np.nan
    with pytest.raises(DataError, match=r"from cycle 17 on, .*cycle 4"):
        analyze(iter(chunks), "puma_single", keep_traces=False)


def test_indicating_takes_chunk_after_chunk(record: Path) -> None:
    whole = read_pressure(record)
    indicating = Indicating("puma_single", whole[ANGLE], speed_rpm=1500.0)
    parts = [indicating.record(each["pressure_bar"])["imep_net_bar"] for each in pressure_chunks(record, cycles=8)]
    np.testing.assert_array_equal(np.concatenate(parts), indicating.record(whole["pressure_bar"])["imep_net_bar"])


def test_the_command_reads_in_chunks(record: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["engine", "analyze", str(record), "--preset", "puma_single", "--json"]
    assert main(command) == 0
    whole = capsys.readouterr().out
    assert main([*command, "--chunk-cycles", "8", "-o", str(tmp_path / "cycles.csv")]) == 0
    assert capsys.readouterr().out == whole
    assert len((tmp_path / "cycles.csv").read_text().splitlines()) == 1 + COUNT
    assert main([*command, "--chunk-cycles", "8", "--tdc"]) == 2
    assert "--chunk-cycles and --tdc, which needs the whole record, contradict each other" in capsys.readouterr().out
    assert main([*command, "--chunk-cycles", "0"]) == 2
    assert "--chunk-cycles = 0: must be >= 1" in capsys.readouterr().out


# --- memory -------------------------------------------------------------------------------------------------
LIMITED = """
import resource, sys
import numpy, scipy.signal, xarray
from mgdd.engine import analyze, simulate
from mgdd.errors import DataError
from mgdd.io import pressure_chunks, pressure_trace, read_pressure
from mgdd.io.any_table import read_any_table
simulate("puma_single", {"speed_rpm": 1500.0})
small, file = sys.argv[1:]
options = dict(keep_traces=False, quiet=True)
analyze(pressure_chunks(small, cycles=10), "puma_single", **options)
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
limit = 1024 * int(status["VmSize"].split()[0]) + 50_000_000
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
print(int(analyze(pressure_chunks(file, cycles=10), "puma_single", **options).attrs["cycles"]))
try:
    read_pressure(file)
except MemoryError:
    print("too large")
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.skipif("libasan" in os.environ.get("LD_PRELOAD", ""), reason="its allocator ends the process")
def test_a_record_that_memory_does_not_hold_becomes_figures(tmp_path: Path) -> None:
    cad = np.arange(-360.0, 360.0, 0.4)
    pressure = 1.2 + 45.0 * np.exp(-(((cad - 8.0) / 35.0) ** 2))
    body = "".join(f"{a!r},{p!r}\n" for a, p in zip(cad.tolist(), pressure.tolist(), strict=True))
    for name, count in (("small.csv", 40), ("large.csv", 1200)):
        with (tmp_path / name).open("w") as stream:
            stream.write("angle,p\n")
            stream.writelines(itertools.repeat(body, count))
    files = [str(tmp_path / name) for name in ("small.csv", "large.csv")]
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, *files], capture_output=True, text=True, env={**os.environ, **threads}
    )
    assert done.stdout.split("\n")[:2] == ["1200", "too large"], done.stderr
