"""`mgdd engine seek`: it arrives where the steady map says, keeps limits, and says what is wrong with an option."""

import csv
import json
import math
import signal
import subprocess
import sys
import time
from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.cli.guide_map import learn_map
from mgdd.guide import FeedForward, TimingMap
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.maps import CalibrationMap, read_map, write_map
from mgdd.optimize import ExtremumSeeking
from typed import Capsys, commands

seek, refused = commands("engine", "seek")

DITHER = ("--seeker", "extremum_seeking")


def test_any_setting_of_a_seeker_can_be_said(capsys: Capsys) -> None:
    runs = [seek(capsys, *DITHER, "--seeker-set", f"form={form}", "--cycles", "300") for form in ("washout", "batch")]
    assert runs[0]["inputs"] != runs[1]["inputs"]
    said = refused(capsys, *DITHER, "--seeker-set", "forms=washout")
    assert "did you mean 'form'" in said


def test_a_curve_behind_the_analyser_guides_each_component(capsys: Capsys) -> None:
    rough = ("--guide", "curve", "--guide-set", "wall_heat_scale=0.25")
    run = seek(capsys, "--sensor", "analyser", *rough, "--limit", "p_max_bar=100")
    assert (run["guide"], run["seeker"]) == ("curve", "GaussianProcessSeeking")
    assert run["start"] != run["optimum"]
    assert run["inputs"]["soc_cad"] == pytest.approx(run["optimum"]["soc_cad"], abs=2.0)
    assert run["j_lost"] < 0.15


def test_the_period_follows_the_lag_of_the_speed(capsys: Capsys) -> None:
    argv = ("--sensor", "analyser", "--speed-rpm", "4000", "--fuel-mg", "25", "--seed", "2")
    run = seek(capsys, *argv, *DITHER)
    assert run["cycles"] > 8000  # the lag lasts 67 cycles here, 25 at 1500 rpm
    assert run["figures"]["final_soc_cad"] == pytest.approx(run["optimum"]["soc_cad"], abs=2.0)


def test_a_run_that_never_arrives_says_so(capsys: Capsys) -> None:
    argv = (*DITHER, "--start", "soc_cad=-25", "--cycles", "20")
    assert seek(capsys, *argv)["cycles_to"] is None
    assert main(["engine", "seek", *argv]) == 0
    assert "cycles_to                                 –" in capsys.readouterr().out


def test_cov_of_imep_can_be_a_limit(capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    out = seek(capsys, "--limit", "cov-imep-percent=1.0", "-o", str(file))
    assert out["limits"].keys() == {"cov_imep_percent"}
    assert out["figures"]["limit_cov_imep_percent"] == 1.0
    assert file.read_text().splitlines()[0].endswith(",cov_imep_percent")


def test_a_start_above_a_limit_is_doubted_and_counted(
    capsys: Capsys, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    file = tmp_path / "run.csv"
    out = seek(capsys, "--start", "soc_cad=-20", "--limit", "p_max_bar=95", "-o", str(file))
    header, *rows = file.read_text().splitlines()
    pressure = np.array([float(row.split(",")[header.split(",").index("p_max_bar")]) for row in rows])
    own = out["figures"]
    assert own["worst_p_max_bar"] == pressure.max() > 150.0
    assert own["worst_cycle_p_max_bar"] == pressure.argmax() < 20
    assert own["above_cycles_p_max_bar"] == (pressure > 95.0).sum()
    assert "start_above_limit" in [finding["code"] for finding in out["findings"]]
    assert "the first reading of p_max_bar" in caplog.text


def test_the_text_names_worst_cycle_and_share(capsys: Capsys) -> None:
    assert main(["engine", "seek", "--start", "soc_cad=-20", "--limit", "p_max_bar=95", "--cycles", "300"]) == 0
    measured, free = capsys.readouterr().out.splitlines()[-2:]
    assert measured.startswith("p_max_bar as measured: worst 1")
    assert free.startswith("p_max_bar noise-free at what was applied: worst 1")
    for text in (measured, free):
        assert "; above 95 in " in text
        assert " %), from cycle 150 on in " in text


def test_figure(capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "run.png"
    seek(capsys, "--figure", str(file), "--limit", "p_max_bar=95", "--misfire", "0.01", "--cycles", "300")
    assert file.read_bytes().startswith(b"\x89PNG")
    assert "--figure run.bmp" in refused(capsys, "--figure", "run.bmp")
    assert "does not exist; make it" in refused(capsys, "--figure", "nowhere/run.png")


# What is refused, what is meant, and what the message says; behind => where nothing is feasible.
WRONG = """
--start soc_cad=-31 | --start soc_cad=-29 -> soc_cad = -31: must be in [-30, 10]
--start soc_cad=nan | --start soc_cad=-8 -> soc_cad = nan
--start -8 | --start soc_cad=-8 -> NAME=
--input soc_cad=-61:5 | --input soc_cad=-60:5 -> --input soc_cad=-61:5: -61 must be in [-60, 20], the window of the
--input soc_cad=5:-25 | --input soc-cad=-25:5 -> LOW and HIGH must be finite and LOW < HIGH
--input soc_cad | --input soc_cad=-25:5 -> --input soc_cad: write NAME=LOW:HIGH
--input soc_cad=-25:5:31 | --input soc_cad=-25:5:2 -> STEP must be > 0 and at most HIGH - LOW
--input boost=0:9 | --input soc_cad=-25:5 -> --input boost: the bench has soc_cad, intake_
--input soc=-25:5 | --input soc_cad=-25:5 -> did you mean 'soc_cad'?
--input soc_cad=-25:5 --input soc_cad=-20:5 | --input soc_cad=-25:5 -> --input soc_cad is given twice
--cycles 0 | --cycles 2 -> --cycles 0: must be >= 2
--cycles 3000000 | --cycles 2 -> --cycles 3000000: must be <= 2000000
--seed -1 | --seed 1 -> --seed -1: must be in [0, 2**64)
--misfire 1.5 | --misfire 0.5 -> --misfire 1.5: must be in [0, 1]
--noise -1 | --noise 0 -> --noise -1 %: must be in [0, 20]
--soc-scatter-cad 6 | --soc-scatter-cad 5 -> --soc-scatter-cad 6 °CA: must be in [0, 5]
--limit p_maxx=95 | --limit p_max_bar=95 -> --limit 'p_maxx' is not measured: must be one of
--limit p_max_bar=99:9 | --limit p_max_bar=9:99 -> --limit p_max_bar=99:9: write NAME=X, or
--limit p_max_bar=300: | --limit p_max_bar=:110 => keeps p_max_bar >= 300: move a limit
--tolerance egr=1 | --tolerance soc_cad=1 -> --tolerance has egr: must have one number for
--seeker-set memory_cycles=x | -> --seeker-set: memory_cycles = 'x': must be
--seeker-set limits=3 | -> --seeker-set: 'limits' is not one of them: the search gives it
--fuel-mg -3 | --fuel-mg 30 -> --fuel-mg -3 mg: must be
--limit p_max_bar=nan | --limit p_max_bar=95 -> p_max_bar = nan: must be a finite number
--limit p_max_bar=20 | --limit p_max_bar=85 => no soc_cad in [-30, 10] keeps
--seeker golden_section | --seeker golden_section --noise-sd 0.25 -> --seeker golden_section: needs --noise-sd
--sensor analyser --seeker spsa | --seeker spsa -> --seeker spsa: takes J of the same cycle
--sensor analyser --seeker golden_section --noise-sd 0.25 | --seeker golden_section --noise-sd 0.25 -> extremum_seeking
--motored | -> leave --motored out
"""


@pytest.mark.parametrize("line", WRONG.strip().splitlines())
def test_wrong_then_right(line: str, capsys: Capsys) -> None:
    typed, arrow, message = line.partition(" => " if " => " in line else " -> ")
    wrong, right = (each.split() for each in typed.split("|"))
    short = ("--cycles", "40")
    assert message in refused(capsys, *(() if "--cycles" in wrong else short), *wrong, code=3 if arrow == " => " else 2)
    out = seek(capsys, *(() if "--cycles" in right else short), *right)
    assert math.isfinite(out["inputs"]["soc_cad"])


def test_help_names_the_default_length(capsys: Capsys) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["engine", "seek", "--help"])
    assert stop.value.code == 0
    assert "left out: 200, and 25 more per cycle that J is late" in " ".join(capsys.readouterr().out.split())


def test_ctrl_c_leaves_the_cycles_so_far(tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    program = (
        "import pathlib, sys\n"
        "import mgdd.loop\n"
        "seek = sys.modules['mgdd.loop.seek']\n"
        "run = seek.run_seeker\n"
        "def told(*args, **kwargs):\n"
        f"    pathlib.Path({str(ready)!r}).touch()\n"
        "    return run(*args, **kwargs)\n"
        "seek.run_seeker = told\n"
        "from mgdd.cli import main\n"
        "sys.exit(main(['engine', 'seek', '--seeker', 'extremum_seeking', '--cycles', '2000000', '--json']))\n"
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
    assert f"interrupted: {result['cycles']} cycles are kept".encode() in err


seek, refused = commands("engine", "seek")

KINDS = ("feed_forward", "curve", "calibrated", "map")
ROUGH = ("--guide-set", "wall_heat_scale=0.8", "--guide-set", "burn_duration_ref_cad=45")
FIELDS = {"guide", "j_lost", "estimate_sd", "trust", "cycles_to"}
OPTIMUM_CAD, LIMITED_CAD = -5.63, -3.08


@pytest.fixture
def table(tmp_path: Path) -> Path:
    CalibrationMap({"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20, 40]}, -9.0, name="soc_cad").save(
        tmp_path / "timing.nc"
    )
    return tmp_path / "timing.nc"


def options(kind: str, table: Path) -> tuple[str, ...]:
    return ("--guide", "map", "--guide-map", str(table)) if kind == "map" else ("--guide", kind, *ROUGH)


def first_timing(file: Path) -> float:
    with file.open(encoding="utf-8") as stream:
        return float(next(csv.DictReader(line for line in stream if not line.startswith("#")))["asked_soc_cad"])


def test_without_a_guide_nothing_is_guided(capsys: Capsys) -> None:
    out = seek(capsys, "--cycles", "60")
    assert out.keys() >= FIELDS
    assert out["guide"] == "none"
    assert out == seek(capsys, "--cycles", "60", "--guide", "none")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_begins_at_the_guide_and_improves_on_it(kind: str, capsys: Capsys, table: Path) -> None:
    out = seek(capsys, *options(kind, table), "--cycles", "600", "--seed", "3")
    assert out.keys() >= FIELDS
    assert out["guide"] == kind
    assert out["start"]["soc_cad"] == pytest.approx(-9.0 if kind == "map" else -9.87, abs=0.1)
    assert abs(out["start"]["soc_cad"] - OPTIMUM_CAD) > 2.0  # a rough guide, on which the measurements improve
    assert out["figures"]["final_soc_cad"] == pytest.approx(OPTIMUM_CAD, abs=1.2)
    assert out["j_lost"] < 0.1
    if kind in ("curve", "calibrated"):
        assert out["cycles_to"] <= 15
        assert 0.2 < out["estimate_sd"] < 3.0
        assert out["seeker"] == "CurveSeeking"
    else:
        assert out["estimate_sd"] is None
        assert out["seeker"] == "ExtremumSeeking"
    if kind == "calibrated":
        assert out["guide_wall_heat_scale"] == pytest.approx(0.5, rel=0.05)  # the bench has 0.5


def test_a_plain_parabola_guides_as_well(capsys: Capsys) -> None:
    out = seek(capsys, "--guide", "curve", *ROUGH, "--guide-shape", "parabola", "--cycles", "600")
    assert out["figures"]["final_soc_cad"] == pytest.approx(OPTIMUM_CAD, abs=1.0)


def test_another_engine_can_be_the_guide(capsys: Capsys) -> None:
    out = seek(capsys, "--guide", "curve", "--guide-preset", "hd_diesel_128x144", "--cycles", "600")
    assert out["preset"] == "puma_single"
    assert abs(out["start"]["soc_cad"] - OPTIMUM_CAD) > 0.2
    assert out["figures"]["final_soc_cad"] == pytest.approx(OPTIMUM_CAD, abs=1.0)


@pytest.mark.parametrize("kind", ["feed_forward", "curve", "calibrated"])
def test_a_guided_run_starts_below_the_limit(kind: str, capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"  # an exact model: over the limit at its best
    out = seek(capsys, "--guide", kind, "--limit", "p_max_bar=95", "-o", str(file))
    assert "start_above_limit" not in [finding["code"] for finding in out["findings"]]
    assert first_timing(file) == pytest.approx(out["start"]["soc_cad"], abs=1.0 + 1e-9)  # the dither
    assert out["start"]["soc_cad"] > LIMITED_CAD
    assert out["figures"]["noise_free_worst_p_max_bar"] < 97.0  # at the guide's own best timing 105.6
    assert out["optimum"]["soc_cad"] == pytest.approx(LIMITED_CAD, abs=0.01)
    assert out["free_optimum"]["soc_cad"] == pytest.approx(OPTIMUM_CAD, abs=0.01)
    assert out["optimum_active_limits"] == ["p_max_bar"]
    assert -0.1 < out["figures"]["final_soc_cad"] - LIMITED_CAD < 1.25


@pytest.mark.parametrize("kind", KINDS)
def test_the_start_is_that_of_the_user(kind: str, capsys: Capsys, table: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    out = seek(capsys, *options(kind, table), "--start", "soc_cad=-18", "--cycles", "50", "-o", str(file))
    assert out["start"] == {"soc_cad": -18.0}
    assert first_timing(file) == pytest.approx(-18.0, abs=1.0 + 1e-9)


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ("--guide-preset puma_single", "--guide-preset does not act here; --guide none has no model"),
        ("--guide-set wall_heat_scale=1", "--guide-set does not act here; --guide none has no model"),
        ("--guide calibrated --guide-shape parabola", "--guide-shape 'parabola': a parabola cannot be calibrated"),
        ("--guide-shape parabola", "--guide-shape does not act here; --guide none has no model"),
        ("--guide-map x.toml", "--guide-map does not act here; --guide none has no model"),
        ("--guide map", "--guide map needs --guide-map FILE"),
        ("--guide map --guide-map x.txt", "x.txt: no such file"),
        (
            "--guide map --guide-map x.csv --guide-map-out y.txt",
            "-out y.txt: the ending must be one of .nc, .csv",
        ),
        ("--guide map --guide-map x.csv --guide-map-out no/y.csv", "no/y.csv: the folder no does not exist; make it"),
        ("--guide map --guide-map none.csv", "none.csv"),
        ("--guide-map-out y.csv", "--guide-map-out does not act here; --guide none has no model"),
        ("--guide curve --guide-map-out y.csv", "--guide-map-out does not act here; --guide curve has a model"),
        (
            "--guide map --guide-map x.csv --guide-map-out y.csv --limit p_max_bar=95",
            "--guide-map-out does not act here; with --limit a run ends at the best timing within the limit",
        ),
        ("--guide map --guide-map none.toml", "none.toml: no such file"),
        ("--guide map --guide-map x.toml --guide-set wall_heat_scale=1", "--guide-set does not act here; --guide map"),
        ("--guide curve --guide-map x.toml", "--guide-map does not act here; --guide curve has a model"),
        ("--guide feed_forward --guide-shape parabola", "--guide-shape 'parabola': a parabola is not one timing"),
        ("--guide curve --seeker spsa", "--seeker acts with --guide none, feed_forward or map"),
        ("--guide calibrated --sensor analyser", "use --sensor soft, or --guide curve with the model's shape"),
        ("--guide curve --guide-shape parabola --sensor analyser", "use --sensor soft, or --guide curve with"),
        ("--guide feed_forward --seeker golden_section", "--seeker golden_section searches its whole range"),
        ("--guide curve --guide-set foo=1", "--guide-set foo: is not a field of the cylinder"),
        ("--guide curve --guide-set wall_heat_scale", "--guide-set wall_heat_scale: write FIELD=VALUE"),
        ("--guide curve --guide-set bore_mm=90 --guide-set bore_mm=91", "--guide-set bore_mm is given twice"),
        ("--guide curve --guide-set wall_heat_scale=-1", "--guide-set wall_heat_scale = -1: must be in [0, 100]"),
        ("--guide curve --guide-set wall_heat_scale=much", "--guide-set wall_heat_scale = 'much': must be a number"),
        ("--guide curve --guide-set speed_rpm=3000", "--guide-set speed_rpm: belongs to the operating point"),
        ("--guide curve --guide-set speed-rpm=3000", "--guide-set speed_rpm: belongs to the operating point"),
        ("--guide curve --guide-preset nowhere", "--guide-preset nowhere: no preset 'nowhere'"),
        ("--guide curve --input soc_cad=5:10", "--guide curve: the best timing of the model, -5.6"),
    ],
)
def test_what_cannot_guide_is_refused_with_the_remedy(argv: str, said: str, capsys: Capsys) -> None:
    assert said in refused(capsys, *argv.split())


def test_a_table_that_ends_before_the_point_is_refused(capsys: Capsys, table: Path) -> None:
    said = refused(capsys, "--guide", "map", "--guide-map", str(table), "--speed-rpm", "3500")
    assert "its axes end before" in said


def test_a_feed_forward_beyond_the_bounds_starts_inside(capsys: Capsys) -> None:
    out = seek(capsys, "--guide", "feed_forward", "--input", "soc_cad=-4:10", "--cycles", "50")
    assert -4.0 < out["start"]["soc_cad"] <= -3.0


@pytest.mark.parametrize(("read", "written"), [("nc", "nc"), ("dcm", "nc"), ("nc", "dcm")])
def test_a_run_that_settles_writes_its_timing_back(
    read: str, written: str, capsys: Capsys, table: Path, tmp_path: Path
) -> None:
    before, out_file = tmp_path / f"before.{read}", tmp_path / f"learnt.{written}"
    write_map(read_map(table).replaced(provenance={"from": "by hand"}), before)
    run = ("--guide", "map", "--guide-map", str(before), "--guide-map-out", str(out_file), "--cycles", "1200")
    out = seek(capsys, *run, "--seed", "3", "--fuel-mg", "22")
    assert (out["guide_map_learnt"], out["guide_map_out"]) == (True, str(out_file))
    learnt = read_map(out_file)
    point = {"speed_rpm": 1500.0, "fuel_mg": 22.0}
    assert float(learnt(point)) == pytest.approx(out["guide_map_cad"], abs=1e-12)
    assert abs(learnt(point) - out["figures"]["final_soc_cad"]) < 0.5 < abs(-9.0 - out["figures"]["final_soc_cad"])
    if written == "nc":
        assert learnt.sd_at(point) == pytest.approx(out["guide_map_sd_cad"])
        assert out["guide_map_sd_cad"] < 3.0
        support = learnt.cells["support"]
        assert support[1, 1] > support[1, 2] > support[0, 0] == 0.0
        assert np.argwhere(learnt.cells["source"] == "learned").tolist() == [[1, 1], [1, 2]]
        assert learnt.provenance["learned"] == "mgdd engine seek at speed_rpm=1500 fuel_mg=22 seed=3"
        assert (learnt.provenance.get("from") == "by hand") is (read == "nc")
    again = seek(capsys, "--guide", "map", "--guide-map", str(out_file), "--fuel-mg", "22", "--cycles", "50")
    assert again["start"]["soc_cad"] == pytest.approx(out["guide_map_cad"], abs=1e-9)
    assert "guide_map_learnt" not in again


def test_a_run_that_has_not_settled_writes_nothing(
    capsys: Capsys, caplog: pytest.LogCaptureFixture, table: Path, tmp_path: Path
) -> None:
    out_file = tmp_path / "learnt.nc"
    run = ("--guide", "map", "--guide-map", str(table), "--guide-map-out", str(out_file), "--cycles", "60", "--json")
    assert main(["engine", "seek", *run]) == 0
    out = json.loads(capsys.readouterr().out)
    assert (out["guide_map_learnt"], out["guide_map_out"], out["guide_map_cad"]) == (False, None, -9.0)
    assert not out_file.exists()
    said = out["warnings"][-1]
    assert f"--guide-map-out {out_file}: not written, the estimate has not settled" in said
    assert said.endswith("raise --cycles")
    assert said in caplog.text


def test_an_interrupted_run_teaches_nothing(table: Path, tmp_path: Path) -> None:
    bench, timing = VirtualEngine(seed=2), TimingMap(CalibrationMap.load(table))
    seeker = FeedForward(ExtremumSeeking(start=-9.0, bounds=(-30.0, 10.0)), timing)
    seeker.at(bench.point)
    run_seeker(bench, seeker, 900)
    args = Namespace(guide_map=str(table), guide_map_out=str(tmp_path / "out.nc"), seed=2)
    for interrupted in (True, False):
        before = timing.table
        figures, doubts = learn_map(args, timing, seeker, bench.point, interrupted=interrupted)
        assert figures["guide_map_learnt"] is not interrupted
        assert (tmp_path / "out.nc").exists() is not interrupted
        assert (timing.table is before) is interrupted
        assert any("interrupted" in doubt for doubt in doubts) is interrupted


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed [rpm],soc_cad\n900,-2\n1500,-5\n",
         "axis 'speed' is not a number of the operating point: did you mean 'speed_rpm'?"),
        ("speed_rpm,rail_bar\n900,400\n1500,800\n", "rail_bar has unit 'bar': a timing map needs '°CA aTDC'"),
        ("speed_rpm,soc_cad\n900,-2\n1500,-\n", "1 cells have no value: smooth the map with --fill"),
        ("speed_rpm,soc_cad\n900,-2\n1500,late\n", "line 3: 'late' is not a finite number"),
        ("n/M,10,20\n900,-1,-2\n1500,-3,-5\n", "pass --rows 'n' if n runs down, "),
    ],
)  # fmt: skip
def test_a_map_that_cannot_guide_is_named(text: str, said: str, capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "timing.csv"
    file.write_text(text, encoding="utf-8")
    words = refused(capsys, "--guide", "map", "--guide-map", str(file))
    assert said in words
    assert words.count("timing.csv") == 1 + ("mgdd map export" in words)  # which takes --rows
    assert ("mgdd map export" in words) is ("--rows" in words)
