"""Plain tables: CSV by column names, and files that are not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mgdd
from mgdd import datasets, io, presets
from mgdd.cli.main import main
from mgdd.engine import Cylinder, OperatingPoint, simulate, timing_sweep
from mgdd.identify import load_throttle_model
from mgdd.io.parameters import ParameterFile
from mgdd.io.plain_csv import write_traces
from mgdd.io.point_table import read_conditions
from mgdd.optimize import Seeker
from mgdd.throttle import SensorPair, Throttle, simulate_throttle

DATA = sorted((Path(mgdd.__file__).parent / "data").glob("*.csv"))


def throttle_run() -> xr.Dataset:
    return simulate_throttle(Throttle(), 0.2 * np.sin(6.0 * np.arange(1500) * 1e-3), supply_v=12.0)


def of_pressure(path: Path) -> xr.Dataset:
    trace = datasets.read("hd_diesel_128x144")[0]
    io.write_csv(trace, path)
    return trace


def of_log(path: Path) -> xr.Dataset:
    run = throttle_run()
    log = io.throttle_log(run["time_s"], run["duty"], run["angle_deg"], current_a=run["current_a"])
    io.write_csv(log, path)
    return log


def of_traces(dataset: Callable[[], xr.Dataset]) -> Callable[[Path], xr.Dataset]:
    def write(path: Path) -> xr.Dataset:
        made = dataset()
        write_traces(made, path)
        return made

    return write


WRITERS = {
    "write_csv, trace": of_pressure,
    "write_csv, log": of_log,
    "cycle": of_traces(lambda: simulate(Cylinder(), OperatingPoint())),
    "throttle": of_traces(throttle_run),
    "flags and NaN": of_traces(lambda: SensorPair().sense(throttle_run())),
    "sweep": of_traces(lambda: timing_sweep(Cylinder(), OperatingPoint())),
}
COMMANDS = {
    "engine simulate": ["engine", "simulate"],
    "engine optimum": ["engine", "optimum"],
    "throttle simulate": ["throttle", "simulate", "--duty", "0.3", "--duration-s", "0.1"],
    "throttle excite": ["throttle", "excite", "chirp", "--preset", "P1"],
    "engine seek": ["engine", "seek", "--cycles", "30"],
}


@pytest.mark.parametrize("file", DATA, ids=lambda path: path.name)
def test_packaged_tables(file: Path) -> None:
    table = pd.read_csv(file)
    assert not table.isna().any(axis=None)
    numbers = table.drop(columns="file", errors="ignore")
    assert all(np.issubdtype(kind, np.number) for kind in numbers.dtypes)
    assert all(name.isidentifier() for name in table.columns)


@pytest.mark.parametrize("name", WRITERS)
def test_written_tables(name: str, tmp_path: Path) -> None:
    dataset = WRITERS[name](tmp_path / "out.csv")
    table = pd.read_csv(tmp_path / "out.csv")
    assert len(table.columns) > 1
    for column in table.columns:
        written = dataset[column].to_numpy().astype(np.float64)
        np.testing.assert_allclose(table[column], written, rtol=1e-14, err_msg=column)


@pytest.mark.parametrize("name", COMMANDS)
def test_tables_of_the_command_line(name: str, tmp_path: Path) -> None:
    assert main([*COMMANDS[name], "--output", str(tmp_path / "out.csv")]) == 0
    table = pd.read_csv(tmp_path / "out.csv")
    assert len(table) > 10
    assert all(np.issubdtype(kind, np.number) for kind in table.dtypes)


READERS: dict[str, tuple[Callable[[Path], Any], str, str]] = {
    "pressure": (io.read_pressure, "mean.csv", "maen.csv"),
    "conditions": (read_conditions, "conditions.csv", "condition.csv"),
    "log": (io.read_throttle_log, "chirp.csv", "chrip.csv"),
    "MATLAB log": (io.read_throttle_log, "chirp.mat", "chrip.mat"),
    "parameters": (ParameterFile.read, "lag.toml", "lagg.toml"),
    "model": (load_throttle_model, "fit.toml", "fits.toml"),
    "preset": (presets.load, "mine.toml", "mime.toml"),
    "seeker": (Seeker.load, "seeker.json", "seker.json"),
}


@pytest.mark.parametrize("kind", READERS)
def test_the_nearest_name_is_asked_for(kind: str, tmp_path: Path) -> None:
    read, there, meant = READERS[kind]
    (tmp_path / there).write_bytes(b"?")
    with pytest.raises(FileNotFoundError, match=f"did you mean '{there}'"):
        read(str(tmp_path / meant))  # type: ignore[arg-type]
    with pytest.raises(ValueError):  # noqa: PT011 - it is read then, and refused for what is in it
        read(str(tmp_path / there))  # type: ignore[arg-type]


@pytest.mark.parametrize("path", ["lost.csv", "no folder/chirp.csv"])
def test_where_no_name_is_near_the_path_is_to_be_checked(path: str, tmp_path: Path) -> None:
    (tmp_path / "chirp.csv").touch()
    with pytest.raises(FileNotFoundError, match="no such file: check the path") as caught:
        io.read_throttle_log(tmp_path / path)
    assert caught.value.filename == str(tmp_path / path)


def test_the_command_line_says_it_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mean.csv").touch()
    assert main(["engine", "analyze", str(tmp_path / "meen.csv"), "--preset", "puma_single"]) == 2
    assert f"error: {tmp_path / 'meen.csv'}: no such file: did you mean 'mean.csv'?" in capsys.readouterr().err
