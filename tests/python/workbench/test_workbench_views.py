"""Every view, without a browser: what it shows, and that the command and the Python it shows give the same numbers."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.engine import simulate
from mgdd.errors import ParameterError
from mgdd.io import extras, throttle_log, write_csv
from mgdd.loop import VirtualEngine, seek, track, tuned_controller
from mgdd.signals import chirp
from mgdd.throttle import Throttle, simulate_throttle
from mgdd.workbench import view
from pressure_files import CYCLES, FULL, writer_in
from workbench_views import bench, run_command, run_python, said

__all__ = ["bench"]
ENGINE = "hd_diesel_128x144"
MARKUP = "<img src=x onerror=alert(1)>.csv"


@pytest.fixture
def record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Five cycles in kPa whose level drifted: a file to doubt, in the working folder."""
    monkeypatch.chdir(tmp_path)
    return writer_in(tmp_path)([FULL, *(100.0 * (CYCLES + 6.0))], "angle," + ",".join(["p [kPa]"] * 5), "drifted.csv")


@pytest.fixture
def drifted(bench: Any, record: Path) -> Iterator[Any]:
    bench.files.engine.value = ENGINE
    bench.files.point.widgets["speed_rpm"].value = 1200.0
    bench.files.apply()
    bench.files.add(record.name, record.read_bytes())
    return bench


def test_without_an_engine_a_file_is_drawn_and_not_judged(bench: Any, record: Path) -> None:
    bench.files.add(record.name, record.read_bytes())
    one = bench.files.file
    assert (one.path.name, one.check, one.error) == (record.name, None, "")
    assert len(bench.files._picture.objects) == 1
    assert "No engine is stated" in bench.files._guesses.object
    bench.files.engine.value = ENGINE
    assert one.check.verdict == "doubt"
    assert "guessed" in bench.files._guesses.object
    bench.files.engine.value = bench.files.engine.options[0]
    assert one.check is None


def test_what_is_stated_is_no_guess_any_more(drifted: Any) -> None:
    guesses = drifted.files._guesses.object
    assert "speed_rpm" not in guesses
    assert "fuel_mg" in guesses


def test_check_says_the_same_as_its_command_and_its_python(drifted: Any, capsys: pytest.CaptureFixture[str]) -> None:
    check, shown = drifted.files.file.check, drifted.check.same.script
    asked = run_command(shown.shell, capsys)["files"][0]
    assert asked["verdict"] == check.verdict == "doubt"
    assert [each["verdict"] for each in asked["checks"]] == [each.verdict for each in check.checks]
    own = run_python(shown.python)["check"]
    assert own.analysis.equals(check.analysis)


def test_a_remedy_changes_the_verdict_and_is_undone(drifted: Any, capsys: pytest.CaptureFixture[str]) -> None:
    before = drifted.files.file.check["level"]
    assert before.verdict == "doubt"
    shown = drifted.check._checks.objects
    row = next(k for k, each in enumerate(shown) if "<b>level</b>" in getattr(each, "object", ""))
    shown[row + 1].objects[0].clicks += 1
    assert drifted.files.file.options == {"pegging": "two_point"}
    assert drifted.files.file.check["level"].verdict == "no fault found"
    asked = run_command(drifted.check.same.script.shell, capsys)["files"][0]
    assert "--pegging=two_point" in drifted.check.same.script.shell
    assert asked["verdict"] == drifted.files.file.check.verdict
    drifted.check.undo.clicks += 1
    assert drifted.files.file.check["level"] == before
    assert drifted.check.undo.disabled


def test_unit_offset_and_speed_are_remedies_too(bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    plain = writer_in(tmp_path)([FULL, *(1e5 * CYCLES)], "", "plain.csv")
    bench.files.engine.value = ENGINE
    bench.files.add(plain.name, plain.read_bytes())
    assert "pressure_unit='Pa'" in bench.files.file.error
    assert str(bench.session.folder) not in bench.files.file.error
    bench.check.unit.value = "Pa"
    bench.check.offset.value = 0.5
    bench.check.speed.value = 1300.0
    bench.check.apply()
    assert bench.files.file.error == ""
    assert bench.files.file.options == {"pressure_unit": "Pa", "tdc_offset_cad": 0.5, "speed_rpm": 1300.0}
    assert float(bench.files.file.check.analysis["mean_p_max_cad"]) < 8.5


@pytest.mark.slow
def test_dead_centre_is_estimated_and_taken_off(drifted: Any, capsys: pytest.CaptureFixture[str]) -> None:
    drifted.check.remedy({"pegging": "two_point"})
    shell = drifted.session.tdc_script(drifted.files.file).shell
    drifted.check.estimate()
    offset = drifted.files.file.options["tdc_offset_cad"]
    assert "possible" in said(drifted.check.work)
    assert run_command(shell, capsys)["tdc"]["tdc_offset_cad"] == pytest.approx(offset, abs=1e-6)


def test_cycles_have_the_figures_of_the_command(drifted: Any, capsys: pytest.CaptureFixture[str]) -> None:
    drifted.cycles.analyze()
    figures = next(iter(drifted.cycles.shown.values()))
    asked = run_command(drifted.cycles.same.script.shell, capsys)
    for name in ("imep_net_bar", "p_max_bar", "ca50_cad"):
        assert asked[name] == pytest.approx(float(figures[f"mean_{name}"]), rel=1e-12)
    own = run_python(drifted.cycles.same.script.python)["figures"]
    assert np.array_equal(own["ca50_cad"], figures["ca50_cad"])
    assert drifted.cycles.figure.value == "imep_net_bar"
    titles = [pane.objects[0].object.yaxis[0].axis_label for pane in drifted.cycles._pictures.objects[0].objects]
    assert len(titles) == 7
    assert titles.count("cycle [-]") == 2
    assert any("bar²/kHz" in title or "bar**2" in title for title in titles), titles


@pytest.mark.parametrize(
    ("what", "name", "holds"),
    [pytest.param("page", "drifted.html", b"Measured pressure", marks=pytest.mark.slow),
     ("figure", "drifted.svg", b"<svg"), ("table", "drifted_cycles.csv", b"imep_net_bar")],
)  # fmt: skip
def test_cycles_are_saved(drifted: Any, what: str, name: str, holds: bytes) -> None:
    drifted.cycles.export(what)
    save = drifted.cycles.saved.objects[0]
    assert save.filename == name
    assert holds in save.file.getvalue()


def test_a_column_is_given_by_name_or_number(bench: Any, record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench.files.engine.value = ENGINE
    bench.files.reading.widgets["pressure_column"].value = "2"
    bench.files.add(record.name, record.read_bytes())
    assert bench.files.file.options == {"pressure_column": 2}
    assert bench.files.file.trace["pressure_bar"].dims == ("crank_angle_cad",)
    asked = run_command(bench.check.same.script.shell, capsys)["files"][0]
    assert asked["verdict"] == bench.files.file.check.verdict
    bench.files.add(record.name, record.read_bytes())  # again: it takes the place of the first
    assert list(bench.session.files) == [record.name]


def test_files_are_drawn_over_each_other(drifted: Any, record: Path) -> None:
    drifted.files.add("again.csv", record.read_bytes())
    drifted.cycles.others.value = ["again.csv"]
    assert list(drifted.cycles.shown) == ["drifted.csv", "again.csv"]
    drifted.files.which.value = "again.csv"
    drifted.files.forget()
    assert list(drifted.session.files) == ["drifted.csv"]


@pytest.mark.slow
def test_best_timing_has_the_ranges_of_the_command(drifted: Any, capsys: pytest.CaptureFixture[str]) -> None:
    drifted.check.remedy({"pegging": "two_point"})
    drifted.timing.limits.widgets["p_max_bar"].value = 190.0
    drifted.timing.calibrate()
    rows = drifted.timing.rows
    asked = run_command(drifted.timing.same.script.shell, capsys)["traces"]
    for name in ("ca50_cad", "free_ca50_cad", "free_gain_percent"):
        assert asked[0][name] == pytest.approx(rows[0][name], rel=1e-9)
    own = run_python(drifted.timing.same.script.python)["rows"][0]
    assert list(own.free_ca50_cad) == rows[0]["free_ca50_cad"]
    assert "Ranges are over" in drifted.timing._answers.object


def test_traces_that_are_read_otherwise_are_not_calibrated_together(drifted: Any, record: Path) -> None:
    drifted.files.add("again.csv", record.read_bytes())
    drifted.check.remedy({"pegging": "two_point"})
    assert drifted.timing.traces.value == ["drifted.csv", "again.csv"]
    drifted.timing.calibrate()
    assert "read or pegged otherwise" in said(drifted.timing.work)


@pytest.mark.parametrize(("guide", "limit"), [("no guide", None), ("curve", 95.0)])
def test_a_search_finds_what_its_command_finds(
    bench: Any, capsys: pytest.CaptureFixture[str], guide: str, limit: float | None
) -> None:
    search = bench.search
    search.guide.value, search.cycles.value, search.seed.value = guide, 60, 3
    search.limits.widgets["p_max_bar"].value = limit
    search.begin()
    found = search.found["result"]
    asked = run_command(search.same.script.shell, capsys)
    for name in ("inputs", "value", "value_sd", "gain", "limits"):
        assert asked[name] == pytest.approx(found[name], rel=1e-9), name
    own = run_python(search.same.script.python)["found"]
    assert own.inputs == found["inputs"]
    assert search.done_cycles == 60
    assert len(search._sources["j"].data["x"]) == len(search._sources["estimate soc_cad"].data["x"]) == 60


def test_a_search_goes_on_where_it_was_stopped(bench: Any) -> None:
    search = bench.search
    search.seeker.value, search.cycles.value = "curve_seeking", 40
    search.begin()
    search.cycles.value = 100
    search.resume.disabled = False
    search.go_on()
    assert search.done_cycles == 100
    stopped = search.found["result"]["inputs"]
    search.begin()
    assert search.found["result"]["inputs"] == stopped


def test_two_inputs_are_sought_too(bench: Any, capsys: pytest.CaptureFixture[str]) -> None:
    search = bench.search
    search.inputs.which.value, search.cycles.value = ["soc_cad", "egr"], 30
    search.begin()
    assert search.found["result"]["inputs"].keys() == {"soc_cad", "egr"}
    asked = run_command(search.same.script.shell, capsys)
    assert asked["inputs"] == pytest.approx(search.found["result"]["inputs"], rel=1e-9)


def test_a_map_has_the_cells_of_its_command(
    bench: Any, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    own = bench.map
    own.visits.value = 6
    own.limits.widgets["p_max_bar"].value = 110.0
    own.begin()
    assert [each["visit"] for each in own.visited] == [1, 2, 3, 4, 5, 6]
    shown = own.same.script
    run_command(f"{shown.shell} -o asked.nc", capsys)
    import xarray as xr

    asked = xr.load_dataset("asked.nc")
    assert np.allclose(asked["soc_cad"], own.cells["soc_cad"], rtol=1e-9)
    again = run_python(shown.python)["found"]
    assert np.array_equal(again.cells["soc_cad"], own.cells["soc_cad"])
    assert set(own.found["files"]) == {".dcm", ".cdfx", ".csv", ".nc"}
    own.compare("before.nc", Path("asked.nc").read_bytes())
    assert "largest difference 0" in own._compared.object
    (tmp_path / "before.nc").write_bytes(Path("asked.nc").read_bytes())
    (tmp_path / "map.nc").write_bytes(own.found["files"][".nc"])
    assert run_command(own.same.script.shell, capsys)["largest_difference"] == 0.0


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    signal = chirp(3.0, offset=0.15, amplitude=0.2)
    run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
    write_csv(throttle_log(run["time_s"], run["duty"], run["angle_deg"]), tmp_path / "log.csv")
    return tmp_path / "log.csv"


@pytest.mark.slow
def test_a_log_gives_the_model_of_its_command(bench: Any, log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = bench.throttle
    own.read(log.name, log.read_bytes())
    assert len(own._drawn.objects) == 1
    own.identify()
    asked = run_command(own.same.script.shell, capsys)
    assert asked["parameters"] == pytest.approx(own.found["fit"]["parameters"], rel=1e-9)
    assert run_python(own.same.script.python)["fit"].parameters == pytest.approx(own.found["fit"]["parameters"])
    assert own.saved.objects[0].filename == "fit.toml"
    assert log.name not in bench.session.files


def test_controllers_follow_as_their_command_says(bench: Any, capsys: pytest.CaptureFixture[str]) -> None:
    own = bench.throttle
    own.kinds.value = ["pid", "guided"]
    own.track()
    asked = run_command(own.same.script.shell, capsys)
    run = own.runs["pid"]
    for name in ("settling_ms", "overshoot_deg", "static_error_deg"):
        assert asked[name] == pytest.approx(float(run[name]), rel=1e-9), name
    assert float(run_python(own.same.script.python)["run"]["settling_ms"]) == float(run["settling_ms"])


@pytest.mark.slow
def test_a_controller_is_tuned_as_its_command_says_and_then_compared(
    bench: Any, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    own = bench.throttle
    own.budget.value = 30
    own.tuned()
    asked = run_command(own.same.script.shell, capsys)
    assert asked["numbers"] == pytest.approx(own.numbers["pid P1"])
    import json

    Path("pid.json").write_text(json.dumps(asked), encoding="utf-8")
    own.kinds.value = ["pid"]
    own.track()
    tracked = run_command(own.same.script.shell, capsys)
    assert tracked["settling_ms"] == pytest.approx(float(own.runs["pid"]["settling_ms"]))


def test_a_controller_is_exported(bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from zipfile import ZipFile

    monkeypatch.chdir(tmp_path)
    bench.throttle.exported()
    save = bench.throttle.saved.objects[0]
    assert save.filename == "pid.zip"
    names = ZipFile(save.file).namelist()
    assert "controller/CMakeLists.txt" in names
    assert list(tmp_path.iterdir()) == []  # the folder of the page is its own
    run_python(bench.throttle.same.script.python)
    assert {f"controller/{each.name}" for each in Path("controller").iterdir()} <= set(names)


def test_names_and_errors_with_markup_are_shown_as_they_are(bench: Any, record: Path) -> None:
    bench.files.engine.value = ENGINE
    bench.files.add(MARKUP, record.read_bytes())
    bench.files.add(f"2{MARKUP}", b"<script>alert(1)</script>")
    for part in (bench.files._table, bench.check._head, bench.check.same._page, bench.files._guesses):
        assert "<img" not in part.object
        assert "<script" not in part.object
    assert "&lt;img" in bench.files._table.object


def test_without_panel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr(extras, "importlib", SimpleNamespace(import_module=missing))
    assert main(["workbench", "--no-browser"]) == 2
    assert 'pip install "mgdd[workbench]"' in capsys.readouterr().err
    with pytest.raises(ImportError, match=r"mgdd\[workbench\]"):
        view(simulate("puma_single"))


@pytest.mark.parametrize(
    "made",
    [
        lambda: simulate("puma_single"),
        lambda: seek(VirtualEngine(seed=1), {"soc_cad": (-20.0, 5.0)}, cycles=20),
        lambda: track(tuned_controller("pid"), "step:40:42"),
    ],
)
def test_results_are_shown_in_a_notebook(made: Any) -> None:
    which, drawn = view(made())
    for name in which.options:
        which.value = name
        assert drawn[0].object is not None, name


def test_what_has_nothing_to_draw_is_refused_in_a_notebook() -> None:
    with pytest.raises(ParameterError, match="must be a result of mgdd or a Dataset"):
        view(3.0)
    with pytest.raises(ParameterError, match="has nothing over"):
        view(simulate("puma_single")[["p_max_bar"]])


def test_a_source_that_is_none_is_named(bench: Any) -> None:
    bench.live.source.value = "/no/such/folder"
    asyncio.run(bench.live.opened())
    assert "no such folder or record" in bench.live._shown.object
