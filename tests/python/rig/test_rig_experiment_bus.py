"""Experiments over a bus: the in-process result within the noise, replay bit for bit, dry run, check, self-test."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.errors import RigError
from mgdd.rig import CanRig, Experiment, VirtualNode, read_record, run_experiment
from mgdd.rig.experiment import ExperimentResult
from mgdd.rig.experiment.self_test import LIMIT_S, WAYS_OF, WAYS_TO_DIE, SelfTest

HEAD = 'kind = "experiment"\nformat = 1\nseed = {seed}\n'
TRACK = (
    HEAD
    + 'task = "track"\n[track]\nreference = "step:20:35"\ncontroller = "guided"\n'
    + "[plant]\nscale = {{ coulomb_nm = 1.2 }}\n"
)
SEEK = (
    HEAD
    + 'task = "seek"\n[plant]\nscale = {{ wall_heat_scale = 1.4 }}\n'
    + "[seek]\ncycles = 80\n[seek.limits]\np_max_bar = 110.0\n"
)
FEED = HEAD + 'task = "seek"\n[seek]\nguide = "feed_forward"\ncycles = 80\nscale = {{ wall_heat_scale = 1.4 }}\n'
IDENTIFY = HEAD + 'task = "identify"\n[identify]\nmodel = "pw_r"\nduration_s = 4.0\n'
SEED = 5


def experiment(text: str, seed: int = SEED) -> Experiment:
    return Experiment.from_toml(text.format(seed=seed))


def rms(first: ExperimentResult, other: ExperimentResult, name: str, begin: int = 0) -> float:
    difference = first.dataset[name].to_numpy()[begin:] - other.dataset[name].to_numpy()[begin:]
    return float(np.sqrt(np.mean(difference**2)))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (TRACK, "sensed_angle_deg"),
        pytest.param(IDENTIFY, "sensed_angle_deg", marks=pytest.mark.slow),
        (SEEK, "estimate"),
        pytest.param(FEED, "estimate", marks=pytest.mark.slow),
    ],
    ids=["track", "identify", "seek by curve", "seek by feed-forward"],
)
def test_over_the_bus_the_result_is_that_in_process_within_the_noise(text: str, name: str, tmp_path: Path) -> None:
    """Frames round, and stiction makes much of a rounding: the runs lie no further apart than runs of two seeds do."""
    here = run_experiment(experiment(text))
    there = run_experiment(experiment(text).with_mode("hil"), tmp_path / "run")
    others = [rms(run_experiment(experiment(text, seed)), here, name) for seed in range(6, 11)]
    between = rms(there, here, name)
    assert between < 1.2 * max(others)
    assert there.counters["commands"] >= there.timing["cycles"]
    again = run_experiment(experiment(text).with_mode("replay", record=tmp_path / "run" / "run.rec"))
    compared = again.counters["replay"]
    assert (compared["different"], compared["samples"]) == (0, compared["recorded"])
    np.testing.assert_array_equal(again.dataset[name], there.dataset[name])
    for parameter, value in here.figures.get("parameters", {}).items():
        assert there.figures["parameters"][parameter] == pytest.approx(value, rel=0.05, abs=1e-6), parameter
    record = read_record(tmp_path / "run" / "run.rec")
    assert record.frames.sizes["frame"] > 2 * there.timing["cycles"]
    assert record.config["dbc_sha256"] == json.loads((tmp_path / "run" / "run.json").read_text())["dbc_sha256"]


def test_a_changed_controller_is_seen_by_the_replay(tmp_path: Path) -> None:
    run_experiment(experiment(TRACK), tmp_path / "run")
    other = experiment(TRACK.replace('"guided"', '"pid"')).with_mode("replay", record=tmp_path / "run" / "run.rec")
    compared = run_experiment(other).counters["replay"]
    assert compared["different"] > 100
    assert compared["largest_difference"] > 1e-3
    assert main(["rig", "replay", str(tmp_path / "run"), "--quiet"]) == 0


@pytest.mark.slow
def test_a_dry_run_transmits_nothing_and_computes_everything(tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    short = TRACK.replace("step:20:35", "sine:30:5:4").replace('"guided"', '"pid"\nloop = "python"')
    with VirtualNode("etb", seed=1, truth=truth) as node:
        known = experiment(short + "[bus]\ntimeout_ms = 5000.0\n")
        result = run_experiment(known.with_mode("dry_run", connection=node.bus, pace="real_time"), tmp_path / "run")
    assert result.counters["commands"] == 0
    assert result.counters["bus"].get("sent", 0) == 0
    assert np.abs(result.dataset["asked_duty"]).max() > 0.1
    assert (result.dataset["duty"] == 0.0).all()
    driven = [line.split(",")[2] for line in truth.read_text().splitlines()[1:]]
    assert set(driven) == {"0"}
    assert main(["rig", "replay", str(tmp_path / "run"), "--quiet"]) == 0  # at the sample time of the DBC


def test_a_bench_is_driven_only_armed_and_with_a_key(tmp_path: Path) -> None:
    from mgdd.rig.can.can_rig import key_line
    from mgdd.rig.can.signal_map import SignalMap

    key = tmp_path / "key"
    with VirtualNode("etb", seed=1, step=True) as node:  # steps: a busy machine must not let it time out
        known = experiment(TRACK.replace('"guided"', '"pid"\nloop = "python"') + "[bus]\ntimeout_ms = 5000.0\n")
        known = known.with_mode("bench", connection=node.bus, pace="real_time")
        with pytest.raises(RigError, match="give arm=True"):
            run_experiment(known, key_file=key)
        key.write_text("arm another.dbc 0123\n")
        with pytest.raises(RigError, match="holds no key of this DBC"):
            run_experiment(known, arm=True, key_file=key)
        key.write_text(key_line(SignalMap.load("etb")) + "\n")
        seen: list[float] = []

        def watch(cycle: Any) -> None:
            seen.append(cycle.measured.values["sensed_angle_deg"])
            if cycle.number == 60:
                raise KeyboardInterrupt

        result = run_experiment(known, arm=True, key_file=key, watch=watch)
    assert result.interrupted
    assert max(seen) > 12.0


def test_check_says_what_would_run_and_who_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "track.toml"
    file.write_text(TRACK.format(seed=1))
    with VirtualNode("etb") as node:
        run = ["rig", "check", str(file), "--mode", "bench", "--connection", node.bus, "--pace", "real_time", "--json"]
        assert main(run) == 0
        said = json.loads(capsys.readouterr().out)
        assert (said["transmits"], said["timeouts_ms"]) == (True, {"ETB_Cmd": 20.0})
        heard = said["bus"]
        assert heard["commands"] == 0
        assert heard["checks"]["ETB_Status"]["ok"] > 0
    assert main(run) == 2
    assert "no answer there" in json.loads(capsys.readouterr().out)["error"]["message"]


def test_a_wrong_map_is_refused_before_anything_is_opened(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "track.toml"
    file.write_text(TRACK.format(seed=1) + '[bus]\nmap = "engine"\nconnection = "nowhere:0"\npace = "real_time"\n')
    assert main(["rig", "run", str(file), "--mode", "bench", "--folder", str(tmp_path / "run")]) == 2
    assert "inputs = 'soc_cad': must be duty" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_ctrl_c_ends_a_run_over_the_bus_with_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, folder = tmp_path / "track.toml", tmp_path / "run"
    file.write_text(TRACK.format(seed=1).replace("step:20:35", "sine:30:5:1"))
    command = [sys.executable, "-m", "mgdd", "rig", "run", str(file), "--mode", "hil"]
    process = subprocess.Popen([*command, "--folder", str(folder), "--json"], stdout=subprocess.PIPE, text=True)
    until = time.monotonic() + 60.0
    while not (folder / "run.rec").exists() or (folder / "run.rec").stat().st_size < 40_000:
        assert time.monotonic() < until
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)
    out, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    said = json.loads(out)
    assert said["interrupted"] is True
    assert 0 < said["timing"]["cycles"] < 6000
    assert json.loads((folder / "result.json").read_text())["interrupted"] is True
    assert main(["rig", "replay", str(folder), "--quiet", "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)["replay"]
    assert compared["samples"] == compared["recorded"]


def test_record_listens_and_export_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bus.rec"
    with VirtualNode("etb", step=True) as node, CanRig("etb", node.bus, mode="hil", timeout_s=5.0) as rig:
        listener = subprocess.Popen(
            [sys.executable, "-m", "mgdd", "rig", "record", str(file), "--bus", node.bus, "--json"],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        until = time.monotonic() + 60.0
        while not file.exists() or read_record(file).frames.sizes["frame"] < 60:
            assert time.monotonic() < until
            rig.apply({"duty": 0.2})
            rig.measure()
            time.sleep(0.005)
        listener.send_signal(signal.SIGINT)
        out, _ = listener.communicate(timeout=60.0)
    assert listener.returncode == 0
    assert json.loads(out)["frames"] == read_record(file).frames.sizes["frame"]
    assert {0x120, 0x121} <= set(read_record(file).frames["id"].to_numpy().tolist())
    assert main(["rig", "export", str(file), str(tmp_path / "tables"), "--kind", "csv", "--quiet"]) == 0
    assert (tmp_path / "tables" / "frames.csv").stat().st_size > 1000
    assert main(["rig", "export", str(file), str(tmp_path / "bus.asc"), "--quiet"]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("loop", ["python", pytest.param("core", marks=pytest.mark.slow)])
def test_the_self_test_times_every_way_to_die(loop: str, capsys: pytest.CaptureFixture[str]) -> None:
    """No timing of this machine is asserted here but that of the plate, which the node simulates on its own clock."""
    code = main(["rig", "selftest", "--json", "--quiet", "--loop", loop])
    said = json.loads(capsys.readouterr().out)
    assert list(said["ways_to_die"]) == list(WAYS_OF[loop])
    times = [seconds for seconds in said["ways_to_die"].values() if seconds is not None]
    assert len(times) == len(WAYS_OF[loop]), said["notes"]
    assert all(0.1 < seconds < 1.0 for seconds in times)  # the springs need some 0.2 s from the open plate
    assert max(times) <= LIMIT_S
    assert code == 0


def test_a_slow_or_missing_way_fails_the_self_test() -> None:
    times: dict[str, float | None] = dict.fromkeys(WAYS_TO_DIE, 0.3)
    assert SelfTest(ways_to_die=times, limit_s=LIMIT_S, notes={}).passed
    assert not SelfTest(ways_to_die={**times, "nan": 0.41}, limit_s=LIMIT_S, notes={}).passed
    assert not SelfTest(ways_to_die={**times, "hang": None}, limit_s=LIMIT_S, notes={"hang": "why"}).passed
    assert not SelfTest(ways_to_die={"nan": 0.1}, limit_s=LIMIT_S, notes={}).passed
