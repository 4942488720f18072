"""Further ways into the workbench: own engines, experiments, records of a rig, the sweep beside the sought map."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.rig import Experiment, run_experiment
from mgdd.workbench.drop import dropper
from pressure_files import CYCLES, FULL, writer_in
from workbench_views import bench, run_command, run_python, said

__all__ = ["bench"]
ENGINE = "hd_diesel_128x144"
SEEK = """
kind = "experiment"
format = 1
task = "seek"
seed = 3
[seek]
cycles = 40
inputs = { soc_cad = [-20.0, 5.0] }
limits = { p_max_bar = 110.0 }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def own_engine(ratio: float = 19.0) -> bytes:
    text = (resources.files("mgdd.presets") / f"{ENGINE}.toml").read_text(encoding="utf-8")
    assert text.count("compression_ratio = { value = 20.3,") == 1
    return text.replace("compression_ratio = { value = 20.3,", f"compression_ratio = {{ value = {ratio},").encode()


# --- an engine of one's own ---------------------------------------------------------------------------------


def test_an_own_engine_judges_as_its_command_does(bench: Any, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine.toml").write_bytes(own_engine())
    bench.files.add_engine("mine.toml", own_engine())
    assert bench.session.preset == "mine.toml"
    record = writer_in(folder)([FULL, *CYCLES], "angle," + ",".join(["p [bar]"] * 5), "five.csv")
    bench.files.add(record.name, record.read_bytes())
    check = bench.files.file.check
    asked = run_command(bench.check.same.script.shell, capsys)["files"][0]
    assert [each["verdict"] for each in asked["checks"]] == [each.verdict for each in check.checks]
    assert run_python(bench.check.same.script.python)["cylinder"].compression_ratio == 19.0
    bench.files.engine.value = ENGINE
    other = bench.files.file.check.analysis["mean_n_compression"]
    assert float(other) != float(check.analysis["mean_n_compression"])


@pytest.mark.slow
def test_an_own_engine_can_be_sought_on(bench: Any, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine.toml").write_bytes(own_engine())
    bench.files.add_engine("mine.toml", own_engine())
    search = bench.search
    search.engine.value, search.cycles.value = "mine.toml", 20
    search.begin()
    asked = run_command(search.same.script.shell, capsys)
    assert asked["inputs"] == pytest.approx(search.found["result"]["inputs"], rel=1e-9)


def test_a_preset_that_is_none_is_a_sentence(bench: Any) -> None:
    for content, sentence in (
        (b"\x00", "bad.toml"), (b"bore_mm = 3", "bad.toml"), (b"kind = 'throttle'\nformat = 1\n", "throttle"),
        (own_engine(0.5), "compression_ratio = 0.5"),
    ):  # fmt: skip
        bench.files.add_engine("bad.toml", content)
        assert sentence in said(bench.files.work)
        assert str(bench.session.folder) not in said(bench.files.work)
        assert "bad.toml" not in bench.files.engine.options


# --- the speed that stands in a file ------------------------------------------------------------------------


@pytest.mark.slow
def test_the_speed_of_a_file_is_taken_by_a_click(bench: Any, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    turned = 720.0 * np.arange(len(CYCLES))[:, None] + FULL - FULL[0]
    rows = "".join(f"{t:.8f},{p:.5f}\n" for t, p in zip(turned.ravel() / (6.0 * 1230.0), CYCLES.ravel(), strict=True))
    (folder / "time.csv").write_text(f"time [s],p [bar]\n{rows}", encoding="utf-8")
    bench.files.engine.value = ENGINE
    bench.files.point.widgets["speed_rpm"].value = 1225.0
    bench.files.apply()
    bench.files.reading.widgets["firing_tdc_deg"].value = float(-FULL[0])
    bench.files.add("time.csv", (folder / "time.csv").read_bytes())
    assert bench.files.file.error == ""
    one, before = bench.files.file, bench.files.file.check
    assert one.trace.attrs["speed_rpm"] == pytest.approx(1230.0, abs=0.5)  # its period tells
    assert bench.check.own_speed.visible
    bench.check.own_speed.clicks += 1
    assert one.options["speed_rpm"] == pytest.approx(1230.0, abs=0.5)
    assert not bench.check.own_speed.visible
    asked = run_command(bench.check.same.script.shell, capsys)["files"][0]
    assert [each["text"] for each in asked["checks"]] == [each.text for each in one.check.checks]
    bench.check.undo.clicks += 1
    assert "speed_rpm" not in one.options
    assert [str(each) for each in one.check.checks] == [str(each) for each in before.checks]


# --- experiments and records --------------------------------------------------------------------------------


def test_an_experiment_seeks_as_its_command_does(bench: Any, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "seek.toml").write_text(SEEK, encoding="utf-8")
    own = bench.search
    own.open("seek.toml", SEEK.encode())
    assert (own.done_cycles, own.total, own.drawn_limits) == (40, 40, {"p_max_bar": 110.0})
    assert len(own._sources["p_max_bar"].data["x"]) == len(own._sources["estimate soc_cad"].data["x"]) == 40
    assert own.resume.disabled
    unlimited = 'kind = "experiment"\nformat = 1\ntask = "seek"\n[seek]\ncycles = 50\n'
    own.open("free.toml", unlimited.encode())
    assert "may be noise" in own._said.object  # a finding stands as text
    own.open("seek.toml", SEEK.encode())
    asked = run_command(f"{own.same.script.shell} --folder run", capsys)
    assert asked["result"]["inputs"] == pytest.approx(own.found["result"]["result"]["inputs"], rel=1e-9)
    again = run_python(own.same.script.python)["found"]
    assert again.figures["inputs"] == own.found["result"]["result"]["inputs"]


def test_a_record_of_a_search_is_replayed(bench: Any, folder: Path) -> None:
    done = run_experiment(Experiment.from_toml(SEEK), folder / "run")
    own = bench.search
    own.open("run.rec", (folder / "run" / "run.rec").read_bytes())
    assert said(own.work) == ""
    assert np.array_equal(own._sources["j"].data["y"], done.dataset["j"])
    estimates = done.dataset["estimate"].sel(input="soc_cad")
    assert np.array_equal(own._sources["estimate soc_cad"].data["y"], estimates)
    assert np.array_equal(own._sources["p_max_bar"].data["y"], done.dataset["limits"].sel(limit="p_max_bar"))


def test_what_is_no_search_is_a_sentence_and_nobody_arms_a_bench_by_a_file(bench: Any) -> None:
    on_a_bus = 'mode = "bench"\n[bus]\nconnection = "socketcan:can0"\npace = "real_time"'
    for name, content, sentence in (
        ("a.csv", "1", "a.csv: must be an experiment (.toml) or a record (.rec)"),
        ("a.toml", "1", "a.toml: not valid TOML"),
        ("a.toml", SEEK.replace("40", "-1"), "cycles = -1"),
        ("a.toml", 'kind = "experiment"\nformat = 1\ntask = "track"\n', "use mgdd rig run for another task"),
        ("a.toml", SEEK.replace("seed = 3", 'mode = "bench"'), "needs [bus] connection"),
        ("a.toml", SEEK.replace("seed = 3", on_a_bus), "arm"),
        ("a.rec", "1", "a.rec: not a record of mgdd"),
    ):
        bench.search.open(name, content.encode())
        assert sentence in said(bench.search.work).replace("&#x27;", "'")
        assert str(bench.session.folder) not in said(bench.search.work)
        assert bench.search.found == {}


# --- the sweep beside the sought map, and smoothing ---------------------------------------------------------


def test_the_sweep_makes_the_map_of_its_commands_and_smoothing_too(
    bench: Any, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import xarray as xr

    own = bench.map
    own.visits.value = 8
    own.limits.widgets["p_max_bar"].value = 110.0
    own.smooth()
    assert "seek a map first" in said(own.work)
    own.begin()
    own.sweep()
    shown, swept = own.same.script, own.made["swept"]["cells"]
    asked = run_command(shown.shell, capsys)
    assert np.allclose(asked["values"], swept["soc_cad"], rtol=1e-9)
    again = run_python(shown.python)
    assert np.array_equal(again["swept"].values, swept["soc_cad"])
    assert float(again["achieved"]["p_max_bar"].max()) <= 110.0 + 1e-6
    assert np.abs(own.cells["soc_cad"] - swept["soc_cad"]).max() < 3.0  # two ways to one map
    own.smooth()
    (folder / "map.nc").write_bytes(own.found["files"][".nc"])
    run_command(f"{own.same.script.shell} -o smooth.nc", capsys)
    smooth = own.made["smooth"]["cells"]["soc_cad"]
    assert np.allclose(xr.load_dataset("smooth.nc")["soc_cad"], smooth, rtol=1e-9)
    assert float(np.abs(smooth - own.cells["soc_cad"]).max()) <= 1.0 + 1e-6
    assert {each.filename for each in own.saved.objects} >= {"map.dcm", "swept.dcm", "smooth.dcm"}


def test_a_sweep_under_an_impossible_limit_says_so(bench: Any) -> None:
    own = bench.map
    own.limits.widgets["p_max_bar"].value = 1.0
    own.sweep()
    assert "p_max_bar" in said(own.work)
    assert "raise a limit" in said(own.work)
    assert own.made == {}


def test_a_client_that_sends_more_than_the_page_would_is_not_kept() -> None:
    from panel.models.esm import DataEvent

    taken: list[tuple[str, int]] = []
    place = dropper(lambda name, content: taken.append((name, len(content))), 1)

    def sends(data: bytes, *, first: bool, last: bool) -> None:
        message = {"name": "a.csv", "data": data, "first": first, "last": last}
        place._process_event(DataEvent(None, data=message))

    half = b"1" * (600 << 10)
    sends(half, first=True, last=False)
    sends(half, first=False, last=False)
    sends(b"1", first=False, last=True)
    sends(half, first=True, last=True)
    assert taken == [("a.csv", len(half))]
