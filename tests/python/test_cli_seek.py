"""`mgdd engine seek`: it arrives where the steady map says, keeps limits, and says what is wrong with an option."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.engine import Performance
from mgdd.loop import EngineBench, LoopCriteria, run_seeker
from mgdd.loop.timing_search import TimingSearch
from mgdd.optimize import ExtremumSeeking

METHODS = ("extremum_seeking", "newton", "bounded", "spsa", "golden")
SEEDS = range(3)


def seek(capsys: pytest.CaptureFixture[str], *argv: str) -> dict[str, object]:
    code = main(["engine", "seek", *argv, "--json"])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    return json.loads(captured.out)


def refused(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 2) -> str:
    assert main(["engine", "seek", *argv]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_steady_optimum(method: str, capsys: pytest.CaptureFixture[str]) -> None:
    best = EngineBench().find_optimum()
    runs = [seek(capsys, "--method", method, "--seed", str(seed)) for seed in SEEDS]
    for run in runs:
        assert run["optimum_cad"] == best["soc_cad"]
        assert run["cycles"] == 2000
        assert (run["limit_report"], run["warnings"], run["start_reason"]) == ({}, [], "default")
        assert run["mean_j"] == run["mean_efficiency_percent"] < best.value
        assert 0 < run["cycles_to_1_cad"] < 1000
        assert run["rms_cad"] < 1.2
    assert np.mean([run["final_cad"] for run in runs]) == pytest.approx(best["soc_cad"], abs=1.0)
    assert len({run["final_cad"] for run in runs}) == len(runs)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_keeps_the_pressure_limit(method: str, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [seek(capsys, "--method", method, "--seed", str(seed), "--limit", "p_max_bar=95") for seed in SEEDS]
    assert runs[0]["optimum_cad"] == pytest.approx(-3.08, abs=0.01)
    assert runs[0]["free_optimum_cad"] == pytest.approx(-5.63, abs=0.01)
    assert runs[0]["limits"] == {"p_max_bar": 95.0}
    kept = [run["limit_report"]["p_max_bar"] for run in runs]
    assert np.mean([own["judged_above_threshold_fraction"] for own in kept]) < 0.01
    # The dither stays below the limit, so its mean lies on the late side.
    assert -0.1 < np.mean([run["final_cad"] - run["optimum_cad"] for run in runs]) < 1.25


@pytest.mark.parametrize("how", ["penalty", "barrier"])
def test_limits_known_to_j_are_kept_as_well(how: str, capsys: pytest.CaptureFixture[str]) -> None:
    run = seek(capsys, "--limit", "p_max_bar=95", "--limit", "dp_max_bar_per_cad=8", "--limit-method", how)
    assert run["limit_method"] == how
    assert {name: own["judged_above_threshold_fraction"] for name, own in run["limit_report"].items()} == {
        "p_max_bar": 0.0,
        "dp_max_bar_per_cad": 0.0,
    }
    assert abs(run["final_cad"] - run["optimum_cad"]) < 1.5
    plain = seek(capsys, "--limit", "p_max_bar=95", "--limit", "dp_max_bar_per_cad=8")
    assert run["final_cad"] != plain["final_cad"]


@pytest.mark.parametrize(
    ("method", "form"), [("extremum_seeking", f) for f in ("batch", "moving_average", "washout")] + [("newton", None)]
)
def test_seekers_behind_the_analyser_arrive(method: str, form: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    bench = EngineBench(performance=Performance.efficiency_and_nox(), nox_sensor="analyser")
    option = [] if form is None else ["--form", form]
    run = seek(capsys, "--sensor", "analyser", "--method", method, *option)
    assert run["optimum_cad"] == bench.find_optimum()["soc_cad"]
    assert run["cycles"] == 16 * 4 * 76  # a period of 76: a fifth of 38 + 25 cycles turns it by 60 deg
    assert run["final_cad"] == pytest.approx(run["optimum_cad"], abs=1.0)
    assert run["rms_cad"] < 0.6
    assert run["mean_nox_ppm"] < 1300.0


def test_a_curve_behind_the_analyser_guides_each_component(capsys: pytest.CaptureFixture[str]) -> None:
    rough = ("--guide", "curve", "--guide-set", "wall_heat_scale=0.25")
    run = seek(capsys, "--sensor", "analyser", *rough, "--limit", "p_max_bar=100")
    assert (run["guide"], run["cycles"]) == ("curve", 2000)
    assert run["start_cad"] != run["optimum_cad"]
    assert run["final_cad"] == pytest.approx(run["optimum_cad"], abs=2.0)
    assert run["late_loss_percent"] < 0.15


def test_the_period_follows_the_lag_of_the_speed(capsys: pytest.CaptureFixture[str]) -> None:
    run = seek(capsys, "--sensor", "analyser", "--speed-rpm", "4000", "--fuel-mg", "25", "--seed", "2")
    assert run["cycles"] > 8000  # the lag lasts 67 cycles here, 25 at 1500 rpm
    assert run["final_cad"] == pytest.approx(run["optimum_cad"], abs=1.0)


def test_the_soft_sensor_needs_no_patience(capsys: pytest.CaptureFixture[str]) -> None:
    for method in METHODS:
        run = seek(capsys, "--sensor", "soft", "--method", method, "--preset", "hd_diesel_128x144", "--misfire", "0.01")
        assert (run["cycles"], run["preset"]) == (2000, "hd_diesel_128x144")
        assert run["final_cad"] == pytest.approx(run["optimum_cad"], abs=1.5)
        assert 5 <= run["misfires"] <= 45


def test_it_is_the_library_run(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    argv = ("--seed", "7", "--cycles", "1500", "--start-cad", "-12", "--form", "moving_average", "-o", str(file))
    out = seek(capsys, *argv)
    bench = EngineBench(seed=7)
    best = bench.find_optimum()
    seeker = ExtremumSeeking(
        start=-12.0, lower=-30.0, upper=10.0, form="moving_average", gain=2.0 / (abs(best.curvature) * 40.0)
    )
    run = run_seeker(bench, seeker, 1500, criteria=LoopCriteria(optimum=best["soc_cad"]))
    assert out["final_cad"] == run.summary["final_cad"]
    assert out["rms_cad"] == run.summary["rms_cad"]
    assert out["cycles_to_1_cad"] == run.summary["cycles_to"]
    header, *rows = file.read_text().splitlines()
    columns = header.split(",")
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    np.testing.assert_array_equal(table[:, columns.index("estimate_cad")], run.dataset["estimate_cad"])
    np.testing.assert_array_equal(table[:, columns.index("p_max_bar")], run.dataset["p_max_bar"])


def test_a_run_that_never_arrives_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    out = seek(capsys, "--cycles", "20")
    assert out["cycles_to_1_cad"] is None
    assert main(["engine", "seek", "--cycles", "20"]) == 0
    assert "cycles_to_1_cad                           –" in capsys.readouterr().out


def test_cov_of_imep_can_be_a_limit(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    out = seek(capsys, "--limit", "cov-imep-percent=1.0", "-o", str(file))
    assert out["limits"] == {"cov_imep_percent": 1.0}
    own = out["limit_report"]["cov_imep_percent"]
    assert own["judged_above_threshold_fraction"] < 0.02
    assert own["threshold_with_margin"] == pytest.approx(1.0 + 3.0 / math.sqrt(98.0))
    assert own["noise_free"] is None
    assert (out["start_cad"], out["start_reason"]) == (-20.0, "default; no limit has a noise-free value to choose by")
    assert file.read_text().splitlines()[0].endswith(",cov_imep_percent")
    message = refused(capsys, "--limit", "cov_imep_percent=0.1", code=3)
    assert "cov_imep_percent=0.1: the bench has 0.4" in message


def test_an_explicit_start_above_a_limit_counts_from_the_first_cycle_and_is_doubted(
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    file = tmp_path / "run.csv"
    argv = ("--start-cad", "-20", "--limit", "p_max_bar=95", "--limit", "dp_max_bar_per_cad=2.6", "-o", str(file))
    out = seek(capsys, *argv)
    header, *rows = file.read_text().splitlines()
    pressure = np.array([float(row.split(",")[header.split(",").index("p_max_bar")]) for row in rows])
    own = out["limit_report"]["p_max_bar"]
    assert own["worst"] == pressure.max() > 150.0
    assert own["worst_cycle"] == pressure.argmax() < 20
    assert (own["above_cycles"], own["above_fraction"]) == ((pressure > 95.0).sum(), (pressure > 95.0).mean())
    assert out["judged_from"] == 1000
    assert own["judged_above_fraction"] == (pressure[1000:] > 95.0).mean() < own["above_fraction"]
    assert own["threshold_with_margin"] == 95.0 + own["scatter_margin"] > 97.0
    assert own["judged_above_threshold_fraction"] == (pressure[1000:] > own["threshold_with_margin"]).mean()
    assert own["noise_free"]["worst"] == pytest.approx(EngineBench().steady_map([-20.0])["p_max_bar"].item(), rel=1e-12)
    assert own["noise_free"]["judged_above_cycles"] < own["judged_above_cycles"]
    assert out["limit_report"]["dp_max_bar_per_cad"]["above_cycles"] > 10
    assert out["start_reason"] == "as given"
    assert [text.split(" = ")[0] for text in out["warnings"]] == [
        "the first reading has p_max_bar",
        "the first reading has dp_max_bar_per_cad",
    ]
    assert f"{pressure[0]:.6g}, above the limit 95, at -20.00 °CA aTDC: leave --start-cad out" in caplog.text


def test_the_text_names_worst_cycle_share_and_what_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["engine", "seek", "--start-cad", "-20", "--limit", "p_max_bar=95", "--cycles", "300"]) == 0
    measured, free = capsys.readouterr().out.splitlines()[-2:]
    assert measured.startswith("p_max_bar as measured: worst 159.953 in cycle 0; above 95 in ")
    for part in (" %), from cycle 150 on in ", " % above 98.65", "plus 3 standard deviations of the scatter"):
        assert part in measured
    assert free.startswith("p_max_bar noise-free at the applied timing: worst 161.019 in cycle 0; above 95 in ")


@pytest.mark.parametrize(("method", "move"), [("extremum_seeking", 1.0), ("newton", 1.2), ("bounded", 0.0)])
def test_a_limit_moves_the_default_start_to_the_late_side(
    method: str, move: float, capsys: pytest.CaptureFixture[str]
) -> None:
    out = seek(capsys, "--method", method, "--limit", "p_max_bar=95", "--cycles", "100")
    start = out["start_cad"]
    early, earlier = EngineBench().steady_map([start - move, start - move - 0.1])["p_max_bar"].to_numpy()
    assert early <= 0.9 * 95.0 < earlier  # the earliest timing that keeps the margin with its dither
    assert start > out["optimum_cad"]
    assert "earliest start from which on the noise-free values stay 10 % below" in out["start_reason"]
    assert out["warnings"] == []
    assert out["limit_report"]["p_max_bar"]["worst_cycle"] > 0


@pytest.mark.parametrize(
    ("argv", "start", "reason"),
    [
        (["--limit", "p_max_bar=200"], -20.0, "default; the noise-free values stay 10 % below"),
        (["--limit", "p_max_bar=175"], -17.8, "earliest start from which on"),
        (["--limit", "p_max_bar=75"], None, "start with the lowest values; there is none"),
        (["--limit", "p_max_bar=95", "--method", "golden"], -20.0, "golden section tries the whole range"),
        (["--limit", "p_max_bar=95", "--start-cad", "-8"], -8.0, "as given"),
    ],
)
def test_where_a_run_under_a_limit_starts(
    argv: list[str], start: float | None, reason: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    out = seek(capsys, *argv, "--cycles", "40")
    if start is not None:
        assert out["start_cad"] == start
    if reason is not None:
        assert reason in out["start_reason"]
    assert len(out["warnings"]) == (argv[-1] in ("golden", "-8"))


def test_figure(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "run.png"
    seek(capsys, "--figure", str(file), "--limit", "p_max_bar=95", "--misfire", "0.01", "--cycles", "300")
    assert file.read_bytes().startswith(b"\x89PNG")
    assert "--figure run.bmp" in refused(capsys, "--figure", "run.bmp")
    assert "does not exist; make it" in refused(capsys, "--figure", "nowhere/run.png")


def test_bounds_by_name_are_those_of_lower_and_upper(capsys: pytest.CaptureFixture[str]) -> None:
    by_name = seek(capsys, "--input", "soc_cad=-22:-9", "--cycles", "300")
    assert by_name == seek(capsys, "--lower-cad", "-22", "--upper-cad", "-9", "--cycles", "300")
    assert -10.0 <= by_name["final_cad"] < -9.0  # the free optimum is -5.6


@pytest.mark.parametrize(
    ("wrong", "right", "message", "code"),
    [
        (["--start-cad", "-29.5"], ["--start-cad", "-29"], "--start-cad -29.5: must be in [-29, 9]", 2),
        (["--start-cad", "11", "--method", "golden"], ["--start-cad", "9"], "must be in [-30, 10]", 2),
        (["--start-cad", "nan"], ["--start-cad", "-8"], "--start-cad nan", 2),
        (["--lower-cad", "-61"], ["--lower-cad", "-60"], "--lower-cad -61: must be in [-60, 20]", 2),
        (
            ["--upper-cad", "-25", "--start-cad", "-20"],
            ["--upper-cad", "-25"],
            "--start-cad -20: must be in [-29, -26]",
            2,
        ),
        (["--upper-cad", "-30"], ["--upper-cad", "0"], "--lower-cad -30: must be below --upper-cad -30", 2),
        (
            ["--input", "soc_cad=-61:5"],
            ["--input", "soc_cad=-60:5"],
            "--input soc_cad=-61:5: -61 must be in [-60, 20], the window of the bench",
            2,
        ),
        (["--input", "soc_cad=5:-25"], ["--input", "soc-cad=-25:5"], "LOW and HIGH must be finite and LOW < HIGH", 2),
        (["--input", "soc_cad=-25:5:7"], ["--input", "soc_cad=-25:5"], "write NAME=LOW:HIGH", 2),
        (["--input", "soc_cad"], ["--input", "soc_cad=-25:5"], "--input soc_cad: write NAME=LOW:HIGH", 2),
        (["--input", "boost=0:9"], ["--input", "soc_cad=-25:5"], "--input boost: the bench has soc_cad, intake_", 2),
        (["--input", "soc=-25:5"], ["--input", "soc_cad=-25:5"], "did you mean 'soc_cad'?", 2),
        (
            ["--input", "soc_cad=-25:5", "--upper-cad", "5"],
            ["--upper-cad", "5"],
            "--input soc_cad and --upper-cad contradict each other: give one",
            2,
        ),
        (
            ["--input", "soc_cad=-25:5", "--input", "soc_cad=-20:5"],
            ["--input", "soc_cad=-25:5"],
            "--input soc_cad is given twice",
            2,
        ),
        (["--cycles", "0"], ["--cycles", "1"], "--cycles 0: must be in [1, ", 2),
        (["--cycles", "-5"], ["--cycles", "1"], "--cycles -5", 2),
        (["--seed", "-1"], ["--seed", "1"], "--seed -1: must be in [0, 2**64)", 2),
        (["--misfire", "1.5"], ["--misfire", "0.5"], "--misfire 1.5: must be in [0, 1]", 2),
        (["--noise", "-1"], ["--noise", "0"], "--noise -1 %: must be in [0, 20]", 2),
        (["--soc-scatter-cad", "6"], ["--soc-scatter-cad", "5"], "--soc-scatter-cad 6 °CA: must be in [0, 5]", 2),
        (["--limit", "p_maxx=95"], ["--limit", "p_max_bar=95"], "--limit 'p_maxx' is not measured: must be one of", 2),
        (["--limit", "p_max_bar"], ["--limit", "p_max_bar=95"], "write NAME=NUMBER", 2),
        (["--limit", "p_max_bar=nan"], ["--limit", "p_max_bar=95"], "p_max_bar=nan: must be finite", 2),
        (["--limit", "p_max_bar=20"], ["--limit", "p_max_bar=85"], "no soc_cad in [-30, 10] keeps", 3),
        (["--limit-method", "barrier"], ["--limit-method", "barrier", "--limit", "p_max_bar=95"], "--limit NAME=X", 2),
        (["--form", "batch", "--method", "spsa"], ["--form", "batch"], "--method extremum_seeking only", 2),
        (
            ["--method", "gaussian_process_seeking", "--limit", "p_max_bar=95", "--limit-method", "barrier"],
            ["--method", "gaussian_process_seeking", "--limit", "p_max_bar=95", "--cycles", "20"],
            "--limit-method does not act here",
            2,
        ),
        (["--sensor", "analyser", "--method", "spsa"], ["--method", "spsa"], "use --sensor soft", 2),
        (["--sensor", "analyser", "--method", "golden"], ["--method", "golden"], "use --sensor soft", 2),
        (["--sensor", "analyser", "--method", "bounded"], ["--method", "bounded"], "use --sensor soft", 2),
        (["--motored"], [], "leave --motored out", 2),
        (["--preset", "nonesuch"], ["--preset", "puma_single"], "nonesuch", 2),
        (["--set", "bore_mm=-1"], ["--set", "bore_mm=80"], "bore_mm = -1", 2),
        (["-o", "run.txt"], [], "-o run.txt: the ending", 2),
    ],
)
def test_wrong_then_right(
    wrong: list[str], right: list[str], message: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    short = ["--cycles", "40"]
    assert message in refused(capsys, *([] if "--cycles" in wrong else short), *wrong, code=code)
    out = seek(capsys, *([] if "--cycles" in right else short), *right)
    assert math.isfinite(out["final_cad"])


def test_help_names_the_default_length(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["engine", "seek", "--help"])
    assert stop.value.code == 0
    assert "4000 at least" in " ".join(capsys.readouterr().out.split())


@pytest.mark.skipif(os.name != "posix", reason="needs SIGINT")
def test_ctrl_c_leaves_the_cycles_so_far(tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    program = (
        "import pathlib, sys\n"
        "import mgdd.loop.timing_search as seek\n"
        "run = seek.run_seeker\n"
        "def told(*args, **kwargs):\n"
        f"    pathlib.Path({str(ready)!r}).touch()\n"
        "    return run(*args, **kwargs)\n"
        "seek.run_seeker = told\n"
        "from mgdd.cli import main\n"
        "sys.exit(main(['engine', 'seek', '--cycles', '2000000', '--json']))\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        while not ready.exists() and process.poll() is None:
            time.sleep(0.02)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err.decode()
    result = json.loads(out)
    assert result["interrupted"] is True
    assert 0 <= result["cycles"] < 2_000_000
    if result["cycles"] >= 1000:
        assert abs(result["final_cad"] - result["optimum_cad"]) < 4.0
    assert f"interrupted: {result['cycles']} of 2000000 cycles are kept".encode() in err


@pytest.mark.parametrize(("bounds", "start"), [((-20.0, 5.0), -19.0), ((-12.0, 9.0), -11.0), ((-50.0, -24.0), -25.0)])
def test_a_start_that_is_left_out_lies_within_the_bounds(bounds: tuple[float, float], start: float) -> None:
    search = TimingSearch(bench=EngineBench(seed=1), lower_cad=bounds[0], upper_cad=bounds[1], cycles=20)
    assert search.run().start_cad == start  # as near to -20 as the dither of 1 leaves
