"""`mgdd map design --within`: new points stay between those that were driven."""

from pathlib import Path

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.design import FeasibleRegion, design_points
from typed import Capsys, ran

RANGES = {"speed_rpm": (900.0, 3100.0), "fuel_mg": (6.0, 30.0)}
OVER = ["--over", "speed_rpm=900:3100", "--over", "fuel_mg=6:30", "--points", "12", "--seed", "4"]
DRIVEN = {"speed_rpm": [900.0, 900.0, 2000.0, 3100.0, 3100.0], "fuel_mg": [6.0, 20.0, 30.0, 24.0, 6.0]}
REFUSED = {"speed_rpm": [900.0, 3100.0], "fuel_mg": [22.0, 25.0]}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, columns in {"driven": DRIVEN, "refused": REFUSED}.items():
        rows = zip(columns["fuel_mg"], columns["speed_rpm"], strict=True)  # columns in another order than the factors
        text = "\n".join(f"{fuel:g},{speed:g},ok" for fuel, speed in rows)
        (tmp_path / f"{name}.csv").write_text(f"fuel_mg,speed_rpm,remark\n{text}\n")
    return tmp_path


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_the_region_is_that_of_the_library(margin: float, capsys: Capsys) -> None:
    region = FeasibleRegion.of_points(DRIVEN, margin=margin, infeasible=REFUSED)
    expected = design_points(RANGES, 12, feasible=region, seed=4)
    options = ["--within", "driven.csv", "--refused", "refused.csv", *(["--margin", "0.1"] if margin else [])]
    found = ran(capsys, "map", "design", *OVER, *options)
    assert found["within"] == "driven.csv"
    for name in RANGES:
        np.testing.assert_array_equal(found["columns"][name], expected[name])
    free = ran(capsys, "map", "design", *OVER)["columns"]
    assert not region.contains({name: free[name] for name in RANGES}).all()  # the region does act


@pytest.mark.usefixtures("here")
def test_limits_of_the_model_hold_as_well(capsys: Capsys) -> None:
    found = ran(capsys, "map", "design", *OVER, "--within", "driven.csv", "--limit", "p_max_bar=100")
    assert FeasibleRegion.of_points(DRIVEN).contains(found["columns"]).all()
    assert 0.0 < found["highest"]["p_max_bar"] <= 100.0
    wide = ran(capsys, "map", "design", *OVER, "--within", "driven.csv")
    assert found["feasible_share"] < wide["feasible_share"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--margin", "0.1"], "--margin does not act here; it is of the measured points of --within FILE"),
        (["--refused", "refused.csv"], "--refused does not act here"),
        (["--within", "driven.csv", "--margin", "0.7"], "--margin = 0.7: must be in [0, 0.5)"),
        (
            ["--within", "driven.csv", "--refused", "driven.csv"],
            "--refused: the point speed_rpm 900, fuel_mg 6 is also",
        ),
        (["--within", "drive.csv"], "drive.csv: no such file: did you mean 'driven.csv'?"),
        (["--within", "refused.csv"], "refused.csv: 2 points of 2 factors enclose nothing: at least 3 are needed"),
        (["--over", "soc_cad=-9:0", "--within", "driven.csv"], "driven.csv: no column 'soc_cad'"),
    ],
)
def test_what_is_refused(options: list[str], message: str, here: Path, capsys: Capsys) -> None:
    assert main(["map", "design", *OVER, *options, "-o", "design.csv"]) == 2
    assert message in capsys.readouterr().err
    assert not (here / "design.csv").exists()
