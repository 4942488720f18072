"""`mgdd engine sweep`: the table of the library in a file, and its figures beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd import presets
from mgdd.cli import main
from mgdd.sweep import sweep

OVER = ["--over", "soc_cad=-12:0:4", "--over", "bore-mm=80:90:3"]


def test_the_file_holds_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "table.nc"
    assert main(["engine", "sweep", *OVER, "--workers", "1", "-o", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cycles"] == 12
    assert told["cycles_per_s"] > 0.0
    assert told["shape"] == {"soc_cad": 4, "bore_mm": 3}
    assert told["file"] == str(file)
    preset = presets.load("puma_single")
    expected = sweep(preset.cylinder, preset.point, {"soc_cad": [-12, -8, -4, 0], "bore_mm": [80, 85, 90]})
    with xr.open_dataset(file, engine="scipy") as found:
        assert set(found.variables) == set(expected.variables)
        np.testing.assert_array_equal(found["p_max_bar"], expected["p_max_bar"])
    assert [path.name for path in tmp_path.iterdir()] == ["table.nc"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--over", "soc_cad=-12:0"], "write NAME=LOW:HIGH:N"),
        (["--over", "soc_cad=-12:0:x"], "write NAME=LOW:HIGH:N"),
        (["--over", "soc_cad=0:0:5"], "must be finite and differ"),
        (["--over", "soc_cad=0:inf:5"], "must be finite and differ"),
        ([*OVER, "--over", "soc_cad=0:1:2"], "--over soc_cad is given twice"),
        (["--over", "speed=1000:2000:3"], "did you mean 'speed_rpm'"),
        (["--over", "bore_mm=-1:80:3"], "bore_mm = -1 mm: must be > 0"),
        ([*OVER, "--workers", "0"], "must be >= 1"),
        ([*OVER, "--outputs", "p_max_ba"], "did you mean 'p_max_bar'"),
    ],
)
def test_bad_input_writes_nothing(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["engine", "sweep", *options, "-o", str(tmp_path / "table.nc")]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
