"""A file that is not there: every reader names the one of the folder whose name is nearest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mgdd import io, presets
from mgdd.cli.main import main
from mgdd.identify import load_throttle_model
from mgdd.io.parameters import ParameterFile
from mgdd.io.point_table import read_conditions
from mgdd.optimize import Seeker

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
